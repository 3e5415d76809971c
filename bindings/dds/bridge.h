// The bridge between a server and the other sites of a room: one loop, which waits for samples and looks at the server.
#pragma once

#include <atomic>
#include <memory>
#include <optional>
#include <string>

#include "edits.h"
#include "incoming.h"
#include "outgoing.h"

namespace bridge {

struct Options {
  Participant::Settings network;
  std::string endpoint;                    // of the server
  std::string site;
  std::string mirrors;                     // a site whose hand this one shows; empty: none
  double hand_rate = 100;                  // Hz
  double client_force = 0;                 // N, of a mirror's server; 0: the servo's
  bool no_stop = false;                    // of a mirror's server
  std::map<std::string, fs_frame> frames;  // as Incoming::Settings has them
  bool ros = false;
  std::map<std::string, std::string> follow;  // "client/object" to the ROS topic of its pose
};

// The server of a site without a device.
struct Mirror {
  forceserver::Scene scene;
  forceserver::Device device;
  forceserver::Servo servo;
  forceserver::Server server;
};

class RosTopics;

class Bridge {
 public:
  explicit Bridge(const Options& options);
  ~Bridge();

  // Goes on until is_ending. Returns the exit status.
  int run(const std::atomic<bool>& is_ending);

 private:
  static double now();    // s, on this site's clock
  double shift() const;   // s: the server's clock minus that. Throws forceserver::Error
  void open_ros();
  void turn();
  void look_at_server(double now);
  void open_mirror();
  void connect(double now);
  void lose_server(double now);
  bool is_twin();

  void take_hands(double now);
  void take_pings(double now);
  void take_stops();
  void write_stops();
  void take_answers(double now);
  void look_for_stop(double now);
  void follow_mirrored(double now);
  void write_hand(double now);
  void write_reports(double now);
  void write_status(double now);
  void write_ping(double now);
  void heal(double now);
  void look_for_deaf_sites(double now);
  void join_again();
  void leave();

  const Options options_;
  const uint64_t session_;
  Participant participant_;
  // Always there but for a moment in join_again, which makes it anew at the same place: the parts refer to it.
  std::optional<Room> room_;
  Worker worker_;
  ContentReader contents_;
  Outgoing outgoing_;
  Incoming incoming_;
  Edits edits_;
  std::unique_ptr<RosTopics> ros_;

  Mirror mirror_;
  SceneRef scene_;               // at the server; null: not connected
  std::string own_name_;         // there
  std::string trouble_;          // why it cannot connect, as was told
  fs_device_info device_ = fs_device_info_init();
  fs_servo_stats stats_ = fs_servo_stats_init();
  double next_try_ = 0, next_look_ = 0, next_hand_ = 0, next_reports_ = 0, next_status_ = 0, next_ping_ = 0, next_stats_ = 0;

  bool is_force_on_ = true;      // as it was seen last
  bool is_stopped_by_room_ = false;
  double stopped_ = -1e9;        // s, when the force was seen to stop
  uint64_t hand_number_ = 0, report_number_ = 0, ping_number_ = 0, stop_number_ = 0;
  std::deque<forceserver_Stop> stops_;      // to be written
  std::deque<forceserver_Answer> answers_;  // to be written
  std::deque<std::pair<uint64_t, double>> sent_pings_;
  struct Pinged {
    uint64_t number;
    double arrived;
  };
  std::map<std::string, Pinged> pinged_;    // by site
  std::deque<std::pair<double, uint64_t>> digests_;  // that outgoing_ had lately, with the time
  std::map<std::string, double> missing_since_;      // s, by site: it has other objects than were written
  std::map<std::string, double> deaf_since_;         // s, by site: it does not hear this one
  double silent_since_ = -1;     // s: some site is there that says nothing; negative: none
  double next_join_ = 0, join_wait_ = 30;  // s
  bool has_twin_told_ = false;
};

}  // namespace bridge
