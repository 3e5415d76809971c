#include "client.h"

#include <cstdarg>
#include <cstdio>
#include <stdexcept>

Client::Client(const std::string& endpoint, const std::string& name, Beat& beat) : name_(name), beat_(beat) {
  std::setvbuf(stdout, nullptr, _IOLBF, 0);  // whole lines, because several processes write to one terminal
  const bool is_name = endpoint.find(':') == endpoint.npos;
  check(fs_scene_connect((is_name ? "shm:" + endpoint : endpoint).c_str(), name.c_str(), &scene_));
  set_view(scene_);
}

void Client::say(const char* form, ...) const {
  char text[400];
  va_list arguments;
  va_start(arguments, form);
  std::vsnprintf(text, sizeof text, form, arguments);
  va_end(arguments);
  std::printf("%-10s %s\n", name_.c_str(), text);
}

int run_client(int argc, char** argv, const char* name, const char* usage, std::size_t needs,
               const std::function<void(Client&, const Arguments&)>& body) {
  const Arguments arguments(argv + std::min(argc, 2), argv + argc);
  if (argc < 2 || arguments.size() < needs) {
    std::fprintf(stderr, "usage: %s SERVER%s    (SERVER: such as lab, of forceserver run --listen lab)\n", name, usage);
    return 2;
  }
  Beat beat;
  try {
    Client client(argv[1], name, beat);
    body(client, arguments);
    return 0;
  } catch (const std::exception& error) {
    if (beat.is_told_to_end()) return 0;  // Ctrl-C also ends the server: no failure
    std::fprintf(stderr, "%s: %s\n", name, error.what());
    return 1;
  }
}
