// forceserver run: runs a scene on a device, until the time is over or Ctrl-C.
#include <poll.h>
#include <signal.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <limits>
#include <map>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "chatter.h"
#include "device_words.h"
#include "ending.h"
#include "look.h"
#include "program.h"
#include "words.h"

namespace {

using Clock = std::chrono::steady_clock;
using Seconds = std::chrono::duration<double>;

// Brings the ticks of a servo. The servo keeps those of two seconds, so fetch() must be called more often.
class NewTicks {
 public:
  const std::vector<fs_tick>& fetch(const Scene& scene) {  // those since the last call
    ticks_.clear();
    for (const fs_recorded_tick& recorded : scene.get_record(last_)) {
      gaps_ += recorded.number != last_ + 1;
      last_ = recorded.number;
      ticks_.push_back(recorded.tick);
    }
    return ticks_;
  }
  int gaps() const { return gaps_; }

 private:
  std::vector<fs_tick> ticks_;
  std::uint64_t last_ = 0;
  int gaps_ = 0;
};

// Writes every tick as a line of a file.
class Record {
 public:
  explicit Record(const std::string& path) : path_(path), file_(std::fopen(path.c_str(), "w")) {
    if (!file_) fail();
    std::fputs(
        "time,x,y,z,qw,qx,qy,qz,fx,fy,fz,sent_fx,sent_fy,sent_fz,late,compute,faults,tx,ty,tz,"
        "sent_tx,sent_ty,sent_tz,buttons\n",
        file_);
  }
  Record(const Record&) = delete;
  Record& operator=(const Record&) = delete;
  ~Record() { std::fclose(file_); }

  void write(std::span<const fs_tick> ticks) {
    for (const fs_tick& tick : ticks) {
      const fs_vec3& x = tick.state.pose.position;
      const fs_quat& q = tick.state.pose.orientation;
      const auto& [f, t] = tick.response.wrench;
      const auto& [sent_f, sent_t] = tick.sent;
      std::fprintf(file_, "%.9f", tick.state.time);
      write({x.x, x.y, x.z, q.w, q.x, q.y, q.z, f.x, f.y, f.z, sent_f.x, sent_f.y, sent_f.z, tick.late, tick.compute});
      std::fprintf(file_, ",%u", tick.faults);
      write({t.x, t.y, t.z, sent_t.x, sent_t.y, sent_t.z});
      std::fprintf(file_, ",%u\n", tick.state.buttons);
    }
    if (std::fflush(file_) != 0 || std::ferror(file_)) fail();
  }

 private:
  void write(std::initializer_list<double> columns) {
    for (const double value : columns) std::fprintf(file_, ",%.9g", value + 0.0);  // + 0.0: no -0
  }
  [[noreturn]] void fail() const { throw std::runtime_error("cannot write " + path_ + ": " + std::strerror(errno)); }

  std::string path_;
  FILE* file_;
};

std::string protection_names(std::uint32_t off) {
  const std::pair<std::uint32_t, const char*> all[] = {{FS_OFF_SLEW, "limit of the change in force"},
                                                       {FS_OFF_SPEED, "limit of the hand's speed"},
                                                       {FS_OFF_STIFFNESS, "limit of the slope"},
                                                       {FS_OFF_DAMPING, "local damping"},
                                                       {FS_OFF_RAMP, "ramp at the start"},
                                                       {FS_OFF_FADE, "fading in and out"},
                                                       {FS_OFF_BLEND, "blending of moves"}};
  std::vector<std::string> names;
  for (const auto& [bit, name] : all) {
    if (off & bit) names.push_back(name);
  }
  return join(names, "none");
}

const char* realtime_name(fs_realtime realtime) {
  switch (realtime) {
    case FS_REALTIME_FIFO_LOCKED: return "real-time priority (FIFO) and locked memory";
    case FS_REALTIME_FIFO: return "real-time priority (FIFO), memory not locked";
    case FS_REALTIME_NICE: return "a better nice value, no real-time priority";
    default: return "nothing: an ordinary thread, which the system may keep waiting (forceserver doctor tells how to grant more)";
  }
}

const char* const nothing = "nothing";

// The objects that are felt most, with their forces.
std::string felt(const Scene& scene) {
  std::vector<fs_report> reports = scene.get_reports();
  std::sort(reports.begin(), reports.end(),
            [](const fs_report& a, const fs_report& b) { return length(a.wrench.force) > length(b.wrench.force); });
  std::vector<std::string> names;
  for (const fs_report& report : reports) {
    const double force = length(report.wrench.force);
    if (force < 0.01 || names.size() == 3) break;
    names.push_back(format("%s %.2f N", report.name, force));
  }
  return join(names, nothing);
}

// Which object shakes the hand: the one whose force changed most in the last swings; where none did, the nearest.
class Culprit {
 public:
  // To be called every few hundredths of a second.
  void add(const std::vector<fs_report>& reports) {
    std::map<std::string, Felt> felt;
    for (const fs_report& report : reports) {
      const fs_vec3& f = report.wrench.force;
      const auto before = felt_.find(report.name);
      double change = 0;
      if (before != felt_.end()) {
        const fs_vec3& was = before->second.force;
        change = std::max(length({f.x - was.x, f.y - was.y, f.z - was.z}), fading * before->second.change);
      }
      felt[report.name] = {f, change};
    }
    felt_ = std::move(felt);
  }

