#include "bridge.h"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>

#include "mirror.h"
#include "ros.h"
#include "say.h"

namespace bridge {
namespace {

constexpr double look_period = 0.01, reports_period = 0.04, status_period = 1, retry = 0.5;  // s

double steady_now() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

// Another number each time that a bridge starts, and a larger one than before.
uint64_t make_session() {
  const auto since = std::chrono::system_clock::now().time_since_epoch();
  const auto microseconds = std::chrono::duration_cast<std::chrono::microseconds>(since).count();
  return (static_cast<uint64_t>(microseconds) << 8) + (static_cast<uint64_t>(getpid()) & 0xff);
}

// True each time that the period is over.
bool is_due(double& next, double now, double period) {
  if (now < next && next - now < 10 * period + 10) return false;
  next = now - next < period && next > 0 ? next + period : now + period;
  return true;
}

}  // namespace

Bridge::Bridge(const Options& options)
    : options_(options), session_(make_session()), participant_(options.network), room_(std::in_place, participant_),
      worker_([this] { participant_.wake(); }), contents_(*room_, worker_), outgoing_(*room_, worker_, options.site, session_),
      incoming_(*room_, contents_, {options.endpoint, options.site, options.frames}),
      edits_(*room_, incoming_, contents_, outgoing_.contents(), options.site, session_) {
  open_ros();
  if (!options.mirrors.empty()) register_mirror();
}

Bridge::~Bridge() = default;

void Bridge::open_ros() {
  const bool is_used = options_.ros || !options_.follow.empty();
  if (is_used) ros_ = std::make_unique<RosTopics>(participant_, options_.site, options_.ros, options_.follow);
}

// This site's clock is the monotonic one, which is also the server's unless its servo is virtual.
double Bridge::now() { return steady_now(); }

double Bridge::shift() const {
  constexpr double rounding = 1e-6;  // s
  const double before = steady_now(), time = scene_->get_time(), after = steady_now();
  // This thread may have waited between the readings, so what lies between them is the same clock.
  return time >= before - rounding && time <= after + rounding ? 0 : time - after;
}

int Bridge::run(const std::atomic<bool>& is_ending) {
  const std::string network = options_.network.network;
  say("site " + options_.site + " is in room " + options_.network.partition + " (domain " +
      std::to_string(options_.network.domain) + ", interface " + network +
      (options_.network.security.empty() ? ", not encrypted" : ", encrypted") + "); Ctrl-C ends");
  if (!options_.mirrors.empty()) say("waits for site " + options_.mirrors + ", whose hand it shows");
  while (!is_ending) {
    participant_.wait(scene_ ? std::clamp(next_hand_ - now(), 0.0, 0.01) : 0.01);
    if (is_twin()) return 2;
    turn();
  }
  leave();
  return 0;
}

void Bridge::turn() {
  worker_.run_done();
  double time = now();
  incoming_.take(time);
  take_hands(time);
  take_pings(time);
  take_stops();
  take_answers(time);
  if (!scene_) connect(time);
  if (!scene_) incoming_.forget_gone(time);
  if (!options_.mirrors.empty() && !incoming_.find(options_.mirrors)) show_no_hand();
  if (scene_) {
    try {
      look_at_server(time);
    } catch (const forceserver::Error& error) {
      if (error.status() == FS_ERROR_DISCONNECTED) {
        lose_server(time);
      } else if (error.status() != FS_ERROR_TIMEOUT) {
        complain(error.what());
      }
    }
    time = now();
  }
  if (incoming_.has_lost_server()) incoming_.forget_server();
  write_stops();
  if (is_due(next_status_, time, status_period)) write_status(time);
  write_ping(time);
  outgoing_.write(time);
  heal(time);
  if (!options_.network.security.empty()) look_for_deaf_sites(time);
}

void Bridge::look_at_server(double time) {
  incoming_.set_shift(shift());
  write_hand(time);
  incoming_.apply(time);
  edits_.ask(time);
  edits_.take(*scene_, time);
  if (is_due(next_look_, time, look_period)) {
    outgoing_.look(scene_, own_name_, time, incoming_.shift());
    write_reports(time);
  }
  look_for_stop(time);
  if (ros_) ros_->follow(*scene_);
}

// ------------------------------------------------------------------------------------------------------------ the server

void Bridge::open_mirror() {
  const RemoteSite* const site = incoming_.find(options_.mirrors);
  if (!site || !site->is_known || !site->status.has_server) return;
  show_device(site->name, site->status, options_.hand_rate);
  mirror_.device = forceserver::Device::open("mirror:" + site->name);
  mirror_.scene = forceserver::Scene::create();
  fs_servo_options servo = fs_servo_options_init();
  // The forces are to be those of the other site, so the bounds of their slopes must be the same. They go nowhere.
  servo.speed_limit = -1;
  servo.slew_limit = -1;
  servo.delay = std::max(site->status.delay, 1e-9);
  servo.damping = site->status.damping > 0 ? site->status.damping : 0;
  servo.max_stiffness = std::max(0.0, site->status.max_stiffness);
  servo.priority = -1;
  mirror_.servo = forceserver::Servo::start(mirror_.scene, mirror_.device, &servo);
  fs_server_options server = fs_server_options_init();
  server.max_clients = 256;
  server.force_limit = options_.client_force;
  server.no_stop = options_.no_stop;
  mirror_.server = forceserver::Server::start(mirror_.servo, options_.endpoint, &server);
  say("shows the hand of site " + site->name + ", and listens at " + options_.endpoint);
}

void Bridge::connect(double time) {
  if (!is_due(next_try_, time, retry)) return;
  try {
    if (!options_.mirrors.empty() && !mirror_.server) open_mirror();
    if (!options_.mirrors.empty() && !mirror_.server) return;
    own_name_ = "bridge";
    auto scene = std::make_shared<const forceserver::Scene>(forceserver::Scene::connect(options_.endpoint, own_name_));
    device_ = scene->get_device_info();
    stats_ = scene->get_servo_stats();
    scene_ = std::move(scene);
    is_force_on_ = stats_.enabled;
    trouble_.clear();
    incoming_.set_device(device_);
    incoming_.forget_server();
    next_status_ = 0;
    say("connected to " + options_.endpoint + " (" + device_.name + ")");
  } catch (const forceserver::Error& error) {
    const std::string what = error.status() == FS_ERROR_EXISTS ? options_.endpoint + " has a bridge already" : error.what();
    if (what != trouble_) {
      complain(what + "; it is tried again and again");
      trouble_ = what;
    }
  }
}

void Bridge::lose_server(double time) {
  say("the server " + options_.endpoint + " is gone; its objects fade at the other sites");
  scene_ = nullptr;
  outgoing_.forget(time);
  incoming_.forget_server();
  next_status_ = 0;
  next_try_ = time + retry;
}

// The bridge that was started first, by the time of the day, stays.
bool Bridge::is_twin() {
  const uint64_t twin = incoming_.twin();
  if (twin == 0) return has_twin_told_ = false;
  if (twin < session_) {
    complain("there is a site " + options_.site + " in the room already; give this one another name (--site)");
    return true;
  }
  if (!has_twin_told_) complain("another bridge with the name of site " + options_.site + " has started, and will end");
  has_twin_told_ = true;
  return false;
}

// ------------------------------------------------------------------------------------------------------------ time

void Bridge::take_hands(double time) {
  room_->hands.reader.take([&](const forceserver_Hand& sample, const dds_sample_info_t& info) {
    RemoteSite* const site = info.valid_data && std::isfinite(sample.sent) ? incoming_.find(text_of(sample.site)) : nullptr;
    if (!site) return;
    site->clock.note_arrival(sample.sent, time);
    if (site->name == options_.mirrors) show_hand(sample, steady_now());
  });
}

void Bridge::take_pings(double time) {
  room_->pings.reader.take([&](const forceserver_Ping& sample, const dds_sample_info_t& info) {
    const std::string name = text_of(sample.site);
    RemoteSite* const site = info.valid_data && std::isfinite(sample.sent) ? incoming_.find(name) : nullptr;
    if (!site || name == options_.site) return;
    if (!pinged_.count(name)) next_ping_ = 0;
    pinged_[name] = {sample.number, time};
    site->clock.note_arrival(sample.sent, time);
    for (uint32_t i = 0; i < sample.echoes._length; ++i) {
      const forceserver_Echo& echo = sample.echoes._buffer[i];
      if (text_of(echo.site) != options_.site || !(echo.held >= 0)) continue;
      for (const auto& [number, sent] : sent_pings_) {
        if (number == echo.number && time - sent >= echo.held) site->clock.note_round_trip(time - sent - echo.held, time);
      }
    }
  });
}

void Bridge::write_ping(double time) {
  bool is_new = false;
  for (const auto& [name, site] : incoming_.sites()) is_new |= time - site.first_seen < 2;
  if (!is_due(next_ping_, time, is_new ? 0.2 : 1)) return;
  std::vector<forceserver_Echo> echoes;
  std::erase_if(pinged_, [&](const auto& entry) { return !incoming_.find(entry.first); });
  for (const auto& [name, pinged] : pinged_) {
    forceserver_Echo& echo = echoes.emplace_back();
    put_text(echo.site, name);
    echo.number = pinged.number;
    echo.held = time - pinged.arrived;
    if (echoes.size() == 64) break;
  }
  forceserver_Ping sample{};
  put_text(sample.site, options_.site);
  sample.number = ++ping_number_;
  sample.sent = now();
  lend(sample.echoes, echoes);
  sent_pings_.emplace_back(sample.number, sample.sent);
  if (sent_pings_.size() > 32) sent_pings_.pop_front();
  room_->pings.writer.write(sample);
}

// ------------------------------------------------------------------------------------------------------------ stop

void Bridge::look_for_stop(double time) {
  bool has_news = is_due(next_stats_, time, 0.1);
  fs_event event{};
  std::string who;
  while (fs_scene_next_event(scene_->get(), 0, &event) == FS_OK && event.kind != FS_EVENT_NONE) {
    if (event.kind == FS_EVENT_CLIENT) who = event.name;
    if (event.kind == FS_EVENT_CLIENT || event.kind == FS_EVENT_DEVICE) has_news = true;
  }
  if (!has_news) return;
  const uint32_t faults = stats_.faults;
  stats_ = scene_->get_servo_stats();
  const bool is_on = stats_.enabled;
  if (is_on != is_force_on_ || stats_.faults != faults) next_status_ = 0;
  // Who presses the button again after the force has returned for a moment is heard, too.
  const bool is_pressed = !is_on && !who.empty() && who != own_name_ && who.find('@') == std::string::npos;
  if ((is_force_on_ && !is_on) || is_pressed) {
    stopped_ = time;
    if (!is_stopped_by_room_ || is_pressed) {
      forceserver_Stop stop{};
      put_text(stop.site, options_.site);
      put_text(stop.client, who);
      stop.number = ++stop_number_;
      stops_.push_back(stop);
      say("the force was stopped" + (who.empty() ? std::string() : " by " + who) + "; all sites of the room are stopped");
    }
  }
  if (is_on) is_stopped_by_room_ = false;
  is_force_on_ = is_on;
  if (mirror_.server) follow_mirrored(time);
}

// A mirror's force returns when that of the device does. Its own faults, such as that of a machine that is too slow, harm nobody.
void Bridge::follow_mirrored(double time) {
  if (stats_.faults & ~uint32_t{FS_FAULT_DEVICE}) mirror_.servo.set_enabled(true);
  const RemoteSite* const site = incoming_.find(options_.mirrors);
  if (is_force_on_) {
    const bool is_off_there = site && site->is_known && !site->status.enabled && time > stopped_ + 2;
    if (!is_off_there) return;
    is_stopped_by_room_ = true;
    mirror_.servo.set_enabled(false);
    say("the force of site " + site->name + " is stopped, and returns there only");
    return;
  }
  const bool is_on_there = site && site->is_known && site->status.enabled && site->status_time > stopped_ + 2;
  if (is_on_there && time > stopped_ + 2) mirror_.servo.set_enabled(true);
}

void Bridge::take_stops() {
  room_->stops.reader.take([&](const forceserver_Stop& sample, const dds_sample_info_t& info) {
    const std::string from = text_of(sample.site);
    if (!info.valid_data || from == options_.site) return;
    forceserver_Answer answer{};
    put_text(answer.site, from);
    put_text(answer.answerer, options_.site);
    answer.number = sample.number;
    answer.is_stop = true;
    answer.result = FS_ERROR_STATE;
    if (scene_) {
      // A stop waits for no new connection.
      const forceserver::Scene* const who = incoming_.scene_of(from, text_of(sample.client), false, now());
      answer.result = fs_scene_stop_force(who ? who->get() : scene_->get());
      if (answer.result == FS_OK) is_stopped_by_room_ = true;
      if (answer.result < 0) put_text(answer.text, fs_last_error());
    } else {
      put_text(answer.text, "no server is running there");
    }
    say("site " + from + " stopped the force" + (*sample.client ? " (" + text_of(sample.client) + ")" : "") +
        (answer.result < 0 ? "; here it goes on: " + text_of(answer.text) : ""));
    answers_.push_back(answer);
  });
  for (; !answers_.empty(); answers_.pop_front()) {
    if (!room_->answers.writer.write(answers_.front())) break;
  }
}

// Also when the server has ended since somebody pressed the button.
void Bridge::write_stops() {
  for (; !stops_.empty(); stops_.pop_front()) {
    if (!room_->stops.writer.write(stops_.front())) break;
  }
}

void Bridge::take_answers(double time) {
  room_->answers.reader.take([&](const forceserver_Answer& sample, const dds_sample_info_t& info) {
    if (!info.valid_data || text_of(sample.site) != options_.site) return;
    if (!sample.is_stop) return edits_.take_answer(sample, time);
    const std::string from = text_of(sample.answerer);
    if (sample.number == 0 || sample.number > stop_number_ || time > stopped_ + 10) return;  // nobody asked
    say(sample.result < 0 ? "site " + from + " did not stop: " + text_of(sample.text) : "site " + from + " has stopped");
  });
}

// ------------------------------------------------------------------------------------------------------------ what is told

void Bridge::write_hand(double time) {
  if (!is_due(next_hand_, time, 1 / options_.hand_rate)) return;
  if (!options_.mirrors.empty()) return;  // it is another site's
  fs_state state{};
  fs_wrench sent{};
  const fs_status status = fs_scene_get_hand(scene_->get(), &state, nullptr, &sent);
  if (status == FS_ERROR_DISCONNECTED) throw forceserver::Error(status);
  if (status < 0) return;
  forceserver_Hand sample{};
  put_text(sample.site, options_.site);
  sample.number = ++hand_number_;
  sample.sent = now();
  sample.time = state.time - incoming_.shift();
  sample.place = to_sample(state.pose);
  sample.motion = to_sample(state.twist);
  sample.force = to_sample(sent.force);
  sample.torque = to_sample(sent.torque);
  sample.flags = state.flags;
  sample.buttons = state.buttons;
  room_->hands.writer.write(sample);
  if (ros_) ros_->write(sample);
}

// Bridges do not read these reports, so where nobody else does they cost nothing.
void Bridge::write_reports(double time) {
  if (!is_due(next_reports_, time, reports_period) || !room_->reports.has_readers()) return;
  std::vector<fs_report> reports = scene_->get_reports();
  const auto strength = [](const fs_report& r) { return std::hypot(r.wrench.force.x, r.wrench.force.y, r.wrench.force.z); };
  std::erase_if(reports, [&](const fs_report& r) { return !std::isfinite(r.distance) || !std::strchr(r.name, '/'); });
  std::sort(reports.begin(), reports.end(), [&](const fs_report& a, const fs_report& b) { return strength(a) > strength(b); });
  if (reports.size() > 64) reports.resize(64);
  std::vector<forceserver_Report> felt;
  for (const fs_report& report : reports) {
    forceserver_Report& out = felt.emplace_back();
    std::string client, object;
    split_name(report.name, client, object);
    put_text(out.client, client);
    put_text(out.name, object);
    out.state = report.state;
    out.weight = report.weight;
    out.distance = report.distance;
    out.at = to_sample(report.point);
    out.force = to_sample(report.wrench.force);
    out.torque = to_sample(report.wrench.torque);
  }
  forceserver_Reports sample{};
  put_text(sample.site, options_.site);
  sample.number = ++report_number_;
  sample.sent = now();
  lend(sample.felt, felt);
  room_->reports.write(sample);
}

void Bridge::write_status(double time) {
  contents_.drop_unused(time);
  forceserver_Status sample{};
  put_text(sample.site, options_.site);
  sample.session = session_;
  put_text(sample.version, fs_version());
  sample.has_server = scene_ != nullptr;
  sample.is_mirror = !options_.mirrors.empty();
  put_text(sample.mirrors, options_.mirrors);
  if (scene_) {
    put_text(sample.device, device_.name);
    sample.force_axes = device_.force_axes;
    sample.torque_axes = device_.torque_axes;
    sample.workspace_radius = device_.workspace_radius;
    sample.workspace_height = device_.workspace_height;
    sample.workspace_angle = device_.workspace_angle;
    sample.force_max = device_.force_max;
    sample.torque_max = device_.torque_max;
    sample.device_damping = device_.damping;
    sample.mass = device_.mass;
    sample.rate = device_.rate;
    sample.max_stiffness = std::isfinite(stats_.max_stiffness) ? stats_.max_stiffness : 0;
    sample.damping = stats_.damping;
    sample.delay = stats_.delay;
    sample.faults = stats_.faults;
    sample.enabled = stats_.enabled;
  }
  sample.motion_rate = outgoing_.motion_rate();
  sample.objects = outgoing_.objects();
  sample.digest = outgoing_.digest();
  std::vector<forceserver_HeldObjects> held;
  for (const auto& [name, site] : incoming_.sites()) {
    if (held.size() == 64) break;
    forceserver_HeldObjects& one = held.emplace_back();
    put_text(one.site, name);
    one.objects = site.objects;
    one.digest = site.digest;
  }
  lend(sample.held, held);
  std::vector<std::string> keys = contents_.wanted(time);
  std::vector<std::array<char, 33>> wanted(keys.size());
  for (size_t i = 0; i < keys.size(); ++i) keys[i].copy(wanted[i].data(), 32);
  sample.wanted._buffer = reinterpret_cast<char (*)[33]>(wanted.data());
  sample.wanted._length = sample.wanted._maximum = static_cast<uint32_t>(wanted.size());
  if (!room_->status.writer.write(sample)) next_status_ = time + 0.05;
}

// After a lapse DDS may leave a site without what it had: what it says it holds is compared with what was written.
void Bridge::heal(double time) {
  constexpr double recent = 5, patience = 2.5;  // s
  if (digests_.empty() || digests_.back().second != outgoing_.digest()) digests_.emplace_back(time, outgoing_.digest());
  while (digests_.size() > 1 && digests_[1].first < time - recent) digests_.pop_front();
  for (auto& [name, site] : incoming_.sites()) {
    for (const std::string& key : std::exchange(site.wanted, {})) outgoing_.contents().write_again(key);
    if (!site.is_known) continue;
    const auto is_it = [&](const auto& entry) { return entry.second == site.held.digest; };
    if (std::any_of(digests_.begin(), digests_.end(), is_it) || !outgoing_.is_written()) {
      missing_since_.erase(name);
      continue;
    }
    const auto [since, is_new] = missing_since_.try_emplace(name, time);
    if (is_new || time - since->second < patience) continue;
    say("site " + name + " has missed something; all objects are written again");
    outgoing_.write_again();
    missing_since_.clear();
    return;
  }
}

// Where one way between two sites is gone for longer than the 10 s after which DDS gives a participant up, and the way back is not,
// one site has given up the other, which has not noticed. With keys Cyclone DDS 0.10 never mends that: the one begins a handshake,
// to which the other does not answer as it takes it for done. But it knows somebody new at once, so the other joins anew.
void Bridge::look_for_deaf_sites(double time) {
  constexpr double patience = 15;  // s: a site that has died is given up before
  const bool is_silent = room_->status.reader.has_silent_writers();
  if (!is_silent) silent_since_ = -1;
  if (is_silent && silent_since_ < 0) silent_since_ = time;
  // With a third site in the room what it says may come although it has given up this one.
  std::erase_if(deaf_since_, [&](const auto& entry) { return !incoming_.find(entry.first); });
  for (const auto& [name, site] : incoming_.sites()) {
    if (!site.is_known || text_of(site.held.site) == options_.site) {
      deaf_since_.erase(name);
    } else {
      deaf_since_.try_emplace(name, time);
    }
  }
  const bool is_deaf =
      std::any_of(deaf_since_.begin(), deaf_since_.end(), [&](const auto& e) { return time - e.second > patience; });
  if (silent_since_ < 0 && deaf_since_.empty()) join_wait_ = 30;
  const bool is_given_up = is_deaf || (is_silent && time - silent_since_ > patience);
  if (!is_given_up || time < next_join_) return;
  next_join_ = time + join_wait_;
  join_wait_ *= 2;
  join_again();
}

// The objects of all sites fade here, and this one's there, until they have found each other again.
void Bridge::join_again() {
  say("another site does not hear this one any more: joins the room anew");
  incoming_.forget_sites();
  ros_.reset();
  room_.reset();
  participant_.join_again();
  room_.emplace(participant_);
  open_ros();
  outgoing_.write_again();
  outgoing_.contents().write_all_again();
  deaf_since_.clear();
  missing_since_.clear();
  silent_since_ = -1;
  next_status_ = 0;
}

// Takes everything back, so that it fades at once and not when the lease is over.
void Bridge::leave() {
  outgoing_.forget(now());
  for (int i = 0; i < 100 && !outgoing_.is_written(); ++i) {
    outgoing_.write(now());
    usleep(10000);
  }
  forceserver_Status sample{};
  put_text(sample.site, options_.site);
  sample.session = session_;
  room_->status.writer.dispose(sample);
  room_->objects.writer.wait_for_readers(0.5);
  room_->status.writer.wait_for_readers(0.2);
}

}  // namespace bridge
