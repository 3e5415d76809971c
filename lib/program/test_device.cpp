// forceserver test-device: what a device and its driver do, measured and judged, for whoever makes one.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <optional>

#include "device_page.h"
#include "device_steps.h"
#include "program.h"
#include "words.h"

namespace {

template <class Function>
double time_of(Function f) {
  const double begin = now();
  f();
  return now() - begin;
}

// "; it was not so N times", where N is not 0.
std::string exceptions(std::size_t count) { return count ? format("; it was not so %zu times", count) : ""; }

// What a reading gives before a driver that waits for its device has given a state: nothing, at the time of the reading.
bool is_empty(const fs_state& state, double asked) {
  return (state.flags & ~FS_STATE_CONNECTING) == 0 && length(state.pose.position) == 0 && state.time >= asked;
}

class DeviceTest {
 public:
  explicit DeviceTest(const TestDeviceOptions& options) : options_(options) {}

  int run() {
    open();
    is_ready_ = make_ready(page_, device_, options_.requests, options_.wait);
    test_states();
    test_calls();
    test_servo();
    if (options_.push > 0) test_push();
    device_.reset();
    test_opening();
    page_.finish();
    return page_.has(Verdict::failed) || page_.has(Verdict::odd) ? exit_odd : exit_fine;
  }

 private:
  void open() {
    const double taken = time_of([&] { device_ = Device::open(options_.uri); });
    page_.title("Test of the device " + options_.uri);
    describe_machine(page_, options_.uri);
    info_ = device_.get_info();
    page_.figure("opened", format("in %.3f s", taken));
    describe_device(page_, device_);
    page_.expect(*info_.serial, Verdict::odd,
                 "it has a serial number: without one a device that comes back cannot be told from another");
  }

  // The states as they come, without a servo.
  void test_states() {
    page_.heading(format("States, during %g s", options_.seconds));
    const double expected = info_.link_rate > 0 ? info_.link_rate : info_.rate;
    const double look_every = std::min(2e-4, 0.2 / expected);
    Durations intervals, ages;
    std::size_t looks = 0, errors = 0, empty = 0, back = 0, ahead = 0, outside = 0;
    std::string error;
    fs_state last{};
    const double begin = now();
    double silence = 0, heard = begin;  // the longest, and since when there is one
    double held_up = 0;  // the most by which this thread woke too late
    const auto hear = [&](double time) {
      silence = std::max(silence, time - heard);
      heard = time;
    };
    for (double next = begin; next < begin + options_.seconds; next += look_every) {
      const double due = std::max(next, now());
      sleep_for(std::max(0.0, next - now()));
      ++looks;
      fs_state state{};
      const double asked = now();
      held_up = std::max(held_up, asked - due);
      try {
        state = device_.read();
      } catch (const Error& failure) {
        ++errors;
        error = failure.what();
        continue;
      }
      if (is_empty(state, asked)) {
        ++empty;
        continue;
      }
      if ((state.flags ^ last.flags) & FS_STATE_READY) last.time = 0;  // until it is ready its time may be that of the reading
      const double age = now() - state.time;
      if (age < -1e-3) ++ahead;
      if (state.time < last.time) ++back;
      if (state.time != last.time) {
        if (last.time > 0) intervals.add(state.time - last.time);
        ages.add(age);
        hear(now());
      }
      if (is_ready_ && !(std::hypot(state.pose.position.x, state.pose.position.y) <= 1.5 * info_.workspace_radius &&
                         std::fabs(state.pose.position.z) <= 0.75 * info_.workspace_height)) {
        ++outside;
      }
      last = state;
    }
    hear(now());
    silence = std::max(silence, intervals.longest());
    const double rate = static_cast<double>(intervals.count()) / (now() - begin);
    page_.figure("states", format("%.1f a second, %.1f looks a second", rate, static_cast<double>(looks) / (now() - begin)));
    page_.figure("interval", intervals.count() ? intervals.text() : "none");
    page_.figure("age", ages.count() ? ages.text() + ", when first seen" : "none");
    page_.expect(errors == 0, Verdict::failed,
                 errors ? format("%zu of %zu readings failed, the last with: %s", errors, looks, error.c_str())
                        : "no reading fails");
    if (errors == looks) return;  // there is nothing to judge
    page_.expect(empty == 0, Verdict::failed,
                 empty ? format("%zu of %zu readings gave no state", empty, looks - errors) : "every reading gives a state");
    page_.expect(rate >= 0.9 * expected, Verdict::odd,
                 format("states come at least as often as it tells: %.1f of %g a second", rate, expected));
    const bool is_fault = silence > age_max(info_);
    // This program may have caused the silence itself: it was held up for nearly as long.
    const bool is_busy = is_fault && silence <= age_max(info_) + held_up;
    const std::string busy =
        format("; this program itself was held up for %.1f ms: the machine is busy, see forceserver doctor", held_up * 1e3);
    page_.expect(!is_fault, is_busy ? Verdict::odd : Verdict::failed,
                 format("no silence is a fault: the longest was %.1f ms, and a pose may be %.1f ms old%s", silence * 1e3,
                        age_max(info_) * 1e3, is_busy ? busy.c_str() : ""));
    const double age = ages.quantile(0.99);
    page_.expect(ages.count() && age <= age_max(info_) / 2,
                 ages.count() && age <= age_max(info_) ? Verdict::odd : Verdict::failed,
                 ages.count() ? format("states are fresh: 99 of 100 are at most %.3f ms old", age * 1e3)
                              : "states are fresh: none has come");
    page_.expect(back == 0, Verdict::failed, "time never goes back" + exceptions(back));
    page_.expect(ahead == 0, Verdict::failed, "no state is of the future" + exceptions(ahead));
    if (is_ready_)
      page_.expect(outside == 0, Verdict::odd,
                   "the handle is in the workspace, or less than half beyond it" + exceptions(outside));
  }