  std::string describe(const std::vector<fs_report>& reports) const {
    const auto strongest = std::max_element(felt_.begin(), felt_.end(),
                                            [](const auto& a, const auto& b) { return a.second.change < b.second.change; });
    if (strongest != felt_.end() && strongest->second.change > 0.01) {
      return format("changes most: %s, by %.2f N", strongest->first.c_str(), strongest->second.change);
    }
    const auto nearest = std::min_element(reports.begin(), reports.end(),
                                          [](const fs_report& a, const fs_report& b) { return a.distance < b.distance; });
    if (nearest != reports.end() && std::isfinite(nearest->distance)) {
      return format("nearest: %s, %.1f mm away", nearest->name, nearest->distance * 1e3);
    }
    return "no object of this scene is near";
  }

 private:
  struct Felt {
    fs_vec3 force;  // N, at the last call
    double change;  // N, the largest between two calls; one that is long ago counts for less
  };
  static constexpr double fading = 0.9;  // of a remembered change, from one call to the next
  std::map<std::string, Felt> felt_;
};

// Says that the hand chatters when it begins to, and again every 5 s as long as it goes on.
class ChatterReport {
 public:
  void add(const Scene& scene, std::span<const fs_tick> ticks, double time, bool terminal) {  // time: s
    const std::vector<fs_report> reports = scene.get_reports();
    culprit_.add(reports);
    const std::optional<Chatter::Swing> swing = chatter_.add(ticks);
    if (!swing || time < next_) return;
    next_ = time + 5;
    any_ = true;
    const fs_vec3& x = swing->place;
    std::printf(
        "%s%.1f s  the hand chatters: %.0f times a second, %.2g mm from end to end, about (%.0f, %.0f, %.0f) "
        "mm of the device; %s\n",
        terminal ? "\r\033[K" : "", time, swing->frequency, swing->size * 1e3, std::round(x.x * 1e3) + 0.0,
        std::round(x.y * 1e3) + 0.0, std::round(x.z * 1e3) + 0.0, culprit_.describe(reports).c_str());
    std::fflush(stdout);
  }
  bool any() const { return any_; }

 private:
  Chatter chatter_;
  Culprit culprit_;
  double next_ = 0;  // s
  bool any_ = false;
};

// What events tell. Bounds of slopes can change 20 times a second while many objects share: they are told once a second.
class News {
 public:
  // listen: as print_line has it.
  News(const Scene& scene, const std::string& listen, bool terminal)
      : scene_(scene), return_(listen.empty() ? "start again" : how_to_resume(listen)), terminal_(terminal) {}

  // Prints the events since the last call. time: s.
  void print(double time) {
    for (fs_event event; next(event);) {
      if (event.kind == FS_EVENT_CAPPED) bounds_[event.name] = event.text;
      if (event.kind == FS_EVENT_EXPIRED) say("%s: outlived its lifetime", event.name);
      if (event.kind == FS_EVENT_EDITED) say("%s: edited by %s", event.name, event.text);
      if (event.kind == FS_EVENT_DEVICE) tell_device(event);
      if (event.kind == FS_EVENT_CLIENT) say("client %s (process %.0f) %s", event.name, event.value, event.text);
      if (event.kind == FS_EVENT_OVERFLOW) say("%.0f older events were dropped", event.value);
    }
    if (time >= next_bounds_) tell_bounds(time);
    std::fflush(stdout);
  }
  std::uint32_t faults() const { return faults_; }  // that events told of

 private:
  bool next(fs_event& event) {
    event = scene_.next_event(0);
    return event.kind != FS_EVENT_NONE;
  }

  template <class... Values>
  void say(const char* form, Values... values) {
    std::printf("%s%s\n", terminal_ ? "\r\033[K" : "", format(form, values...).c_str());
  }
  void say(const char* text) { say("%s", text); }

