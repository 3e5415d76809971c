// What every process of the testbed does: it connects, goes on until it is told to end, and prints what happens.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "../quickstart_source/beat.h"
#include "../quickstart_source/landscape.h"

class Client {
 public:
  // Connects to a server as `name`, with the frame and tool of the landscape.
  Client(const std::string& endpoint, const std::string& name, Beat& beat);
  ~Client() { fs_scene_destroy(scene_); }  // its objects fade
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;

  fs_scene* scene() const { return scene_; }

  // Waits until `period` s after the previous beat. Returns false after Ctrl-C.
  bool wait(double period) { return beat_.wait(period); }

  // Prints a line that begins with the client's name.
  void say(const char* form, ...) const __attribute__((format(printf, 2, 3)));

 private:
  std::string name_;
  Beat& beat_;
  fs_scene* scene_ = nullptr;
};

// The main function of a client: "NAME ENDPOINT [ARGUMENT...]", where `usage` names the arguments and `needs` is how
// many there must be. Runs `body` with them. Exit code: 0, or 1 when something failed or the server has gone.
using Arguments = std::vector<std::string>;
int run_client(int argc, char** argv, const char* name, const char* usage, std::size_t needs,
               const std::function<void(Client&, const Arguments&)>& body);
