// What comes and goes under a servo, by whatever cause: the largest step of the force, in newtons per millisecond, which is
// printed as a table. With F the force in full, a tick changes a weight by period / fade at most; where one thing goes and
// another comes, both change. What the hand's own way explains is added. test_no_step looks at all orders of calls.
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>

#include "api/world.h"

using namespace scenes;

namespace {

constexpr double period = 1e-3, fade = 0.2, ramp = 0.1;  // s
constexpr double stiffness = 200;                        // N/m
constexpr double force = 4;                              // N, of a spring whose end is 20 mm away
constexpr fs_twist still{};

fs_servo_options fading() {
  fs_servo_options options = virtual_options();
  options.fade = fade;
  options.ramp = ramp;
  options.speed_limit = -1;
  options.blend = 0.02;
  return options;
}

fs_object pulling(fs_vec3 position = {0.02, 0, 0}) { return spring("a", position, stiffness); }
Shape line_at(double y) {
  const fs_vec3 ends[2]{{-1, y, 0}, {1, y, 0}};
  return make_polyline(ends, 2, false);
}

struct Cause {
  const char* name;
  double parts;  // of F that may change: 1: one thing comes or goes; 2: another comes too
  double time;   // s, in which it does
  void (*prepare)(ServerRig&, fs_scene*);  // null: the spring is set and felt
  void (*act)(ServerRig&, fs_scene*);
};

void set_spring(ServerRig&, fs_scene* scene) {
  const fs_object o = pulling();
  OK(fs_object_set(scene, &o));
}
void set_enabled(fs_scene* scene, bool enabled) {
  fs_object o = pulling();
  o.enabled = enabled;
  OK(fs_object_set(scene, &o));
}

const Cause causes[]{
  {"an object is set", 1, fade, [](ServerRig&, fs_scene*) {}, set_spring},
  {"its shape is replaced", 2, fade, nullptr,
   [](ServerRig&, fs_scene* scene) {
     const Shape line = line_at(0.02);
     fs_object o = pulling({});
     o.primitive = FS_PRIMITIVE_POLYLINE;
     o.shape = line.get();
     OK(fs_object_set(scene, &o));
   }},
  {"it jumps", 2, fade, nullptr,
   [](ServerRig&, fs_scene* scene) {
     const fs_pose pose = at(-0.0205, 0, 0);  // more than 40 mm
     OK(fs_object_move(scene, "a", &pose, &still, FS_NOW));
   }},
  {"it is removed", 1, fade, nullptr, [](ServerRig&, fs_scene* scene) { OK(fs_object_remove(scene, "a")); }},
  {"all are cleared", 1, fade, nullptr, [](ServerRig&, fs_scene* scene) { OK(fs_scene_clear(scene)); }},
  {"it expires", 1, fade, nullptr,
   [](ServerRig&, fs_scene* scene) {
     fs_object o = pulling();
     o.lifetime = 0.05;
     OK(fs_object_set(scene, &o));
   }},
  {"it is disabled", 1, fade, nullptr, [](ServerRig&, fs_scene* scene) { set_enabled(scene, false); }},
  {"it is enabled", 1, fade, [](ServerRig&, fs_scene* scene) { set_enabled(scene, false); },
   [](ServerRig&, fs_scene* scene) { set_enabled(scene, true); }},
  {"another frame", 2, fade, nullptr,
   [](ServerRig&, fs_scene* scene) {
     fs_frame frame = fs_frame_init();
     frame.pose.position = {0.02, 0.02, 0};
     OK(fs_scene_set_frame(scene, &frame));
   }},
  {"another tool", 2, fade, nullptr,
   [](ServerRig&, fs_scene* scene) {
     const fs_vec3 point{0.02, 0.02, 0};
     OK(fs_scene_set_tool(scene, &point, 1));
   }},
  {"the clutch is held", 1, fade, nullptr, [](ServerRig&, fs_scene* scene) { OK(fs_scene_set_clutch(scene, true)); }},
  {"the clutch is released", 1, fade,
   [](ServerRig& rig, fs_scene* scene) {
     set_spring(rig, scene);
     OK(fs_scene_set_clutch(scene, true));
   },
   [](ServerRig&, fs_scene* scene) { OK(fs_scene_set_clutch(scene, false)); }},
  {"the device is back", 1, ramp,
   [](ServerRig& rig, fs_scene* scene) {
     set_spring(rig, scene);
     rig.step(2);
     rig.fake.state.flags &= ~static_cast<uint32_t>(FS_STATE_READY);
   },
   [](ServerRig& rig, fs_scene*) { rig.fake.state.flags |= FS_STATE_READY; }},
  {"the servo is enabled", 1, ramp,
   [](ServerRig& rig, fs_scene* scene) {
     set_spring(rig, scene);
     OK(fs_servo_set_enabled(rig.servo.get(), false));
   },
   [](ServerRig& rig, fs_scene*) { OK(fs_servo_set_enabled(rig.servo.get(), true)); }},
};

struct Largest {
  double still = 0, moving = 0;  // N, of a step; moving: beyond what the way of the hand explains
  double change = 0;             // N, of the force from before to after
};

// Ticks for twice as long as anything takes; the hand rests, or moves at 0.1 m/s.
void watch(ServoRig& rig, bool moves, double& largest, double& change) {
  fs_vec3 last = rig.fake.written.force, from = rig.fake.state.pose.position;
  const fs_vec3 begin = last;
  largest = 0;
  for (int k = 0; k < 500; ++k) {
    if (moves) rig.fake.state.pose.position = {0, 0, 0.005 * std::sin(0.02 * k)};
    rig.step();
    if (k % 50 == 0) wait_a_little(2e-4);  // for the server's thread
    const fs_vec3 x = rig.fake.state.pose.position, f = rig.fake.written.force;
    // While one fades out and another in, the weights add up to 1; the scale of the frame is 1.
    largest = std::fmax(largest, norm(f - last) - stiffness * norm(x - from) * (1 + 1e-9));
    last = f;
    from = x;
  }
  change = norm(last - begin);
}

void print(const char* name, double parts, double time, const Largest& got) {
  const double bound = parts * force * period / time;
  std::printf("  %-28s %8.3f  %8.4f %12.4f %12.4f\n", name, got.change, got.still / (1000 * period),
              got.moving / (1000 * period), bound / (1000 * period));
}

void expect(const char* name, double parts, double time, const Largest& got) {
  const double bound = parts * force * period / time * 1.05 + 1e-9;  // the hand's way makes its force up to 5 % larger
  ck_assert_msg(got.change > 1, "%s: the force changes by %g N only", name, got.change);
  ck_assert_msg(got.still <= bound, "%s: a step of %g N for a hand at rest, %g are allowed", name, got.still, bound);
  ck_assert_msg(got.moving <= bound, "%s: a step of %g N for a moving hand, %g are allowed", name, got.moving, bound);
}

}  // namespace

