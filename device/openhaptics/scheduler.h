// The one callback that this process has with OpenHaptics, and the devices in it.
#pragma once

#include <functional>

#include "device/openhaptics/api.h"

namespace fs::openhaptics {

class Touch;

// Calls initialise while the thread of OpenHaptics stands still, as a device must not be opened or closed beside it; before, the devices
// that are open get force 0. Then adds the device to the callback. Throws what initialise throws, and a Refusal when the callback cannot
// be started.
void attach(const Api& api, Touch& device, const std::function<void()>& initialise);

// Takes the device out, once its force is 0, and gives it back.
void detach(const Api& api, Touch& device) noexcept;

// Whether a device that is open has this handle.
bool is_attached(Handle handle) noexcept;

}  // namespace fs::openhaptics