  void tell_device(const fs_event& event) {
    if (event.status == FS_OK) return say("the device is ready");
    const auto bits = std::uint32_t(event.value);
    faults_ |= bits;
    const std::string what_helps = bits & FS_FAULT_DEVICE ? "" : "; " + return_;
    say("the force stopped: %s%s", stop_reason(event).c_str(), what_helps.c_str());
  }

  void tell_bounds(double time) {
    if (bounds_.empty()) return;
    next_bounds_ = time + 1;
    constexpr std::size_t most = 3;
    std::size_t count = 0;
    for (const auto& [name, text] : bounds_) {
      if (++count > most) break;
      say("%s: %s", name.c_str(), text.c_str());
    }
    if (count > most) say("... and bounds of %zu more objects have changed", bounds_.size() - most);
    bounds_.clear();
  }

  const Scene& scene_;
  std::string return_;  // how the force returns after a fault that stays
  bool terminal_;
  std::map<std::string, std::string> bounds_;  // by the name of the object, what is to be told
  double next_bounds_ = 0;                     // s
  std::uint32_t faults_ = 0;
};

// listen: the server's name; empty: none. asks: a person can press Enter.
void print_line(const Scene& scene, double time, const std::string& listen, bool asks, bool terminal) {
  const fs_servo_stats stats = scene.get_servo_stats();
  fs_wrench sent;
  scene.get_hand(nullptr, nullptr, &sent);
  std::string line = format("%.1f s  %.0f Hz, late by %.0f us (p99), force %.2f N; felt%s: ", time, stats.rate,
                            stats.late_p99 * 1e6, length(sent.force), !listen.empty() ? " of its own objects" : "") +
                     felt(scene);
  if (line.ends_with(nothing) && length(sent.force) > 0.05) {
    line += listen.empty()
                ? "; the servo damps the hand a little"
                : "; the force is that of clients' objects or of the servo's damping, see: forceserver watch " + listen;
  }
  if (stats.faults) line += "; STOPPED: " + fault_names(stats.faults);
  if (!stats.enabled) {
    line += std::string("; a client stopped the force: ") + (asks ? "Enter, or " : "") + how_to_resume(listen);
  }
  winsize window{};
  if (terminal && ioctl(STDOUT_FILENO, TIOCGWINSZ, &window) == 0 && window.ws_col > 1) {
    line = fit(line, window.ws_col - 1u);  // it must not wrap
  }
  std::printf(terminal ? "\r\033[K%s" : "%s\n", line.c_str());
  std::fflush(stdout);
}

// Lets the force return when a person presses Enter, after a client has ended it.
void enable_on_enter(fs_servo* servo, const fs_servo_stats& stats) {
  if (tcgetpgrp(STDIN_FILENO) != getpgrp()) return;  // in the background reading would stop the process
  pollfd input{STDIN_FILENO, POLLIN, 0};
  if (poll(&input, 1, 0) <= 0 || !(input.revents & POLLIN)) return;
  char line[256];
  if (read(STDIN_FILENO, line, sizeof line) <= 0 || stats.enabled) return;
  if (fs_servo_set_enabled(servo, true) == FS_OK) std::printf("\r\033[Kthe force returns, as Enter was pressed\n");
}

void print_summary(const fs_servo_stats& s, double seconds, std::uint32_t faults) {
  using Count = unsigned long long;
  std::printf("%llu ticks in %.1f s: %.1f Hz; %llu missed, %llu with a device error\n", Count(s.ticks), seconds,
              double(s.ticks) / seconds, Count(s.misses), Count(s.device_errors));
  std::printf("late    p50 %.0f us, p99 %.0f us, max %.0f us (last 10 s)\n", s.late_p50 * 1e6, s.late_p99 * 1e6,
              s.late_max * 1e6);
  std::printf("compute p50 %.1f us, p99 %.1f us, max %.1f us\n", s.compute_p50 * 1e6, s.compute_p99 * 1e6, s.compute_max * 1e6);
  if (std::isfinite(s.max_stiffness)) std::printf("slopes up to %.0f N/m, ", s.max_stiffness);
  std::printf("local damping %.1f N s/m, energy given to the hand %.3g J; ", s.damping, s.energy);
  if (s.guarded == 0 && faults) std::printf("there was no force that a limit, a fault or a stop could change\n");
  else if (s.guarded == 0) std::printf("no force was changed by a limit, a fault or a stop\n");
  else std::printf("a limit, a fault or a stop changed the force of %llu ticks\n", Count(s.guarded));
  std::printf("faults: %s\n", fault_names(faults).c_str());
  std::printf("the system granted: %s\n", realtime_name(s.realtime));
  std::printf("protections switched off: %s\n", protection_names(s.protections_off).c_str());
}

}  // namespace

