#include "device/waiting_device.h"

#include <sys/syscall.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <set>
#include <stdexcept>
#include <thread>
#include <utility>

namespace scenes {
namespace {

std::set<std::string> registered;
WaitingDevice* present = nullptr;  // one device at a time: each test makes its own

WaitingDevice& of(void* self) { return *static_cast<WaitingDevice*>(self); }

}  // namespace

double now_s() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }
uint64_t thread_number() { return static_cast<uint64_t>(syscall(SYS_gettid)); }

WaitingDevice::WaitingDevice(const char* scheme, uint32_t flags) : scheme_(scheme) {
  present = this;
  if (!registered.insert(scheme).second) return;
  fs_driver driver{};
  driver.struct_size = sizeof driver;
  driver.scheme = scheme_.c_str();
  driver.flags = flags;
  driver.open = [](const char*, void** self) {
    *self = present;
    return present ? present->open_it() : FS_ERROR_NOT_FOUND;
  };
  driver.close = [](void* self) { of(self).close_it(); };
  driver.get_info = [](void* self, fs_device_info* out) {
    of(self).describe(*out);
    return FS_OK;
  };
  driver.receive = [](void* self, fs_state* out) { return of(self).receive(*out); };
  driver.send = [](void* self, const fs_wrench* wrench) { return of(self).send(*wrench); };
  driver.get_link = [](void* self, fs_link* out) { return of(self).get_link(*out); };
  driver.control = [](void* self, const char* request, char* answer, size_t size) {
    return of(self).control(request, answer, size);
  };
  require(fs_driver_register(&driver), "fs_driver_register");
}

WaitingDevice::~WaitingDevice() {
  let_go();
  // A thread that was left behind in this device ends before it goes.
  for (int i = 0; i < 5000 && is_open(); ++i) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  present = nullptr;
}

void WaitingDevice::hang(Call call) {
  const std::lock_guard lock(hanging_mutex_);
  hangs_ = call;
  changed_.notify_all();
}

void WaitingDevice::await_hanging() {
  std::unique_lock lock(hanging_mutex_);
  changed_.wait(lock, [this] { return hanging_ > 0; });
}

void WaitingDevice::hang_in(Call call) {
  std::unique_lock lock(hanging_mutex_);
  if (hangs_ != call) return;
  ++hanging_;
  changed_.notify_all();
  changed_.wait(lock, [&] { return hangs_ != call; });
  --hanging_;
}

std::vector<WaitingDevice::Sent> WaitingDevice::sent() const {
  const std::lock_guard lock(sent_mutex_);
  return sent_;
}

fs_status WaitingDevice::open_it() {
  hang_in(in_open);
  const std::lock_guard lock(mutex);
  if (open_status != FS_OK) return fs_fail(open_status, "the plug is red");
  ++opens_;
  return FS_OK;
}

void WaitingDevice::close_it() {
  hang_in(in_close);
  ++closes_;
}

void WaitingDevice::describe(fs_device_info& out) {
  const std::lock_guard lock(mutex);
  std::snprintf(out.name, sizeof out.name, "a device that waits");
  std::snprintf(out.serial, sizeof out.serial, "%s", serial.c_str());
  out.force_axes = 3;
  out.force_max = 10;
  out.rate = 1000;
  out.damping = 1;
  out.mass = mass;
  out.workspace_radius = out.workspace_height = 0.2;
}

fs_status WaitingDevice::receive(fs_state& out) {
  hang_in(in_receive);
  double wait;
  {
    const std::lock_guard lock(mutex);
    const double now = now_s();
    if (next_receive != FS_OK) {
      next_ = now - period;
      return std::exchange(next_receive, FS_OK);
    }
    if (std::fabs(next_ - now) > 2 * period) next_ = now;
    next_ += period;
    wait = next_ - now;
  }
  if (wait > 0.02) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    const std::lock_guard lock(mutex);
    next_ -= period;  // it is still to come
    return FS_ERROR_TIMEOUT;
  }
  std::this_thread::sleep_for(std::chrono::duration<double>(wait));
  const std::lock_guard lock(mutex);
  if (throws) throw std::runtime_error("the driver is broken");
  if (receive_status != FS_OK) return words ? fs_fail(receive_status, words) : receive_status;
  out.pose.orientation.w = 1;
  out.flags = FS_STATE_READY;
  const uint64_t number = ++states_;
  if (on_state) on_state(out, number);
  return FS_OK;
}

fs_status WaitingDevice::send(const fs_wrench& wrench) {
  hang_in(in_send);
  {
    const std::lock_guard lock(sent_mutex_);
    sent_.push_back({now_s(), states_, wrench, thread_number()});
  }
  const std::lock_guard lock(mutex);
  if (next_send != FS_OK) {
    next_ = now_s() - period;
    return std::exchange(next_send, FS_OK);
  }
  return send_status;
}

fs_status WaitingDevice::get_link(fs_link&) {
  hang_in(in_link);
  return FS_ERROR_UNSUPPORTED;
}

fs_status WaitingDevice::control(const char* request, char* answer, size_t size) {
  hang_in(in_control);
  if (std::strcmp(request, "echo") == 0) {
    std::snprintf(answer, size, "%s", serial.c_str());
    return FS_OK;
  }
  return fs_fail(FS_ERROR_UNSUPPORTED, "the requests are: echo");
}

}  // namespace scenes
