// A FIDEL whose controller is reached over UDP: the host's end of the protocol of UDP.md.
#pragma once

#include <array>
#include <atomic>
#include <condition_variable>
#include <mutex>
#include <string>

#include "device/fidel/connection.h"
#include "device/fidel/udp/arrivals.h"
#include "device/fidel/udp/clock_map.h"
#include "device/fidel/udp/protocol.h"
#include "device/fidel/udp/socket.h"
#include "device/support/link_meter.h"

namespace fs::udp {

struct HostOptions {
  HostPort peer;
  bool renders_models = true;
  float rate = 0;  // Hz
};
HostOptions parse_host_options(const char* text);  // what follows "fidel:"; throws a Refusal INVALID

class UdpConnection final : public FidelConnection {
 public:
  UdpConnection(const HostOptions& options, Socket socket);  // throws a Refusal; NOT_FOUND: nobody listens there
  ~UdpConnection() override;

  void get_info(fs_device_info& out) const override;
  fs_status receive(fs_state& out) noexcept override;
  fs_status send(const fs_wrench& wrench) noexcept override;
  fs_status write_model(const fs_model& model) noexcept override;
  fs_status get_link(fs_link& out) noexcept override;
  std::string control(const std::string& request) override;

 private:
  // A command that was sent: what its echo in a state is compared with.
  struct Sent {
    uint32_t number = 0;
    double time = 0;          // s
    uint64_t state_time = 0;  // ns, the controller's clock, of the state that it answers; 0: none
  };
  struct Seen {  // a state
    uint32_t number = 0;
    uint64_t time = 0;  // ns
    double given = 0;   // s, as receive gave it
  };
  enum class Change { none, state, lost };

  bool await_welcome(int64_t deadline, uint32_t hello, double hello_sent);
  void greet();
  std::string place() const { return options_.peer.host + ":" + std::to_string(options_.peer.port); }

  Change take(const Datagram& datagram, fs_state& out) noexcept;
  bool take_state(const Header& header, const State& state, fs_state& out) noexcept;
  void take_echo(const State& state, double came) noexcept;
  void take_answer(const Answer& answer) noexcept;
  fs_status send(Command command, const Seen& answered) noexcept;
  void ignore() noexcept { ignored_.fetch_add(1, std::memory_order_relaxed); }
  Header header(Type type, uint32_t number) const noexcept { return {type, session_, number}; }
  std::string link_text() const;

  const HostOptions options_;
  Socket socket_;
  const uint64_t session_;
  Welcome welcome_;
  std::string holder_;  // who has the controller, while it is refused
  uint32_t hellos_ = 0;

  // The thread that receives and sends has these.
  ClockMap clock_;
  LinkMeter meter_;
  LinkMeter::Totals totals_;
  Arrivals states_;
  std::array<Seen, 64> seen_{};
  Seen newest_;
  std::array<Sent, 2048> sent_{};
  uint32_t commands_ = 0, echoed_ = 0;  // the numbers of the newest command, and of the newest that came back in a state
  double heard_at_ = 0;                 // s, when something valid came
  bool is_lost_ = false;

  // What any thread may ask for.
  std::atomic<uint64_t> ignored_{0};
  std::atomic<double> told_offset_{0}, told_round_trip_{0};
  std::atomic<uint32_t> told_jumps_{0}, told_controller_ignored_{0};

  std::mutex asking_;  // one request at a time
  std::mutex answer_mutex_;
  std::condition_variable answered_;
  // With answer_mutex_.
  Answer answer_;           // the newest to that request
  uint32_t asked_ = 0;      // the number of the newest request
  double answered_at_ = 0;  // s, when it was asked or an answer came
  uint32_t requests_ = 0;   // with asking_
};

}  // namespace fs::udp