START_TEST(every_cause) {
  std::printf("  a spring of %g N; a fade takes %g s, the ramp %g s\n", force, fade, ramp);
  std::printf("  %-28s %8s  %8s %12s %12s\n", "N/ms", "change N", "at rest", "moving hand", "allowed");
  for (const Cause& cause : causes) {
    Largest got;
    for (const bool moves : {false, true}) {
      ServerRig rig(fs_server_options_init(), fading());
      rig.step(200);  // the ramp at the start
      if (cause.prepare) {
        cause.prepare(rig, rig.base.get());
      } else {
        set_spring(rig, rig.base.get());
      }
      rig.step(500);
      cause.act(rig, rig.base.get());
      watch(rig, moves, moves ? got.moving : got.still, got.change);
    }
    print(cause.name, cause.parts, cause.time, got);
    expect(cause.name, cause.parts, cause.time, got);
  }
  // A client that is killed, and one that leaves.
  for (const bool is_killed : {false, true}) {
    Largest got;
    const char* const name = is_killed ? "a client is killed" : "a client leaves";
    for (const bool moves : {false, true}) {
      fs_server_options server_options = fs_server_options_init();
      server_options.lease = 0.05;
      ServerRig rig(server_options, fading());
      rig.step(200);
      Scene client;
      pid_t child = -1;
      if (is_killed) {
        child = fork();
        if (child == 0) {
          fs_scene* scene = nullptr;
          const fs_object o = pulling();
          if (fs_scene_connect((rig.endpoint + "?timeout=20").c_str(), "child", &scene)) _exit(1);
          if (fs_object_set(scene, &o)) _exit(2);
          for (;;) pause();
        }
        ck_assert(eventually([&] {
          rig.step(5);
          return has(rig.base.get(), "child/a") || norm(rig.fake.written.force) > 0;
        }));
      } else {
        client = rig.join("client");
        const fs_object o = pulling();
        OK(fs_object_set(client.get(), &o));
      }
      ck_assert(eventually([&] {
        rig.step(5);
        return norm(rig.fake.written.force) > 0.999 * force;
      }));
      if (is_killed) {
        kill(child, SIGKILL);
        waitpid(child, nullptr, 0);
      } else {
        client.reset();
      }
      // In virtual time nothing else waits for the server's thread, which has to see it.
      double& largest = moves ? got.moving : got.still;
      const fs_vec3 begin = rig.fake.written.force;
      ck_assert(eventually([&] {
        double step, change;
        watch(rig, moves, step, change);
        largest = std::fmax(largest, step);
        return norm(rig.fake.written.force) == 0;
      }));
      got.change = norm(begin);
    }
    print(name, 1, fade, got);
    expect(name, 1, fade, got);
  }
}
END_TEST

int main() {
  Suite* suite = suite_create("fade_causes");
  add_case(suite, "causes", {every_cause});
  return run_suite(suite);
}
