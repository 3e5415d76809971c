#include "device/makers/hd_stand_in.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <thread>
#include <utility>

#include "scenes/vector.h"

#define HD extern "C" __attribute__((visibility("default")))

using makers::HdDevice;
using makers::HdStandIn;
using scenes::operator+, scenes::operator*;
using scenes::norm;

struct ErrorInfo {
  unsigned code;
  int internal_code;
  unsigned handle;
};

namespace {

constexpr unsigned none = 0xffffffff;

HdStandIn& it() {
  static auto* const instance = new HdStandIn;  // never destroyed, as its thread goes on
  return *instance;
}

// Of static storage: the leak sanitizer fails where a thread with storage of a loaded library ends while it looks.
[[gnu::tls_model("initial-exec")]] thread_local unsigned current = none;
[[gnu::tls_model("initial-exec")]] thread_local std::deque<ErrorInfo> errors;

void fail(unsigned code, int internal_code = 0) { errors.push_back({code, internal_code, current}); }

void sleep_s(double time) { std::this_thread::sleep_for(std::chrono::duration<double>(time)); }

// x to the right, y up, z to the user.
fs_vec3 to_maker(fs_vec3 v) { return {v.x, v.z, -v.y}; }
fs_vec3 to_device(const double* v) { return {v[0], -v[2], v[1]}; }

// The current device, with the mutex held, or null.
std::shared_ptr<HdDevice> device() {
  return current < it().devices.size() && it().devices[current]->is_open ? it().devices[current] : nullptr;
}

// What a function does to the current device. in_frame: it counts only between the begin and the end of a frame.
template <class Act>
void call(bool in_frame, Act act) {
  const std::lock_guard lock(it().mutex);
  const auto found = device();
  if (!found) return fail(0x101);  // bad handle
  found->handle.note_caller();
  if (in_frame && !found->is_in_frame) {
    ++it().outside;
    return fail(0x402);
  }
  act(*found);
}

// ----------------------------------------------------------------------------------------------------------------- its thread

struct Scheduled {
  unsigned long number;
  unsigned (*callback)(void*);
  void* data;
  unsigned short priority;
};

class Thread {
 public:
  unsigned long add(unsigned (*callback)(void*), void* data, unsigned short priority) {
    const std::lock_guard lock(mutex_);
    all_.push_back({++last_, callback, data, priority});
    std::stable_sort(all_.begin(), all_.end(), [](const Scheduled& a, const Scheduled& b) { return a.priority > b.priority; });
    return last_;
  }
  void remove(unsigned long number) {
    const std::lock_guard lock(mutex_);
    std::erase_if(all_, [&](const Scheduled& each) { return each.number == number; });
  }
  size_t count() {
    const std::lock_guard lock(mutex_);
    return all_.size();
  }
  void start() {
    if (thread_.joinable()) return;
    ends_ = false;
    thread_ = std::thread([this] { run(); });
  }
  void stop() {
    ends_ = true;
    if (thread_.joinable()) thread_.join();
  }

 private:
  void run() {
    for (auto next = std::chrono::steady_clock::now(); !ends_;) {
      next = std::max(next + std::chrono::milliseconds(1), std::chrono::steady_clock::now() - std::chrono::milliseconds(1));
      std::this_thread::sleep_until(next);
      if (it().change([](HdStandIn& all) { return all.thread_stands; })) continue;
      std::vector<Scheduled> now;
      {
        const std::lock_guard lock(mutex_);
        now = all_;
      }
      for (const Scheduled& each : now) {
        if (each.callback(each.data) == 0) remove(each.number);
      }
    }
  }

  std::mutex mutex_;
  std::vector<Scheduled> all_;
  unsigned long last_ = 0;
  std::atomic<bool> ends_{false};
  std::thread thread_;
};
Thread& scheduler() {
  static auto* const thread = new Thread;
  return *thread;
}

}  // namespace

makers::HdStandIn::HdStandIn() { devices.push_back(std::make_shared<HdDevice>("Default Device", "T1")); }

HD HdStandIn* hd_stand_in_here() { return &it(); }

HD ErrorInfo hdGetError() {
  if (errors.empty()) return {0, 0, none};
  const ErrorInfo oldest = errors.front();
  errors.pop_front();
  return oldest;
}
HD unsigned hdInitDevice(const char* name) {
  std::printf("OpenHaptics developer edition: commercial distribution is prohibited\n");
  if (std::system("true") != 0) return none;
  const std::lock_guard lock(it().mutex);
  if (it().is_running) ++it().opened_beside;
  if (!name && it().refuses_null) return fail(0x302, -28), none;
  const std::string wanted = name ? name : it().default_name;
  for (size_t i = 0; i < it().devices.size(); ++i) {
    HdDevice& each = *it().devices[i];
    const bool is_meant = each.name == wanted || (i == 0 && wanted == it().default_name);
    if (!is_meant) continue;
    if (each.is_open) return fail(0x301), none;
    if (!each.is_there) break;
    each.is_open = true;
    ++each.times_opened;
    current = static_cast<unsigned>(i);
    return current;
  }
  return fail(0x302, -28), none;
}
HD void hdDisableDevice(unsigned handle) {
  const std::lock_guard lock(it().mutex);
  if (handle >= it().devices.size()) return fail(0x101);
  HdDevice& each = *it().devices[handle];
  each.handle.note_caller();
  if (norm(each.handle.force()) > 0 && each.is_there) ++each.closed_pushing;
  each.handle.rest();
  each.is_open = each.is_enabled = each.is_in_frame = false;
}
HD void hdMakeCurrentDevice(unsigned handle) { current = handle; }

