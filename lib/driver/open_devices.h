// The devices that are open. When the process ends, their forces are set to 0.
#pragma once

struct fs_device;

namespace fs {

void add_open_device(fs_device& device);
void remove_open_device(fs_device& device) noexcept;  // waits while the process's end uses the device

// From now on, when the process ends, the forces are set to 0 before any static object that exists now is destroyed.
void guard_process_end() noexcept;

}  // namespace fs