int run(const RunOptions& options) {
  const bool terminal = isatty(STDOUT_FILENO);
  load_driver(options.driver);
  const Scene scene = Scene::create();
  if (!options.scene.empty()) scene.load(options.scene);
  signal(SIGXFSZ, SIG_IGN);  // a record that becomes too large is told like a full disk
  std::unique_ptr<Record> record;
  if (!options.record.empty()) record = std::make_unique<Record>(options.record);

  std::optional<Ending> ending;  // until the device is closed
  const Device device = Device::open(options.device);
  const fs_device_info info = device.get_info();
  fs_servo_options servo_options = fs_servo_options_init();
  servo_options.rate = options.rate;
  servo_options.force_limit = options.force_limit;
  ending.emplace();  // before this line nothing is felt, and a signal ends the program at once
  const Servo servo = Servo::start(scene, device, &servo_options);
  Server server;
  if (!options.listen.empty()) {
    fs_server_options server_options = fs_server_options_init();
    server_options.locked = options.locked;
    server_options.all_users = options.all_users;
    server_options.no_stop = options.no_stop;
    server_options.force_limit = options.client_force;
    server_options.max_clients = options.max_clients;
    server_options.max_objects = options.max_objects;
    try {
      server = Server::start(servo, full_endpoint(options.listen), &server_options);
    } catch (const Error& failure) {  // name the option of the command line instead of the field
      const bool is_force = options.client_force > 0 && std::string_view(failure.what()).starts_with("force_limit");
      if (is_force) throw std::runtime_error(std::string("--client-force: ") + failure.what());
      throw;
    }
  }
  std::printf("%s (%s), at most %g N%s\n", info.name, options.device.c_str(),
              options.force_limit > 0 ? std::min(options.force_limit, info.force_max) : info.force_max,
              options.duration > 0 ? "" : "; Ctrl-C ends");
  if (!(info.mass > 0)) {
    std::printf("the device does not tell its mass: 0.05 kg is assumed, which bounds slopes and damping\n");
  }
  if (info.watchdog < 0) std::printf("the device has no watchdog: %s\n", no_watchdog);
  if (server) std::printf("listens at %s\n", full_endpoint(options.listen).c_str());
  std::fflush(stdout);

  const bool asks = isatty(STDIN_FILENO);  // a person is there
  const auto start = Clock::now();
  const double sample = 0.1, line_period = terminal ? 0.2 : 5;
  double next_line = line_period;
  std::uint32_t faults = 0;
  bool record_failed = false;
  NewTicks ticks;
  ChatterReport chatter;
  News news(scene, options.listen, terminal);
  for (bool over = false; !over;) {
    double elapsed = Seconds(Clock::now() - start).count();
    const double left = options.duration > 0 ? options.duration - elapsed : sample;
    over = left <= 0 || ending->wait(std::min(left, sample));
    elapsed = Seconds(Clock::now() - start).count();
    // No event tells of a device that was not ready from the start, and the statistics do not tell of a fault that is over.
    const fs_servo_stats now = scene.get_servo_stats();
    news.print(elapsed);
    faults |= now.faults | news.faults();
    if (asks) enable_on_enter(servo.get(), now);
    const std::vector<fs_tick>& fresh = ticks.fetch(scene);
    chatter.add(scene, fresh, elapsed, terminal);
    if (record) {
      try {
        record->write(fresh);
      } catch (const std::exception& error) {  // a full disk must not end the force
        std::fprintf(stderr, "forceserver: %s; the run goes on without the record\n", error.what());
        record.reset();
        record_failed = true;
      }
    }
    if (elapsed >= next_line) {
      print_line(scene, elapsed, options.listen, asks, terminal);
      next_line += line_period;
    }
  }
  const fs_servo_stats stats = scene.get_servo_stats();
  news.print(std::numeric_limits<double>::infinity());
  faults |= stats.faults | news.faults();
  fs_servo_set_enabled(servo.get(), false);
  try {
    if (record) record->write(ticks.fetch(scene));  // the last ticks that the summary counts
  } catch (const std::exception& error) {
    std::fprintf(stderr, "forceserver: %s; the record is not complete\n", error.what());
    record_failed = true;
  }
  if (terminal) std::printf("\r\033[K");
  print_summary(stats, Seconds(Clock::now() - start).count(), faults);
  if (record && ticks.gaps() > 0) std::printf("the record has %d gaps: this machine was too slow\n", ticks.gaps());
  if (record_failed) return exit_failed;
  return faults || chatter.any() ? exit_odd : exit_fine;
}