  void test_calls() {
    page_.heading("Calls, without a servo");
    Durations reading, writing;
    const fs_wrench none{};
    std::size_t failed = 0;
    for (int i = 0; i < 500; ++i) {
      sleep_for(1e-3);
      fs_state state;
      fs_status read = FS_OK, written = FS_OK;
      reading.add(time_of([&] { read = fs_device_read(device_.get(), &state); }));
      writing.add(time_of([&] { written = fs_device_write(device_.get(), &none); }));
      failed += read != FS_OK || written != FS_OK;
    }
    page_.figure("read", reading.text());
    page_.figure("write", writing.text());
    page_.expect(failed == 0, Verdict::failed, "reading and writing succeed" + exceptions(failed));
    page_.expect(std::max(reading.quantile(0.9), writing.quantile(0.9)) < 0.5e-3, Verdict::failed,
                 "reading and writing never wait for the device");
    fs_answer answer{};
    fs_status status = FS_OK;
    const double taken = time_of([&] { status = fs_device_control(device_.get(), "a request that no device knows", &answer); });
    page_.expect(status == FS_ERROR_UNSUPPORTED && taken < 1, Verdict::odd,
                 format("an unknown request is refused as UNSUPPORTED (%s, after %.3f s)", fs_status_name(status), taken));
  }

  // A servo with an empty scene.
  void test_servo() {
    page_.heading(format("A servo that sends force 0, during %g s", options_.seconds));
    const Scene scene = Scene::create();
    const Servo servo = Servo::start(scene, device_);
    sleep_for(options_.seconds);
    fs_servo_stats stats = fs_servo_stats_init();
    forceserver::throw_on_error(fs_scene_get_servo_stats(scene.get(), &stats));
    page_.figure("ticks",
                 format("%.1f a second, %llu missed, priority %s", stats.rate, static_cast<unsigned long long>(stats.misses),
                        word_of(fs_realtime_name(stats.realtime)).c_str()));
    page_.figure("late",
                 format("p50 %.3f, p99 %.3f, max %.3f ms", stats.late_p50 * 1e3, stats.late_p99 * 1e3, stats.late_max * 1e3));
    page_.figure("a tick", format("p50 %.3f, p99 %.3f, max %.3f ms", stats.compute_p50 * 1e3, stats.compute_p99 * 1e3,
                                  stats.compute_max * 1e3));
    page_.figure("rendered", format("at most %.0f N/m, for a delay of %.3f ms", stats.max_stiffness, stats.delay * 1e3));
    page_.expect(stats.device_errors == 0, Verdict::failed, "no tick fails at the device" + exceptions(stats.device_errors));
    page_.expect(stats.faults == 0, Verdict::odd,
                 stats.faults ? "there is a fault: " + fault_names(stats.faults) : "there is no fault");
    if (stats.link_delay_p50 > 0) {
      page_.figure("link",
                   format("p50 %.3f, p99 %.3f ms from pose to force, %.1f poses a second, %.3f %% lost",
                          stats.link_delay_p50 * 1e3, stats.link_delay_p99 * 1e3, stats.link_rate, stats.link_loss * 100));
      const double slack = 0.25 / info_.rate;  // s: what threads and clocks add, and what a loop hardly feels
      page_.expect(stats.link_delay_p50 <= 1.5 * info_.delay + slack, Verdict::odd,
                   "the delay that it tells of is not far below the measured one: " + milliseconds(info_.delay) + " told, " +
                       milliseconds(stats.link_delay_p50) + " measured");
      page_.expect(stats.link_loss <= 0.01, Verdict::odd, format("little is lost: %.3f %%", stats.link_loss * 100));
    } else {
      page_.figure("link", "the driver measures none (get_link in driver.h)");
    }
  }

  // Pushes along each axis, one after the other, and looks where the handle goes.
  void test_push() {
    page_.heading(format("A force of %g N along each axis", options_.push));
    if (!is_ready_) {
      page_.note(Verdict::odd, "a force moves the handle: not tried, as the device is not ready");
      return;
    }
    if (options_.push > info_.force_max) {
      page_.note(Verdict::odd, format("--push is %g N, and the device gives %g N at most", options_.push, info_.force_max));
      return;
    }
    const ForceEnding ending;
    try {
      for (int axis = 0; axis < static_cast<int>(info_.force_axes); ++axis) test_axis(axis, ending);
    } catch (...) {
      device_.reset();  // its force is 0 before a signal counts again
      throw;
    }
  }

