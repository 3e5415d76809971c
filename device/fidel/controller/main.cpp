// fidel-controller: a controller of FIDEL's protocol over UDP (../UDP.md) with a device behind it, by default the simulated one.
#include <poll.h>
#include <sched.h>
#include <sys/prctl.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <csignal>
#include <cstdio>
#include <memory>
#include <string>

#include "device/fidel/controller/controller.h"
#include "device/support/refusal.h"

namespace {

volatile std::sig_atomic_t is_ending = 0;

// Prints a line, unless nobody takes it: the loop never waits for a terminal or a pipe.
void say(const std::string& line) {
  pollfd out{STDOUT_FILENO, POLLOUT, 0};
  if (poll(&out, 1, 0) != 1 || !(out.revents & POLLOUT)) return;
  const std::string text = line + "\n";
  if (write(STDOUT_FILENO, text.data(), text.size()) < 0) return;
}

void catch_signals() {
  struct sigaction action{};
  action.sa_handler = [](int) { is_ending = 1; };
  for (const int signal : {SIGINT, SIGTERM}) sigaction(signal, &action, nullptr);
  struct sigaction hang_up{};
  sigaction(SIGHUP, nullptr, &hang_up);
  if (hang_up.sa_handler != SIG_IGN) sigaction(SIGHUP, &action, nullptr);  // under nohup it stays ignored
  std::signal(SIGPIPE, SIG_IGN);
}

// Real-time where the system allows it.
void hurry() {
  prctl(PR_SET_TIMERSLACK, 1UL);
  sched_param priority{};
  priority.sched_priority = 70;
  const bool is_granted = sched_setscheduler(0, SCHED_FIFO | SCHED_RESET_ON_FORK, &priority) == 0;
  say(is_granted ? "the loop of 1 kHz has real-time priority" : "the loop of 1 kHz has no real-time priority: it may be late");
}

using Device = std::unique_ptr<fs_device, decltype(&fs_device_close)>;

void run(const std::string& place, const std::string& uri) {
  fs_device* opened = nullptr;
  if (const fs_status status = fs_device_open(uri.c_str(), &opened)) fs::refuse(status, "%s", fs_last_error());
  const Device device(opened, fs_device_close);
  fs::udp::Socket socket = fs::udp::Socket::listening(fs::udp::parse_host_port(place, "--listen", 0));
  fs::udp::Controller controller(device.get(), socket, say);
  say("listening at " + socket.own().text() + " for one host, with the device " + uri);
  hurry();
  controller.run([] { return is_ending != 0; });
  say("ended, with force 0");
}

}  // namespace

int main(int count, char** arguments) {
  CLI::App
      app("The controller of a FIDEL, reached over UDP as fidel:udp:HOST:PORT, with the simulated device behind it.\n"
          "It renders the force or the local model that its host sends, a thousand times a second, and ends on Ctrl-C.",
          "fidel-controller");
  app.set_version_flag("--version", std::string("fidel-controller ") + fs_version());
  std::string place = "127.0.0.1:" + std::to_string(fs::udp::usual_port), uri = "sim:";
  app.add_option("--listen", place,
                 "HOST:PORT to listen at, or a PORT of this machine alone; port 0: any that is free. Anybody who reaches it can "
                 "move the device")
      ->capture_default_str();
  app.add_option("--device", uri, "the device behind it, such as 'sim:?hand=released'")->capture_default_str();
  try {
    app.parse(count, arguments);
  } catch (const CLI::ParseError& end) {  // also --help
    return app.exit(end) == 0 ? 0 : 1;
  }
  catch_signals();
  try {
    const bool is_port = place.find_first_not_of("0123456789") == std::string::npos;
    run(is_port ? "127.0.0.1:" + place : place, uri);
  } catch (const fs::Refusal& refusal) {
    std::fprintf(stderr, "fidel-controller: %s\n", refusal.text.c_str());
    return 1;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "fidel-controller: %s\n", error.what());
    return 1;
  }
  return 0;
}
