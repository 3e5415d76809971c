#include "client.h"

#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <stdexcept>

Client::Client(const std::string& endpoint, const std::string& name) : name_(name) {
  std::setvbuf(stdout, nullptr, _IOLBF, 0);  // several processes write to one place, a line at a time
  check(fs_scene_connect(endpoint.c_str(), name.c_str(), &scene_));
  sigemptyset(&signals_);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) sigaddset(&signals_, signal);
  pthread_sigmask(SIG_BLOCK, &signals_, nullptr);
  set_view(scene_);
  next_ = std::chrono::steady_clock::now();
}

bool Client::wait(double period) {
  const auto now = std::chrono::steady_clock::now();
  next_ = std::max(next_ + std::chrono::microseconds(std::llround(period * 1e6)), now);
  const auto left = std::chrono::duration_cast<std::chrono::nanoseconds>(next_ - now).count();
  const timespec time = {time_t(left / 1000000000), long(left % 1000000000)};
  return sigtimedwait(&signals_, nullptr, &time) < 0;
}

void Client::say(const char* form, ...) const {
  char text[400];
  va_list arguments;
  va_start(arguments, form);
  std::vsnprintf(text, sizeof text, form, arguments);
  va_end(arguments);
  std::printf("%-10s %s\n", name_.c_str(), text);
}

namespace {

bool is_told_to_end() {
  sigset_t pending;
  sigpending(&pending);
  return sigismember(&pending, SIGINT) || sigismember(&pending, SIGTERM) || sigismember(&pending, SIGHUP);
}

}  // namespace

int run_client(int argc, char** argv, const char* name, const char* usage, std::size_t needs,
               const std::function<void(Client&, const Arguments&)>& body) {
  const Arguments arguments(argv + std::min(argc, 2), argv + argc);
  if (argc < 2 || arguments.size() < needs) {
    std::fprintf(stderr, "usage: %s ENDPOINT%s    (such as shm:lab)\n", name, usage);
    return 2;
  }
  try {
    Client client(argv[1], name);
    body(client, arguments);
    return 0;
  } catch (const std::exception& error) {
    if (is_told_to_end()) return 0;  // Ctrl-C ends the server, too
    std::fprintf(stderr, "%s: %s\n", name, error.what());
    return 1;
  }
}
