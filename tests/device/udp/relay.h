// A relay on loopback between a host and fidel-controller: it delays datagrams, loses, repeats, reorders and damages them, all from a
// seed. Its thread also calls the test for each datagram that goes to the host.
#pragma once

#include <netinet/in.h>

#include <atomic>
#include <cstdint>
#include <functional>
#include <mutex>
#include <queue>
#include <string>
#include <thread>
#include <vector>

#include "scenes/random.h"

namespace scenes {

using Bytes = std::vector<uint8_t>;

class Relay {
 public:
  struct Way {
    double delay = 0, jitter = 0;  // s: each takes from delay to delay + jitter, in order
    double loss = 0, again = 0;    // chances: it is lost, it comes twice
    double reorder = 0;            // chance that it comes 5 ms later than its turn
    double damage = 0;             // chance that one of its bits is wrong
  };

  explicit Relay(uint16_t controller, uint64_t seed = 1);
  ~Relay();

  uint16_t port() const { return port_; }
  std::string uri(const char* options = "") const { return "fidel:udp:127.0.0.1:" + std::to_string(port_) + options; }

  void set(const Way& both) { set(both, both); }
  void set(const Way& to_host, const Way& to_controller);
  void cut() { set({.loss = 1}); }
  // Called in the relay's thread with each datagram of the controller, which it may change.
  void on_way_to_host(std::function<void(Bytes&)> f);
  // So many datagrams of random bytes go to both ends, between the others.
  void flood(int count) { floods_ = count; }
  uint64_t passed() const { return passed_; }  // datagrams that were passed on

 private:
  enum End { host, controller };
  struct Flying {
    double due;  // s
    uint64_t order;
    End to;
    Bytes bytes;
    bool operator<(const Flying& other) const { return due != other.due ? due > other.due : order > other.order; }
  };

  void run();
  void take(End to);
  void launch(Bytes bytes, End to, const Way& way);
  void send_due();
  void send_garbage();
  void send(End to, const Bytes& bytes);

  int front_, back_;  // sockets, to the host and to the controller
  uint16_t port_ = 0;
  sockaddr_in host_{};  // the newest; port 0: none
  std::mutex mutex_;   // of the next two
  Way ways_[2];
  std::function<void(Bytes&)> hook_;
  std::priority_queue<Flying> flying_;
  double newest_due_[2]{};
  uint64_t order_ = 0;
  Random random_;
  std::atomic<int> floods_{0};
  std::atomic<uint64_t> passed_{0};
  std::atomic<bool> is_ending_{false};
  std::thread thread_;
};

}  // namespace scenes
