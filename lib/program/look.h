// A look is the state of a server at one moment. The commands clients and watch use it.
#pragma once

#include <cstdio>

#include "program.h"

struct Look {
  std::string endpoint;
  fs_device_info device;
  double time;                      // s, scene's clock
  fs_state hand;                    // device frame
  fs_response response;
  fs_wrench sent;                   // what the device gets
  fs_servo_stats servo;
  std::vector<fs_client> clients;   // the server's own scene first; without this program itself
  std::vector<fs_report> objects;   // of all clients, in device metres and newtons
  std::vector<fs_event> events;     // since the look before
};

// What happened from one look to the next.
struct Rates {
  double moves, changes;            // a second
};
struct Ticks {
  std::uint64_t all, missed, guarded;
};

// Connects to `server`, a name or an endpoint. The client's name is kind and process number, such as "watch-1234".
Scene connect(const std::string& server, const char* kind);
std::string full_endpoint(const std::string& server);
std::string how_to_resume(const std::string& server);  // who may let the force return after a stop, and by which command

// Returns what `look` returns. If the server ends meanwhile, prints that and returns exit_odd.
int at_server(const std::string& server, auto&& look) {
  try {
    return look();
  } catch (const Error& failure) {
    if (failure.status() != FS_ERROR_DISCONNECTED) throw;
    std::fprintf(stderr, "forceserver: the server at %s has gone\n", full_endpoint(server).c_str());
    return exit_odd;
  }
}

Look take_look(const Scene& scene, const std::string& endpoint);
std::vector<fs_client> other_clients(const Scene& scene);

Rates rates_of(const fs_client& client, const Look& now, const Look& before);
Ticks ticks_of(const Look& now, const Look& before);

// Whether the slope that is felt is less than the object asks for.
inline bool is_capped(const fs_report& report) { return report.stiffness_applied < 0.99 * report.stiffness_wanted; }

// A look as watch prints it: lines for people, or one line of JSON for programs.
std::vector<std::string> to_text(const Look& now, const Look& before);
std::string to_json(const Look& now, const Look& before);
