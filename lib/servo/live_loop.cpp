#include "servo/live_loop.h"

#include <algorithm>

namespace fs {

LiveLoop::LiveLoop(const LoopOptions& options, const LoopValues& first, const fs_device_info& device)
    : options_(options), measured_(device.delay) {
  values_.write(first);
}

LoopValues LiveLoop::values() const noexcept {
  LoopValues out{};
  values_.read(out);
  return out;
}

fs_link LiveLoop::link() const noexcept {
  fs_link out{};
  link_.read(out);
  return out;
}

bool LiveLoop::fetch(LoopValues& out) noexcept {
  const uint64_t count = count_.load(std::memory_order_acquire);
  if (count == fetched_ || !values_.read(out)) return false;
  fetched_ = count;
  return true;
}

const std::string& LiveLoop::measure(Device& device, double now) {
  static const std::string nothing;
  const double before = measured_.delay();
  if (!device.measures_link() || !measured_.look(device, now)) return nothing;
  link_.write(measured_.newest());
  if (measured_.delay() != before) {
    fs_device_info info = device.info();
    info.delay = measured_.delay();
    values_.write(options_.values(info));
    count_.fetch_add(1, std::memory_order_release);
  }
  return measured_.refusal();
}

DeviceLimit LiveLoop::limit(const fs_device_info& device, double speed) const noexcept {
  const LoopValues loop = values();
  DeviceLimit out{
      loop.max_stiffness, loop.max_stiffness, loop.object_damping, never, device.workspace_radius, device.workspace_height, speed,
      loop.impact};
  // Of a wrist's own damping and inertia nothing is known: a torque is taken to be as hard to render as a force at an arm that
  // a hand has, or at that of the largest force and torque.
  constexpr double arm = 0.05;  // m
  if (device.torque_axes > 0 && device.force_max > 0) out.lever = std::max(arm, device.torque_max / device.force_max);
  return out;
}

}  // namespace fs
