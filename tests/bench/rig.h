// A servo and its server in this process.
#pragma once

#include <memory>
#include <string>

#include <forceserver/forceserver.h>

namespace bench {

// Ends the program with the library's error sentence if the call fails.
void check(fs_status status, const char* what);

struct Release {
  void operator()(fs_scene* p) const { fs_scene_destroy(p); }
  void operator()(fs_device* p) const { fs_device_close(p); }
  void operator()(fs_servo* p) const { fs_servo_stop(p); }
  void operator()(fs_server* p) const { fs_server_stop(p); }
};
using Scene = std::unique_ptr<fs_scene, Release>;
Scene make_scene();
Scene connect(const std::string& endpoint, const std::string& client);

inline constexpr int real_time = 0, ordinary = -1;  // fs_servo_options.priority

// Nothing fades and nothing ramps: what a client does is felt at once.
struct Rig {
  const std::string endpoint;
  const Scene scene;
  const std::unique_ptr<fs_device, Release> device;
  std::unique_ptr<fs_servo, Release> servo;
  std::unique_ptr<fs_server, Release> server;

  explicit Rig(int priority, double rate = 0);
  fs_servo_stats stats() const;
};

// A point i of n on a circle of 10 mm about the hand, which it draws with 1 N, or one of a crowd out of its reach.
fs_object drawing_point(const char* name);
fs_pose on_circle(int i, int n);
fs_object far_point(const char* name, int i);

}  // namespace bench
