// forceserver stop, resume: ends the force of a server, and lets it return.
#include <cstdio>

#include "look.h"
#include "words.h"

namespace {

int resume_force(const std::string& server) {
  const Scene scene = connect(server, "resume");
  const fs_servo_stats before = scene.get_servo_stats();
  scene.resume_force();
  const bool was_stopped = !before.enabled || before.faults;
  std::printf(was_stopped ? "the force at %s returns\n" : "the force at %s was not stopped\n", full_endpoint(server).c_str());
  write_out();
  return exit_fine;
}

int stop_force(const std::string& server) {
  const Scene scene = connect(server, "stop");
  scene.stop_force();
  std::printf("the force at %s has ended; %s\n", full_endpoint(server).c_str(), how_to_resume(server).c_str());
  write_out();
  return exit_fine;
}

}  // namespace

int stop(const std::string& server) {
  return at_server(server, [&] { return stop_force(server); });
}

int resume(const std::string& server) {
  return at_server(server, [&] { return resume_force(server); });
}
