// The devices that are open. When the process ends, their forces are set to 0.
#pragma once

struct fs_device;

namespace fs {

void add_open_device(fs_device& device);
void remove_open_device(fs_device& device) noexcept;  // waits while the end of the process is dealing with it

// From now on the end of the process sets the forces to 0 before anything is destroyed that is static now.
void guard_process_end() noexcept;

}  // namespace fs
