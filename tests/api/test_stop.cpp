// However a servo ends, the device has force 0 from then on, before anything that may wait. Nothing here depends on
// time: a tick learns from fs_servo_step that the stop has begun.
#include <pthread.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <barrier>
#include <cstdio>
#include <cstring>
#include <functional>
#include <thread>
#include <vector>

#include "api/support.h"

using namespace scenes;

// Processes here end without releasing anything, and fork while they have threads: the sanitizers must not complain.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
extern "C" const char* __asan_default_options() { return "detect_leaks=0"; }
extern "C" const char* __tsan_default_options() { return "report_thread_leaks=0:die_after_fork=0"; }
#endif

// What has arrived at the device, in memory that outlives a process.
struct Arrived {
  std::atomic<uint32_t> forces;             // before the stop is known to have begun
  std::atomic<bool> has_begun, is_zero;     // since then
  std::atomic<uint32_t> late, again;        // forces since then: before the first 0, and after it
  std::atomic<uint32_t> strange, closed;    // calls by another process; calls of close
  std::atomic<bool> is_gone;                // what the driver needs has been destroyed
  std::atomic<uint32_t> after_it_is_gone;   // calls since then
  std::atomic<double> last;                 // N
};

static double now_s() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

static Arrived& make_arrived() {
  void* const memory = mmap(nullptr, sizeof(Arrived), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  ck_assert_ptr_ne(memory, MAP_FAILED);
  return *new (memory) Arrived{};
}

static void expect_quiet(const Arrived& arrived) {
  ck_assert_uint_gt(arrived.forces, 0);  // a force had arrived
  ck_assert(arrived.is_zero);
  ck_assert_uint_eq(arrived.late, 0);
  ck_assert_uint_eq(arrived.again, 0);
  ck_assert_double_eq(arrived.last, 0);
}

// A device that gets 2 N as soon as a servo ticks.
struct Pushed {
  Arrived& arrived;
  FakeDevice fake;
  Scene scene = make_scene();
  Device device;
  Servo servo;
  const pid_t process = getpid();

  Pushed(Arrived& the_arrived, const char* name) : arrived(the_arrived), fake(name) {
    fs_object o = fs_object_init("lift", FS_PRIMITIVE_PLANE);
    o.front = o.back = constant(FS_SENSE_REPULSIVE, 2);
    o.back.sense = FS_SENSE_ATTRACTIVE;
    require(fs_object_set(scene.get(), &o), "fs_object_set");
    fake.on_read = [this](FakeDevice&, double) { note_call(); };
    fake.on_write = [this](FakeDevice&) { note(); };
    fake.on_close = [this](FakeDevice&) {
      note_call();
      ++arrived.closed;
    };
    device = fake.open(false);
  }

  void start(fs_servo_mode mode, double max_stiffness = 0) {
    fs_servo_options options = fs_servo_options_init();
    options.mode = mode;
    options.max_stiffness = max_stiffness;
    options.ramp = options.fade = -1;
    options.priority = -1;
    servo = start_servo(scene.get(), device.get(), options);
  }
  void note_call() {
    if (getpid() != process) ++arrived.strange;
    if (arrived.is_gone) ++arrived.after_it_is_gone;
  }
  void note() {
    note_call();
    const double force = norm(fake.written.force);
    arrived.last = force;
    if (!arrived.has_begun) {
      arrived.forces += force > 0;
    } else if (force == 0) {
      arrived.is_zero = true;
    } else {
      ++(arrived.is_zero ? arrived.again : arrived.late);
    }
  }
  bool is_stopping() const {
    return fs_servo_step(servo.get(), 1) == FS_ERROR_STATE && std::strstr(fs_last_error(), "stopped");
  }
  // Waits for forces. If the machine is too slow for the servo, that is a fault, and the servo is enabled again.
  void wait_until(const std::function<bool()>& condition) const {
    while (!condition()) {
      require(fs_servo_set_enabled(servo.get(), true), "fs_servo_set_enabled");
      std::this_thread::yield();
    }
  }
};

// Where in a tick the stop begins.
enum class Amid { read, write };

// Delays a tick with a force in the driver until the stop has begun; the stop begins when `go` is set.
static void hold_up(Pushed& pushed, Amid amid, std::atomic<bool>& go) {
  const auto hold = [&pushed, &go] {
    if (pushed.arrived.forces < 3 || go.exchange(true)) return;
    while (!pushed.is_stopping()) std::this_thread::yield();
    pushed.arrived.has_begun = true;
  };
  if (amid == Amid::read) pushed.fake.on_read = [&pushed, hold](FakeDevice&, double) { pushed.note_call(); hold(); };
  if (amid == Amid::write) pushed.fake.on_write = [&pushed, hold](FakeDevice&) { pushed.note(); hold(); };
}

// Steps as the mode needs it, until the servo returns that it has been stopped.
static std::thread step_on(Pushed& pushed, fs_servo_mode mode, std::atomic<bool>& is_told) {
  if (mode == FS_SERVO_THREAD) {
    is_told = true;
    return {};
  }
  return std::thread([&pushed, &is_told, mode] {
    fs_status status;
    do {
      status = fs_servo_step(pushed.servo.get(), mode == FS_SERVO_VIRTUAL ? 1'000'000'000 : 1);
    } while (status == FS_OK);
    is_told = status == FS_ERROR_STATE && std::strstr(fs_last_error(), "stopped");
  });
}

static const struct {
  fs_servo_mode mode;
  Amid amid;
} ticks[]{{FS_SERVO_THREAD, Amid::read},  {FS_SERVO_THREAD, Amid::write}, {FS_SERVO_CALLER, Amid::read},
          {FS_SERVO_CALLER, Amid::write}, {FS_SERVO_VIRTUAL, Amid::read}, {FS_SERVO_VIRTUAL, Amid::write}};

START_TEST(stop_amid_a_tick) {
  Arrived& arrived = make_arrived();
  Pushed pushed(arrived, "amid");
  std::atomic<bool> go{false}, is_told{false};
  pushed.start(ticks[_i].mode);
  {
    const std::lock_guard lock(pushed.fake.mutex);
    hold_up(pushed, ticks[_i].amid, go);
  }
  std::thread stepper = step_on(pushed, ticks[_i].mode, is_told);
  pushed.wait_until([&] { return go.load(); });
  fs_servo_stop(pushed.servo.get());
  if (stepper.joinable()) stepper.join();
  ck_assert(pushed.servo.release() != nullptr);
  ck_assert(is_told);  // a step under way ends, and says why
  expect_quiet(arrived);
  ck_assert_uint_eq(arrived.closed, 0);
  pushed.start(FS_SERVO_VIRTUAL);  // both are free again
  OK(fs_servo_step(pushed.servo.get(), 1));
  ck_assert_double_eq(arrived.last, 2);
}
END_TEST

// The stop waits until the server's thread has disconnected its clients. When the 0 is written they are still
// connected.
START_TEST(stop_before_the_server_is_told) {
  Arrived& arrived = make_arrived();
  Pushed pushed(arrived, "server");
  pushed.start(FS_SERVO_CALLER);
  const std::string endpoint = "shm:test-stop-" + std::to_string(getpid());
  fs_server* server = nullptr;
  OK(fs_server_start(pushed.servo.get(), endpoint.c_str(), nullptr, &server));
  fs_scene* client = nullptr;
  OK(fs_scene_connect(endpoint.c_str(), "client", &client));
  OK(fs_servo_step(pushed.servo.get(), 3));
  size_t count = 0;
  OK(fs_scene_get_clients(client, nullptr, 0, &count));
  fs_status at_zero = FS_ERROR_INTERNAL;
  pushed.fake.on_write = [&](FakeDevice&) {
    pushed.note();
    if (arrived.is_zero) at_zero = fs_scene_get_clients(client, nullptr, 0, &count);
  };
  arrived.has_begun = true;
  pushed.servo.reset();
  EXPECT(FS_OK, at_zero);
  expect_quiet(arrived);
  EXPECT(FS_ERROR_DISCONNECTED, fs_scene_get_clients(client, nullptr, 0, &count));
  pushed.fake.on_write = nullptr;
  fs_server_stop(server);
  fs_scene_destroy(client);
}
END_TEST

START_TEST(two_threads_stop_at_once) {
  Arrived& arrived = make_arrived();
  Pushed pushed(arrived, "two");
  for (int k = 0; k < 50; ++k) {
    pushed.start(k % 2 ? FS_SERVO_THREAD : FS_SERVO_CALLER);
    fs_servo* const servo = pushed.servo.release();
    std::barrier both(2);
    const auto stop = [&] {
      both.arrive_and_wait();
      fs_servo_stop(servo);
      fs_state state;  // after the call the servo is stopped
      if (fs_device_read(pushed.device.get(), &state) != FS_OK) ++arrived.again;
    };
    std::thread other(stop);
    stop();
    other.join();
    ck_assert_double_eq(arrived.last, 0);
  }
  ck_assert_uint_eq(arrived.again, 0);
}
END_TEST

// If a device does not take the 0 at once, it is tried again.
START_TEST(a_zero_that_fails) {
  Arrived& arrived = make_arrived();
  Pushed pushed(arrived, "fails");
  pushed.start(FS_SERVO_CALLER);
  OK(fs_servo_step(pushed.servo.get(), 3));
  arrived.has_begun = true;
  int failures = 5;
  pushed.fake.on_write = [&](FakeDevice& fake) {
    fake.write_status = failures-- > 0 ? FS_ERROR_IO : FS_OK;
    if (fake.write_status == FS_OK) pushed.note();
  };
  pushed.servo.reset();
  expect_quiet(arrived);
}
END_TEST

// --------------------------------------------------------------------------------------------- the end of the process

// Runs f in a process of its own, which f ends; returns the status of that process.
static int in_process(const std::function<void()>& f) {
  std::fflush(nullptr);
  const pid_t child = fork();
  if (child == 0) {
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    f();
    _exit(99);
  }
  int status = 0;
  ck_assert_int_eq(waitpid(child, &status, 0), child);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
}

// A child of a process whose threads are asking: what they ask for is the parent's, and no lock of theirs holds it up.
START_TEST(a_child_asks) {
  Arrived& arrived = make_arrived();
  Pushed pushed(arrived, "child");
  pushed.start(FS_SERVO_VIRTUAL);
  OK(fs_servo_step(pushed.servo.get(), 2000));
  fs_scene* const scene = pushed.scene.get();
  std::atomic<bool> ends{false};
  std::thread asks([&] {
    size_t count;
    while (!ends) fs_scene_get_record(scene, 0, nullptr, 0, &count);
  });
  for (int i = 0; i < 20; ++i) {
    ck_assert_int_eq(7, in_process([&] {
      alarm(20);
      fs_servo_stats stats = fs_servo_stats_init();
      fs_device_info info = fs_device_info_init();
      size_t count;
      const bool is_right = fs_scene_get_record(scene, 0, nullptr, 0, &count) == FS_ERROR_STATE &&
                            fs_scene_get_servo_stats(scene, &stats) == FS_ERROR_STATE &&
                            fs_scene_get_device_info(scene, &info) == FS_ERROR_STATE &&
                            fs_scene_stop_force(scene) == FS_ERROR_STATE;
      _exit(is_right ? 7 : 8);
    }));
  }
  ends = true;
  asks.join();
}
END_TEST

START_TEST(exit_amid_a_tick) {
  for (const bool is_quick : {false, true}) {
    Arrived& arrived = make_arrived();
    ck_assert_int_eq(7, in_process([&] {
      Pushed& pushed = *new Pushed(arrived, "exit");
      static std::atomic<bool> go{false}, is_told{false};
      pushed.start(ticks[_i].mode);
      {
        const std::lock_guard lock(pushed.fake.mutex);
        hold_up(pushed, ticks[_i].amid, go);
      }
      std::thread stepper = step_on(pushed, ticks[_i].mode, is_told);
      if (stepper.joinable()) stepper.detach();
      pushed.wait_until([&] { return go.load(); });
      is_quick ? std::quick_exit(7) : std::exit(7);
    }));
    expect_quiet(arrived);
    ck_assert_uint_eq(arrived.closed, 1);  // close makes the driver send what it has not sent yet
  }
}
END_TEST

// An object that the driver needs. Its destructor takes long enough for a running servo to use the driver.
struct Needed {
  Arrived& arrived;
  ~Needed() {
    arrived.is_gone = true;
    for (int k = 0; k < 50 && arrived.after_it_is_gone == 0; ++k) usleep(1000);
  }
};

START_TEST(exit_before_statics_are_gone) {
  Arrived& arrived = make_arrived();
  ck_assert_int_eq(7, in_process([&] {
    Pushed& pushed = *new Pushed(arrived, "statics");
    static Needed needed{arrived};
    pushed.start(FS_SERVO_THREAD);
    pushed.wait_until([&] { return arrived.forces > 3; });
    std::thread([] { std::exit(7); }).join();
  }));
  ck_assert_uint_eq(arrived.after_it_is_gone, 0);
  ck_assert_double_eq(arrived.last, 0);
}
END_TEST

// A driver that hangs does not leave another device with a force: it is not waited for first.
START_TEST(exit_beside_one_that_hangs) {
  Arrived& well = make_arrived();
  Arrived& hung = make_arrived();
  ck_assert_int_eq(7, in_process([&] {
    static std::atomic<bool> hangs{false};
    static std::atomic<double> ends_at{0};  // s: when the process begins to end
    Pushed& first = *new Pushed(well, "well");
    first.start(FS_SERVO_THREAD);
    Pushed& second = *new Pushed(hung, "hangs");  // the newer one, which is closed first at the end
    second.fake.on_write = [&](FakeDevice&) {
      second.note();
      if (hung.forces < 3 || hangs.exchange(true)) return;
      while (hung.again < 5000 && !well.is_zero) {
        if (ends_at > 0) hung.again = static_cast<uint32_t>(1e3 * (now_s() - ends_at));  // ms
        usleep(1000);
      }
    };
    second.start(FS_SERVO_THREAD);
    first.wait_until([&] { return well.forces > 3; });
    second.wait_until([&] { return hangs.load(); });
    hung.again = 0;
    ends_at = now_s();
    well.has_begun = true;
    std::exit(7);
  }));
  ck_assert(well.is_zero);
  ck_assert_uint_eq(well.again, 0);
  ck_assert_uint_lt(hung.again, 950);  // if it had been waited for, about 1000
}
END_TEST

START_TEST(exit_with_all_that_runs) {  // a server, a client, and handles that are given back only then
  Arrived& arrived = make_arrived();
  ck_assert_int_eq(7, in_process([&] {
    static fs_server* server = nullptr;
    static Pushed* pushed = nullptr;
    std::atexit([] {  // runs after the library's own
      pushed->servo.reset();
      fs_server_stop(server);
      pushed->scene.reset();
      pushed->device.reset();
    });
    pushed = new Pushed(arrived, "all");
    pushed->start(FS_SERVO_THREAD);
    const std::string endpoint = "shm:test-exit-" + std::to_string(getpid());
    require(fs_server_start(pushed->servo.get(), endpoint.c_str(), nullptr, &server), "fs_server_start");
    fs_scene* client = nullptr;
    require(fs_scene_connect(endpoint.c_str(), "client", &client), "fs_scene_connect");
    pushed->wait_until([&] { return arrived.forces > 3; });
    std::exit(7);
  }));
  ck_assert_double_eq(arrived.last, 0);
  ck_assert_uint_eq(arrived.closed, 1);
}
END_TEST

START_TEST(exit_beside_builds) {  // of meshes, in a thread that nobody stops
  for (int round = 0; round < 20; ++round) {
    Arrived& arrived = make_arrived();
    ck_assert_int_eq(7, in_process([&] {
      Pushed& pushed = *new Pushed(arrived, "builds");
      pushed.start(FS_SERVO_THREAD);
      static std::atomic<int> built{0};
      std::thread([] {
        for (const MeshData data = sphere_mesh(0.02, 50);; ++built) {
          const Shape shape = make_mesh(data);
          fs_shape_build(shape.get());  // a status at the end
        }
      }).detach();
      pushed.wait_until([&] { return arrived.forces > 0 && built > 3 + round; });
      std::exit(7);
    }));
    ck_assert_double_eq(arrived.last, 0);
    ck_assert_uint_eq(arrived.closed, 1);
  }
}
END_TEST

START_TEST(exit_without_a_tick) {  // with a servo that was never stepped, and without a servo
  for (const bool has_servo : {true, false}) {
    Arrived& arrived = make_arrived();
    ck_assert_int_eq(7, in_process([&] {
      Pushed& pushed = *new Pushed(arrived, "idle");
      if (has_servo) {
        pushed.start(FS_SERVO_CALLER);
        require(fs_servo_step(pushed.servo.get(), 3), "fs_servo_step");
      } else {
        const fs_wrench wrench{{0, 0, 2}, {}};
        require(fs_device_write(pushed.device.get(), &wrench), "fs_device_write");
      }
      arrived.has_begun = true;
      std::exit(7);
    }));
    expect_quiet(arrived);
  }
}
END_TEST

START_TEST(exit_by_the_driver) {
  Arrived& arrived = make_arrived();
  ck_assert_int_eq(7, in_process([&] {
    Pushed& pushed = *new Pushed(arrived, "driver");
    pushed.fake.on_read = [&](FakeDevice& fake, double) {
      if (arrived.forces < 3) return;
      arrived.has_begun = true;
      fake.mutex.unlock();  // the fake device holds it, which no driver should do
      std::exit(7);
    };
    pushed.start(FS_SERVO_THREAD);
    pushed.wait_until([] { return false; });
  }));
  expect_quiet(arrived);
}
END_TEST

START_TEST(a_forked_child_leaves_it_alone) {
  Arrived& arrived = make_arrived();
  Pushed pushed(arrived, "fork");
  pushed.start(FS_SERVO_THREAD);
  Pushed other(make_arrived(), "forkother");
  const fs_wrench wrench{{0, 0, 2}, {}};
  OK(fs_device_write(other.device.get(), &wrench));
  const std::string endpoint = "shm:test-fork-" + std::to_string(getpid());
  fs_server* server = nullptr;
  OK(fs_server_start(pushed.servo.get(), endpoint.c_str(), nullptr, &server));
  pushed.wait_until([&] { return arrived.forces > 3; });
  ck_assert_int_eq(7, in_process([&] {
    fs_state state;
    const auto is_refused = [](fs_status status) {
      return status == FS_ERROR_STATE && std::strstr(fs_last_error(), "was started by the parent of this process");
    };
    if (!is_refused(fs_servo_step(pushed.servo.get(), 1))) _exit(1);
    if (!is_refused(fs_servo_set_enabled(pushed.servo.get(), false))) _exit(8);
    if (!is_refused(fs_scene_get_hand(pushed.scene.get(), &state, nullptr, nullptr))) _exit(9);
    fs_servo_stats stats = fs_servo_stats_init();
    if (!is_refused(fs_scene_get_servo_stats(pushed.scene.get(), &stats))) _exit(10);
    fs_device_info info = fs_device_info_init();
    if (!is_refused(fs_scene_get_device_info(pushed.scene.get(), &info))) _exit(11);
    size_t count = 0;
    if (!is_refused(fs_servo_get_record(pushed.servo.get(), nullptr, 0, &count))) _exit(12);
    if (fs_device_read(other.device.get(), &state) != FS_ERROR_STATE) _exit(2);
    if (fs_device_write(other.device.get(), &wrench) != FS_ERROR_STATE) _exit(3);
    fs_servo* second = nullptr;
    if (fs_servo_start(other.scene.get(), other.device.get(), nullptr, &second) != FS_ERROR_STATE) _exit(4);
    fs_server* another = nullptr;
    if (fs_server_start(pushed.servo.get(), "shm:of-a-child", nullptr, &another) != FS_ERROR_STATE) _exit(5);
    fs_server_stop(server);
    fs_servo_stop(pushed.servo.get());
    fs_device_close(other.device.get());
    std::exit(7);
  }));
  ck_assert_uint_eq(arrived.strange, 0);
  ck_assert_uint_eq(other.arrived.strange, 0);
  ck_assert_double_eq(other.arrived.last, 2);
  const uint32_t before = arrived.forces;
  pushed.wait_until([&] { return arrived.forces > before + 3; });  // the parent's servo goes on
  fs_server_stop(server);
}
END_TEST

// ------------------------------------------------------------------------------------------------------------- memory

static long status_kb(const char* field) {  // of /proc/self/status
  std::FILE* const file = std::fopen("/proc/self/status", "r");
  ck_assert_ptr_nonnull(file);
  char line[256];
  long out = -1;
  while (std::fgets(line, sizeof line, file)) {
    if (std::strncmp(line, field, std::strlen(field)) == 0) out = std::atol(line + std::strlen(field));
  }
  std::fclose(file);
  return out;
}

// Whatever fails at the start, scene and device are as they were.
START_TEST(a_start_that_fails) {
  if (is_sanitized) return;  // they need the whole address space
  Arrived& arrived = make_arrived();
  Pushed pushed(arrived, "nomemory");
  const rlimit all{RLIM_INFINITY, RLIM_INFINITY};
  const fs_servo_options options = fs_servo_options_init();
  int failures = 0;
  for (long more = 0; more < 4096; more += 32) {  // kB
    rlimit limit = all;
    limit.rlim_cur = static_cast<rlim_t>(status_kb("VmSize:") + more) * 1024;
    fs_servo* servo = nullptr;
    setrlimit(RLIMIT_AS, &limit);
    const fs_status status = fs_servo_start(pushed.scene.get(), pushed.device.get(), &options, &servo);
    setrlimit(RLIMIT_AS, &all);
    if (status != FS_OK) {
      ck_assert(status == FS_ERROR_MEMORY || status == FS_ERROR_IO);
      ck_assert_ptr_null(servo);
      ++failures;
      fs_state state;
      OK(fs_device_read(pushed.device.get(), &state));
    }
    fs_servo_stop(servo);
    ck_assert_double_eq(arrived.last, 0);
  }
  ck_assert_int_gt(failures, 0);
}
END_TEST

START_TEST(a_thread_that_is_refused) {
  Arrived& arrived = make_arrived();
  ck_assert_int_eq(7, in_process([&] {
    Pushed& pushed = *new Pushed(arrived, "nothread");
    const rlimit none{0, 0};
    if (geteuid() == 0 && setuid(65534) != 0) _exit(1);  // root may lock as much as it likes
    setrlimit(RLIMIT_NPROC, &none);
    fs_servo* servo = nullptr;
    if (fs_servo_start(pushed.scene.get(), pushed.device.get(), nullptr, &servo) != FS_ERROR_IO || servo) _exit(2);
    pushed.start(FS_SERVO_CALLER, -1);  // sharing the stiffness out would take a thread
    if (fs_servo_step(pushed.servo.get(), 3) != FS_OK) _exit(3);
    arrived.has_begun = true;
    pushed.servo.reset();
    _exit(7);
  }));
  expect_quiet(arrived);
}
END_TEST

// The memory that is locked for a servo is bounded, whatever else the process has, and is unlocked afterwards.
START_TEST(locked_memory) {
  if (is_sanitized) return;  // they replace mlock by nothing
  Arrived& arrived = make_arrived();
  Pushed first(arrived, "locked"), second(arrived, "lockedtoo");
  const size_t much = 500 << 20;
  void* const others = mmap(nullptr, much, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
  ck_assert_ptr_ne(others, MAP_FAILED);
  // A page of the library's code that the application has locked itself.
  const long page = sysconf(_SC_PAGESIZE);
  const uintptr_t own = reinterpret_cast<uintptr_t>(&fs_version) / page * page;
  const bool has_own = mlock(reinterpret_cast<void*>(own), page) == 0;
  const auto start = [](Pushed& pushed) {
    fs_servo_options options = fs_servo_options_init();
    options.rate = 1000;
    pushed.servo = start_servo(pushed.scene.get(), pushed.device.get(), options);
    return stats_of(pushed.scene.get()).realtime == FS_REALTIME_FIFO_LOCKED;
  };
  const long before = status_kb("VmLck:");
  if (!start(first)) {
    std::printf("  locked memory: not allowed here, not tested\n");
    return;
  }
  const long one = status_kb("VmLck:") - before;
  ck_assert_int_gt(one, 1000);  // kB: the flight record alone
  ck_assert_int_lt(one, 24000);
  ck_assert(start(second));
  const long two = status_kb("VmLck:") - before;
  ck_assert_int_gt(two, one);
  ck_assert_int_lt(two, 2 * one);  // the library's code is locked once
  first.servo.reset();
  ck_assert_int_eq(status_kb("VmLck:") - before, one);
  second.servo.reset();
  ck_assert_int_eq(status_kb("VmLck:"), before);
  ck_assert(!has_own || before > 0);
  std::printf("  locked memory: %ld kB for a servo, %ld kB for two\n", one, two);
  munmap(others, much);
}
END_TEST

int main() {
  Suite* suite = suite_create("stop");
  // It comes first: without forks each earlier servo would have registered for the end of this process, and their
  // number is limited.
  add_case(suite, "statics", {exit_before_statics_are_gone});
  TCase* loops = tcase_create("amid a tick");
  tcase_set_timeout(loops, 500);
  tcase_add_loop_test(loops, stop_amid_a_tick, 0, std::size(ticks));
  tcase_add_loop_test(loops, exit_amid_a_tick, 0, std::size(ticks));
  suite_add_tcase(suite, loops);
  add_case(suite, "stop", {stop_before_the_server_is_told, two_threads_stop_at_once, a_zero_that_fails, a_child_asks});
  add_case(suite, "exit", {exit_beside_one_that_hangs, exit_with_all_that_runs, exit_beside_builds, exit_without_a_tick, exit_by_the_driver,
                           a_forked_child_leaves_it_alone});
  add_case(suite, "memory", {a_start_that_fails, a_thread_that_is_refused, locked_memory});
  return run_suite(suite);
}
