// The program fidel-controller, in a process of its own.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <mutex>
#include <string>
#include <thread>

namespace scenes {

class ControllerProcess {
 public:
  // port 0: any; it returns when the program listens.
  explicit ControllerProcess(const std::string& device = "sim:?encoder=ideal", uint16_t port = 0);
  ~ControllerProcess() { end(9); }
  ControllerProcess(const ControllerProcess&) = delete;
  ControllerProcess& operator=(const ControllerProcess&) = delete;

  uint16_t port() const { return port_; }
  std::string uri(const char* options = "") const { return "fidel:udp:127.0.0.1:" + std::to_string(port_) + options; }
  void signal(int number) const;
  int end(int signal);  // waits for its end, and returns its status as of waitpid; a second call does nothing
  std::string said() const;  // so far

 private:
  pid_t process_ = 0;
  int output_ = -1;
  uint16_t port_ = 0;
  mutable std::mutex mutex_;
  std::string said_;
  std::thread reader_;
};

}  // namespace scenes