HD void hdBeginFrame(unsigned handle) {
  current = handle;
  sleep_s(it().block);
  call(false, [&](HdDevice& each) {
    ++it().frames;
    if (each.is_in_frame) {
      ++it().nested;
      return fail(0x400);
    }
    if (!each.is_there) return fail(0x302, -28);
    for (const unsigned code : std::exchange(each.errors, {})) fail(code, 7);
    each.is_in_frame = true;
    each.force = each.torque = {};
  });
}
HD void hdEndFrame(unsigned handle) {
  current = handle;
  bool sends = false;
  call(false, [&](HdDevice& each) {
    if (!each.is_there) return fail(0x302, -28);
    if (!each.is_in_frame) return fail(0x401);
    each.is_in_frame = false;
    sends = true;
  });
  if (!sends) return;
  sleep_s(it().block);
  call(false, [&](HdDevice& each) {
    const bool gives = each.is_enabled && each.is_there && each.calibration == 0x5000 && !each.is_in_inkwell;
    each.handle.command(gives ? each.force : fs_vec3{}, gives ? each.torque : fs_vec3{});
  });
}

HD void hdEnable(unsigned what) {
  call(false, [&](HdDevice& each) {
    if (what == 0x4000) each.is_enabled = true;
    if (what == 0x4001) each.is_clamped = true;
  });
}
HD void hdGetDoublev(unsigned what, double* out) {
  const bool is_of_frame = what == 0x2050 || what == 0x2052;
  call(is_of_frame, [&](HdDevice& each) {
    switch (what) {
      case 0x2052: {
        const auto measured = each.handle.measure();
        const fs_quat q = norm(measured.rotation) > 0 ? scenes::turn(measured.rotation, norm(measured.rotation)) * each.orientation
                                                      : each.orientation;
        for (int i = 0; i < 3; ++i) {
          const double axis[3] = {double(i == 0), double(i == 1), double(i == 2)};
          const fs_vec3 column = to_maker(scenes::rotate(q, to_device(axis)));
          out[4 * i] = column.x, out[4 * i + 1] = column.y, out[4 * i + 2] = column.z, out[4 * i + 3] = 0;
        }
        const fs_vec3 p = to_maker(measured.position);
        out[12] = 1e3 * p.x + 0.5 * (each.box[0] + each.box[3]);
        out[13] = 1e3 * p.y + 0.5 * (each.box[1] + each.box[4]);
        out[14] = 1e3 * p.z + 0.5 * (each.box[2] + each.box[5]);
        out[15] = 1;
        if (each.gives_nan) out[13] = std::nan("");
        return;
      }
      case 0x2551: std::copy(each.box, each.box + 6, out); return;
      case 0x2603: *out = each.max_force; return;
      case 0x2605: std::fill(out, out + each.output_axes, each.temperature); return;
      default: fail(0x100);
    }
  });
}
HD void hdGetIntegerv(unsigned what, int* out) {
  call(what == 0x2000, [&](HdDevice& each) {
    switch (what) {
      case 0x2000: *out = each.buttons; return;
      case 0x2554: *out = each.output_axes; return;
      case 0x2555: *out = each.style; return;
      default: fail(0x100);
    }
  });
}
HD void hdGetBooleanv(unsigned what, unsigned char* out) {
  call(true, [&](HdDevice& each) {
    if (what == 0x2002) *out = each.is_in_inkwell;
    else fail(0x100);
  });
}
HD const char* hdGetString(unsigned what) {
  const char* text = "";
  call(false, [&](HdDevice& each) { text = what == 0x2501 ? each.model.c_str() : what == 0x2504 ? each.serial.c_str() : ""; });
  return text;
}
HD void hdSetDoublev(unsigned what, const double* in) {
  call(true, [&](HdDevice& each) {
    if (what == 0x2700) {
      each.force = to_device(in);
      if (norm(each.force) > each.max_force && !each.is_clamped) fail(0x201);
    } else if (what == 0x2701 && each.output_axes == 6) {
      each.torque = 1e-3 * to_device(in);
    } else {
      fail(0x100);
    }
  });
}

HD unsigned hdCheckCalibration() {
  unsigned state = 0x5002;
  call(false, [&](HdDevice& each) { state = each.calibration; });
  return state;
}
HD void hdUpdateCalibration(unsigned style) {
  call(false, [&](HdDevice& each) {
    ++each.updates;
    each.last_style = static_cast<int>(style);
    if (style == 4 && !each.is_in_inkwell) return fail(0x500);
    if (static_cast<int>(style) & each.style) each.calibration = 0x5000;
  });
}

HD unsigned long hdScheduleAsynchronous(unsigned (*callback)(void*), void* data, unsigned short priority) {
  const unsigned long number = scheduler().add(callback, data, priority);
  it().change([](HdStandIn& all) { return all.callbacks = static_cast<int>(scheduler().count()); });
  return number;
}
HD void hdUnschedule(unsigned long callback) {
  scheduler().remove(callback);
  it().change([](HdStandIn& all) { return all.callbacks = static_cast<int>(scheduler().count()); });
}
HD void hdStartScheduler() {
  scheduler().start();
  it().change([](HdStandIn& all) { return all.is_running = true; });
}
HD void hdStopScheduler() {
  scheduler().stop();
  it().change([](HdStandIn& all) {
    all.is_running = false;
    for (const auto& each : all.devices) {
      if (each->is_open && each->is_there && !all.thread_stands && norm(each->handle.force()) > 0) ++each->stopped_pushing;
    }
    return 0;
  });
}
