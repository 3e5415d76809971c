#include "device/udp/controller_process.h"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>

extern char** environ;

namespace scenes {

ControllerProcess::ControllerProcess(const std::string& device, uint16_t port) {
  int ends[2];
  if (pipe2(ends, O_CLOEXEC) != 0) std::abort();
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, ends[1], STDOUT_FILENO);
  const std::string place = "127.0.0.1:" + std::to_string(port);
  std::string words[]{"fidel-controller", "--listen", place, "--device", device};
  char* arguments[]{words[0].data(), words[1].data(), words[2].data(), words[3].data(), words[4].data(), nullptr};
  const int error = posix_spawn(&process_, FIDEL_CONTROLLER, &actions, nullptr, arguments, environ);
  posix_spawn_file_actions_destroy(&actions);
  close(ends[1]);
  output_ = ends[0];
  std::string line;
  for (char c; !error && read(output_, &c, 1) == 1 && c != '\n';) line += c;
  unsigned found = 0;
  if (std::sscanf(line.c_str(), "listening at 127.0.0.1:%u", &found) != 1) {
    std::fprintf(stderr, FIDEL_CONTROLLER " does not listen: '%s'\n", line.c_str());
    std::abort();
  }
  port_ = static_cast<uint16_t>(found);
  reader_ = std::thread([this] {
    char text[1000];
    for (ssize_t size; (size = read(output_, text, sizeof text)) > 0;) {
      const std::lock_guard lock(mutex_);
      said_.append(text, static_cast<size_t>(size));
    }
  });
}

void ControllerProcess::signal(int number) const { kill(process_, number); }

int ControllerProcess::end(int signal) {
  if (!process_) return 0;
  kill(process_, signal);
  int status = 0;
  waitpid(process_, &status, 0);
  process_ = 0;
  reader_.join();
  close(output_);
  return status;
}

std::string ControllerProcess::said() const {
  const std::lock_guard lock(mutex_);
  return said_;
}

}  // namespace scenes
