// forceserver resume: lets the force of a server return that a client has ended.
#include <cstdio>

#include "look.h"
#include "words.h"

namespace {

int resume_force(const std::string& server) {
  const Scene scene = connect(server, "resume");
  fs_servo_stats before = fs_servo_stats_init();
  require(fs_scene_get_servo_stats(scene.get(), &before));
  require(fs_scene_resume_force(scene.get()));
  const bool was_stopped = !before.enabled || before.faults;
  std::printf(was_stopped ? "the force at %s returns\n" : "the force at %s was not stopped\n", full_endpoint(server).c_str());
  write_out();
  return exit_fine;
}

}  // namespace

int resume(const std::string& server) {
  return at_server(server, [&] { return resume_force(server); });
}