  // The pose, of which it must be known where the handle is now. Notes why not, where it is not known.
  std::optional<fs_vec3> fresh_position(const char* axis, const char* what) {
    const Place place = fresh_place(device_, info_);
    if (place.position) return place.position;
    page_.note(Verdict::failed, format("a force along %s: %s: %s", axis, what, place.why.c_str()));
    return std::nullopt;
  }

  void test_axis(int axis, const ForceEnding& ending) {
    const char* const name = axis == 0 ? "x" : axis == 1 ? "y" : "z";
    const std::optional<fs_vec3> way = push_along(axis, name, ending);
    if (!way) return;
    const fs_vec3 moved = *way;
    const double along = axis == 0 ? moved.x : axis == 1 ? moved.y : moved.z;
    page_.figure(name, format("the handle moved by %.2f, %.2f, %.2f mm", moved.x * 1e3, moved.y * 1e3, moved.z * 1e3));
    if (length(moved) < 0.5e-3) {
      page_.note(Verdict::odd, format("a force along %s moves the handle (it stays: hold it loosely, or push more)", name));
    } else {
      const bool is_reversed = along <= -0.7 * length(moved);
      page_.expect(along >= 0.7 * length(moved), Verdict::failed,
                   format("a force along %s moves the handle along %s%s", name, name,
                          is_reversed ? "; it goes the other way" : ""));
    }
  }

  // How far the handle has moved after 0.2 s in which the force grows, and 0.1 s in which it stays; it ends early when the
  // handle is 20 mm away, and when it is not known any more where it is.
  std::optional<fs_vec3> push_along(int axis, const char* name, const ForceEnding& ending) {
    const std::optional<fs_vec3> start = fresh_position(name, "not pushed");
    std::optional<fs_vec3> position = start;
    const double begin = now();
    for (double t = 0; position && t < 0.3 && length(minus(*position, *start)) < 0.02; t = now() - begin) {
      fs_wrench wrench{};
      const double force = options_.push * std::min(1.0, t / 0.2);
      (axis == 0 ? wrench.force.x : axis == 1 ? wrench.force.y : wrench.force.z) = force;
      device_.write(wrench);
      ending.pause(1e-3);
      position = fresh_position(name, "the push was ended");
    }
    device_.write({});
    if (!position) return std::nullopt;
    wait_for_rest(device_, ending);
    return minus(*position, *start);
  }

  static std::ptrdiff_t entries(const char* folder) {
    std::error_code none;
    return std::distance(std::filesystem::directory_iterator(folder, none), std::filesystem::directory_iterator());
  }

  struct Count {
    std::ptrdiff_t files, threads;
    bool operator==(const Count&) const = default;
  };

  // The open files and threads, once they have stood still for 0.3 s, or after 2 s: a thread may end a little later than the
  // call that ends it.
  static Count settled_count() {
    const auto count = [] { return Count{entries("/proc/self/fd"), entries("/proc/self/task")}; };
    Count present = count();
    const double begin = now();
    for (double changed = begin; now() - changed < 0.3 && now() - begin < 2;) {
      sleep_for(0.02);
      const Count next = count();
      if (next != present) changed = now();
      present = next;
    }
    return present;
  }

  // Opened and closed again and again, after a time that differs.
  void test_opening() {
    constexpr int times = 10;
    page_.heading(format("Opened and closed %d times", times));
    Durations opening, closing;
    Count before{};
    for (int i = 0; i < times; ++i) {
      Device device;
      opening.add(time_of([&] { device = Device::open(options_.uri); }));
      sleep_for(0.01 * (i % 5));
      if (i % 2) device.write({});
      closing.add(time_of([&] { device.reset(); }));
      if (i > 0) continue;
      before = settled_count();
    }
    page_.figure("open", opening.text());
    page_.figure("close", closing.text());
    const Count after = settled_count();
    const std::ptrdiff_t files_left = std::max<std::ptrdiff_t>(0, after.files - before.files);
    const std::ptrdiff_t threads_left = std::max<std::ptrdiff_t>(0, after.threads - before.threads);
    page_.expect(closing.longest() < 1, Verdict::failed, "closing never hangs");
    page_.expect(files_left == 0 && threads_left == 0, Verdict::failed,
                 format("nothing is left behind (%td open files, %td threads)", files_left, threads_left));
  }

  const TestDeviceOptions& options_;
  DevicePage page_;
  Device device_;
  fs_device_info info_ = fs_device_info_init();
  bool is_ready_ = false;
};

}  // namespace

int test_device(const TestDeviceOptions& options) {
  load_driver(options.driver);
  try {
    return DeviceTest(options).run();
  } catch (const Interrupted&) {
    std::fprintf(stderr, "interrupted; the force is 0\n");
    return exit_failed;
  }
}
