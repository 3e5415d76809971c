// A servo and its server in this process.
#pragma once

#include <string>

#include <forceserver/forceserver.hpp>

namespace bench {

// Ends the program with the library's error sentence if the call fails.
void check(fs_status status, const char* what);

using forceserver::Scene;
Scene make_scene();
Scene connect(const std::string& endpoint, const std::string& client);

inline constexpr int real_time = 0, ordinary = -1;  // fs_servo_options.priority

// Nothing fades and nothing ramps: what a client does is felt at once.
struct Rig {
  const std::string endpoint;
  const Scene scene;
  const forceserver::Device device;
  forceserver::Servo servo;
  forceserver::Server server;

  explicit Rig(int priority, double rate = 0);
  fs_servo_stats stats() const;
};

// A point i of n on a circle of 10 mm about the hand, which it draws with 1 N, or one of a crowd out of its reach.
fs_object drawing_point(const char* name);
fs_pose on_circle(int i, int n);
fs_object far_point(const char* name, int i);

}  // namespace bench
