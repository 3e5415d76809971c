// How long a device still has a force after its servo was told to stop, in each way in which a servo can end. Prints a
// table; README.md has one. bench_stop [ROUNDS]
//
// Each round runs in a process of its own, as some of them end with it; what arrives at the device is noted in memory
// that is shared.
#include <sched.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#include <forceserver/driver.h>
#include <forceserver/forceserver.h>

namespace {

int64_t now_ns() {
  timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return now.tv_sec * int64_t{1'000'000'000} + now.tv_nsec;
}

// What arrives at the device. Times in ns; 0: not yet.
struct Arrived {
  std::atomic<int64_t> told, zero;  // when the servo was told to stop; the first 0 after it
  std::atomic<int> forces, late;    // forces before that, and after it
  std::atomic<int> refusals;        // how many more times the device does not take a 0
};
Arrived* arrived = nullptr;

void check(fs_status status, const char* what) {
  if (status == FS_OK) return;
  std::fprintf(stderr, "bench_stop: %s: %s\n", what, fs_last_error());
  std::_Exit(1);
}

void register_driver() {
  fs_driver driver{};
  driver.struct_size = sizeof driver;
  driver.scheme = "stopped";
  driver.open = [](const char*, void** self) {
    *self = arrived;
    return FS_OK;
  };
  driver.close = [](void*) {};
  driver.get_info = [](void*, fs_device_info* out) {
    std::strcpy(out->name, "stopped");
    out->force_axes = 3;
    out->force_max = 10;
    out->rate = 1000;
    return FS_OK;
  };
  driver.read = [](void*, fs_state* out) {
    out->flags = FS_STATE_READY;
    return FS_OK;
  };
  driver.write = [](void*, const fs_wrench* wrench) {
    const bool is_zero = wrench->force.x == 0, is_told = arrived->told != 0;
    if (is_zero && is_told && arrived->refusals > 0) {
      --arrived->refusals;
      return FS_ERROR_IO;
    }
    if (is_zero && is_told && !arrived->zero) arrived->zero = now_ns();
    if (!is_zero) {
      ++(is_told ? arrived->late : arrived->forces);
      if (is_told) arrived->zero = 0;
    }
    return FS_OK;
  };
  check(fs_driver_register(&driver), "fs_driver_register");
}

fs_object point(const char* name) {
  fs_object o = fs_object_init(name, FS_PRIMITIVE_POINT);
  o.pose.position.x = 1;
  o.front = fs_profile_init(FS_PROFILE_CONSTANT, FS_SENSE_ATTRACTIVE, 5, 0, 5);
  return o;
}

// A servo with a force of 5 N; its server, when asked for.
struct Rig {
  fs_scene *scene = nullptr, *client = nullptr;
  fs_device* device = nullptr;
  fs_servo* servo = nullptr;
  fs_server* server = nullptr;

  explicit Rig(fs_servo_mode mode = FS_SERVO_THREAD) {
    register_driver();
    check(fs_scene_create(&scene), "fs_scene_create");
    check(fs_device_open("stopped:", &device), "fs_device_open");
    const fs_object o = point("push");
    check(fs_object_set(scene, &o), "fs_object_set");
    fs_servo_options options = fs_servo_options_init();
    options.mode = mode;
    options.ramp = options.fade = -1;
    check(fs_servo_start(scene, device, &options, &servo), "fs_servo_start");
  }
  void serve() {
    const std::string endpoint = "shm:bench-stop-" + std::to_string(getpid());
    check(fs_server_start(servo, endpoint.c_str(), nullptr, &server), "fs_server_start");
    check(fs_scene_connect(endpoint.c_str(), "client", &client), "fs_scene_connect");
  }
  // The server's thread has a large group to take.
  void keep_server_busy() const {
    std::vector<double> table(62501);
    for (size_t i = 0; i < table.size(); ++i) table[i] = 1 + 1e-3 * static_cast<double>(i % 7);
    fs_curve* curve = nullptr;
    check(fs_curve_create_table(table.data(), table.size(), 1e-5, &curve), "fs_curve_create_table");
    check(fs_scene_begin(client), "fs_scene_begin");
    for (int i = 0; i < 4000; ++i) {
      fs_object o = point(("object " + std::to_string(i)).c_str());
      o.pose.position.x = 100;
      if (i < 40) {
        o.front = fs_profile_init(FS_PROFILE_CUSTOM, FS_SENSE_ATTRACTIVE, 1 + i * 1e-3, 0, 0.1);
        o.front.curve = curve;
      }
      check(fs_object_set(client, &o), "fs_object_set");
    }
    check(fs_scene_commit(client), "fs_scene_commit");
    usleep(50'000);
  }
  void wait_for_force() const {
    while (arrived->forces < 20) {
      fs_servo_set_enabled(servo, true);  // a machine that is too slow is a fault
      usleep(1000);
    }
  }
  static void tell() { arrived->told = now_ns(); }
};

struct Way {
  const char* name;
  std::function<void()> run;
};

void stop(Rig& rig) {
  rig.wait_for_force();
  Rig::tell();
  fs_servo_stop(rig.servo);
}

void stop_amid_a_step(fs_servo_mode mode) {
  Rig rig(mode);
  std::thread stepper([&rig, mode] {
    while (fs_servo_step(rig.servo, mode == FS_SERVO_VIRTUAL ? 1'000'000'000 : 1) == FS_OK) {
      if (mode == FS_SERVO_CALLER) usleep(1000);
    }
  });
  stepper.detach();
  stop(rig);
}

const Way ways[]{
    {"fs_servo_stop", [] {
       Rig rig;
       stop(rig);
     }},
    {"the same, both processors busy", [] {
       Rig rig;
       for (int i = 0; i < 2; ++i) std::thread([] { for (std::atomic<int> k{0};; ++k) {} }).detach();
       stop(rig);
     }},
    {"the same, with a server and a client", [] {
       Rig rig;
       rig.serve();
       stop(rig);
     }},
    {"the same, the server's thread busy", [] {
       Rig rig;
       rig.serve();
       rig.wait_for_force();
       rig.keep_server_busy();
       stop(rig);
     }},
    {"the same, two threads at once", [] {
       Rig rig;
       rig.wait_for_force();
       Rig::tell();
       std::thread other([&] { fs_servo_stop(rig.servo); });
       fs_servo_stop(rig.servo);
       other.join();
     }},
    {"the same, amid a step of 10^9 virtual ticks", [] { stop_amid_a_step(FS_SERVO_VIRTUAL); }},
    {"the same, the caller's loop in another thread", [] { stop_amid_a_step(FS_SERVO_CALLER); }},
    {"the same, the device refuses the 0 three times", [] {
       arrived->refusals = 3;
       Rig rig;
       stop(rig);
     }},
    {"fs_servo_set_enabled(servo, false)", [] {
       Rig rig;
       rig.wait_for_force();
       Rig::tell();
       fs_servo_set_enabled(rig.servo, false);
       while (!arrived->zero) usleep(100);
     }},
    {"exit", [] {
       Rig rig;
       rig.wait_for_force();
       Rig::tell();
       std::exit(0);
     }},
    {"exit by another thread, with a server and a client", [] {
       Rig& rig = *new Rig;
       rig.serve();
       rig.wait_for_force();
       std::thread([] {
         Rig::tell();
         std::exit(0);
       }).join();
     }},
    {"quick_exit", [] {
       Rig rig;
       rig.wait_for_force();
       Rig::tell();
       std::quick_exit(0);
     }},
    {"exit, of a caller's loop that does not step any more", [] {
       Rig rig(FS_SERVO_CALLER);
       check(fs_servo_step(rig.servo, 30), "fs_servo_step");
       Rig::tell();
       std::exit(0);
     }},
};

}  // namespace

int main(int argc, char** argv) {
  const int rounds = argc > 1 ? std::atoi(argv[1]) : 40;
  void* const memory = mmap(nullptr, sizeof(Arrived), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (rounds < 1 || memory == MAP_FAILED) return 1;
  std::printf("from being told to stop to force 0, %d rounds\n%-54s %9s %9s  %s\n", rounds, "", "p50", "max",
              "forces after it, at most");
  for (const Way& way : ways) {
    std::vector<double> times;
    int most_late = 0, without = 0;
    for (int i = 0; i < rounds; ++i) {
      arrived = new (memory) Arrived{};
      std::fflush(nullptr);
      const pid_t child = fork();
      if (child == 0) {
        prctl(PR_SET_PDEATHSIG, SIGKILL);
        alarm(60);
        way.run();
        std::_Exit(0);
      }
      int status = 0;
      if (child < 0 || waitpid(child, &status, 0) != child) return 1;
      if (!arrived->zero) ++without;
      times.push_back(1e-3 * static_cast<double>(arrived->zero ? arrived->zero - arrived->told : 0));
      most_late = std::max(most_late, arrived->late.load());
    }
    std::sort(times.begin(), times.end());
    std::printf("%-54s %6.0f us %6.0f us  %d", way.name, times[times.size() / 2], times.back(), most_late);
    if (without) std::printf("; no 0 at all: %d rounds", without);
    std::printf("\n");
  }
}
