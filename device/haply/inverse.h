// A connected Inverse3. The service answers each message with one state. One thread
// calls receive, send and get_link; any thread calls control.
#pragma once

#include <mutex>
#include <optional>
#include <string>

#include <forceserver/driver.h>

#include "device/haply/dialect.h"
#include "device/haply/service.h"
#include "device/support/address.h"
#include "device/support/link_meter.h"

namespace fs::haply {

inline constexpr const char* default_host = "127.0.0.1";
inline constexpr const char* default_port = "10001";

// The first message of a service: all devices that it knows. IO: it is none.
Message inventory_of(Service& service);

// What the arm says of its force beside what was sent, as averages over half a second, so that a delay does not count.
class ForceCheck {
 public:
  void note(double now, fs_vec3 sent, fs_vec3 told) noexcept;  // s, N
  bool differs() const noexcept { return differs_; }  // by more than a fifth in the last whole half second

 private:
  double since_ = 0;  // s
  fs_vec3 sent_{}, told_{};
  int count_ = 0;
  bool differs_ = false;
};

class Inverse {
 public:
  explicit Inverse(const Address& address);
  ~Inverse();
  Inverse(const Inverse&) = delete;
  Inverse& operator=(const Inverse&) = delete;

  void get_info(fs_device_info& out) const;
  fs_status receive(fs_state& out);
  fs_status send(const fs_wrench& wrench);
  fs_status get_link(fs_link& out) noexcept;
  std::string control(const std::string& request);

 private:
  void choose_arm(const Message& inventory, const std::string& place);
  void choose_grip(const Message& inventory, const Address& address);
  void set_up();
  void check_frame(const Arm& arm) const;
  void note_filters(const Arm& arm);
  fs_status ask(fs_vec3 force);
  fs_status await_answers(double until, std::string_view& text);
  fs_status lost();
  fs_status without_answer(fs_status status, double now);
  const char* read_state(std::string_view text, fs_state& out);
  const char* take_arm(const Arm& arm, fs_state& out);
  void take_grip(fs_state& out);
  uint32_t flags() const noexcept;
  void tell(const fs_state& state);

  double force_max_;  // N
  double period_;  // s, from one state to the next
  std::string host_, port_, version_, id_, kind_, grip_id_, filters_;
  Dialect dialect_ = Dialect::vector;
  std::optional<Service> service_;
  Message message_;  // the newest
  std::string command_;
  bool is_calibrated_ = false, is_ready_ = false, has_power_ = false;
  fs_quat orientation_{};  // of the grip, the last that is known
  uint32_t buttons_ = 0;
  bool has_grip_ = false;  // the newest state tells of it
  int outstanding_ = 0;  // messages that the service has not answered
  double next_ = 0;  // s, when the next state is due
  double sent_at_ = 0;  // s, the last message
  double good_at_ = 0;  // s, the last state that could be used
  fs_vec3 sent_force_{};  // N, of the last message
  ForceCheck check_;
  LinkMeter meter_;
  uint32_t sent_ = 0, answers_ = 0;

  // What the request "status" tells, as of the newest state.
  struct Told {
    uint32_t flags = FS_STATE_CONNECTING;
    bool has_grip = false, differs = false;
    double round_trip = 0;  // s
    double time = 0;        // s, of the state
  };
  double round_trip_ = 0;  // s, the last
  std::mutex told_mutex_;  // receive never waits for it
  Told now_;
};

}  // namespace fs::haply
