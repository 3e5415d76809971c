#include "mirror.h"

#include <atomic>
#include <chrono>
#include <cmath>
#include <cstring>

#include "samples.h"

namespace bridge {
namespace {

// The newest hand, for the servo's thread: it never waits. The words are atomic, and the number is odd while they are written.
class Shown {
 public:
  void set(const fs_state& state) noexcept {
    uint64_t words[count];
    std::memcpy(words, &state, sizeof state);
    const uint64_t number = number_.load(std::memory_order_relaxed);
    number_.store(number + 1, std::memory_order_release);
    for (size_t i = 0; i < count; ++i) words_[i].store(words[i], std::memory_order_release);
    number_.store(number + 2, std::memory_order_release);
  }
  bool get(fs_state& out) const noexcept {
    uint64_t words[count];
    for (int tries = 0; tries < 8; ++tries) {
      const uint64_t before = number_.load(std::memory_order_acquire);
      for (size_t i = 0; i < count; ++i) words[i] = words_[i].load(std::memory_order_acquire);
      if (before % 2 == 0 && number_.load(std::memory_order_acquire) == before) {
        std::memcpy(&out, words, sizeof out);
        return before > 0;
      }
    }
    return false;
  }

 private:
  static constexpr size_t count = sizeof(fs_state) / sizeof(uint64_t);
  static_assert(sizeof(fs_state) % sizeof(uint64_t) == 0);
  std::atomic<uint64_t> number_{0};
  std::atomic<uint64_t> words_[count]{};
};

Shown shown;
std::atomic<bool> is_lost{false};
fs_device_info info;  // written before the device is opened

double now() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

fs_status open_mirror(const char*, void** self) {
  *self = &shown;
  return FS_OK;
}
void close_mirror(void*) {}
fs_status get_info(void*, fs_device_info* out) {
  fs_device_info told = info;
  told.struct_size = out->struct_size;
  std::memcpy(out, &told, std::min<size_t>(out->struct_size, sizeof told));
  return FS_OK;
}
fs_status read_mirror(void*, fs_state* out) {
  if (is_lost.load(std::memory_order_acquire)) return FS_ERROR_DISCONNECTED;
  fs_state state;
  if (!shown.get(state)) return FS_OK;  // nothing has come yet: not ready
  *out = state;
  // Between two poses the hand goes on as it moved.
  const double ahead = std::fmin(std::fmax(0, now() - state.time), 0.02);
  const fs_vec3& v = state.twist.linear;
  fs_vec3& x = out->pose.position;
  x = {x.x + ahead * v.x, x.y + ahead * v.y, x.z + ahead * v.z};
  return FS_OK;
}
fs_status write_mirror(void*, const fs_wrench*) { return FS_OK; }

}  // namespace

void register_mirror() {
  fs_driver driver{};
  driver.struct_size = sizeof driver;
  driver.scheme = "mirror";
  driver.open = open_mirror;
  driver.close = close_mirror;
  driver.get_info = get_info;
  driver.read = read_mirror;
  driver.write = write_mirror;
  forceserver::throw_on_error(fs_driver_register(&driver));
}

void show_device(const std::string& site, const forceserver_Status& status, double hand_rate) {
  fs_device_info out = fs_device_info_init();
  put_text(out.name, text_of(status.device).substr(0, 40) + ", of site " + site);
  out.force_axes = std::min(status.force_axes, 3u);
  out.torque_axes = std::min(status.torque_axes, 3u);
  out.workspace_radius = status.workspace_radius;
  out.workspace_height = status.workspace_height;
  out.workspace_angle = status.workspace_angle;
  out.force_max = status.force_max;
  out.torque_max = status.torque_max;
  out.damping = status.device_damping;
  out.mass = status.mass;
  out.rate = std::fmin(std::fmax(status.rate, 100), 20000);
  // Poses come over the network: they may be 20 ms older than this before they count as lost. A link_rate would say the same, but
  // it would also bound the slopes, which are to be those of the other site.
  out.delay = 0.06 + 1 / hand_rate;
  out.watchdog = 0;
  info = out;
}

void show_hand(const forceserver_Hand& hand, double arrived) {
  fs_state state{};
  state.pose = to_c(hand.place);
  state.twist = to_c(hand.motion);
  state.time = arrived;
  state.flags = hand.flags;
  state.buttons = hand.buttons;
  const double all[] = {state.pose.position.x,    state.pose.position.y,    state.pose.position.z,    state.pose.orientation.w,
                        state.pose.orientation.x, state.pose.orientation.y, state.pose.orientation.z, state.twist.linear.x,
                        state.twist.linear.y,     state.twist.linear.z,     state.twist.angular.x,    state.twist.angular.y,
                        state.twist.angular.z};
  for (const double value : all) {
    if (!std::isfinite(value)) return;
  }
  shown.set(state);
  is_lost.store(false, std::memory_order_release);
}

void show_no_hand() { is_lost.store(true, std::memory_order_release); }

}  // namespace bridge
