#include "flight.h"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <memory>
#include <stdexcept>

namespace {

double length(const fs_vec3& v) { return std::hypot(v.x, v.y, v.z); }

double quantile(std::vector<double> values, double part) {
  if (values.empty()) return 0;
  const auto place = values.begin() + std::ptrdiff_t(part * double(values.size() - 1));
  std::nth_element(values.begin(), place, values.end());
  return *place;
}

// A file to write; it throws when something fails.
class File {
 public:
  explicit File(const std::string& path) : path_(path), file_(std::fopen(path.c_str(), "w"), &std::fclose) {
    if (!file_) throw std::runtime_error("cannot write " + path);
  }
  FILE* get() { return file_.get(); }
  void finish() {
    const bool failed = std::ferror(file_.get()) != 0;
    if (std::fclose(file_.release()) != 0 || failed) throw std::runtime_error("cannot write " + path_);
  }

 private:
  std::string path_;
  std::unique_ptr<FILE, int (*)(FILE*)> file_;
};

}  // namespace

bool Flight::watch(double seconds, Beat& beat) {
  const bool terminal = isatty(STDOUT_FILENO);
  const double line_period = terminal ? 0.2 : 5, fetch_period = 0.5;
  double next_line = line_period, next_fetch = fetch_period;
  bool goes_on = true;
  const auto start = std::chrono::steady_clock::now();
  for (double before = 0; before < seconds;) {
    goes_on = beat.wait(0.01);
    if (!goes_on) break;
    const double time = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    sample(time, time - before);
    before = time;
    if (time >= next_fetch) {
      fetch_ticks();
      next_fetch += fetch_period;
    }
    if (time >= next_line) {
      print_line(time);
      next_line += line_period;
    }
  }
  fetch_ticks();
  check(fs_scene_get_servo_stats(scene_, &stats_));
  if (terminal) std::printf("\r\033[K");
  return goes_on;
}

void Flight::sample(double time, double period) {
  std::size_t count = 0;
  check(fs_scene_get_reports(scene_, nullptr, 0, &count));
  reports_.resize(count);
  check(fs_scene_get_reports(scene_, reports_.data(), count, &count));
  fs_pose rover = {};
  find_rover(scene_, rover_, &rover);
  fs_state hand;
  check(fs_scene_get_hand(scene_, &hand, nullptr, nullptr));
  Sample& sample = samples_.emplace_back(Sample{time, hand.pose.position, {}});
  for (const fs_report& report : reports_) {
    felt_[report.name].add(report.wrench.force, rover, period);
    sample.force[report.name] = length(report.wrench.force);
  }
}

// The servo keeps the ticks of the last two seconds: adds the new ones.
void Flight::fetch_ticks() {
  std::vector<fs_tick> recent(100000);
  std::size_t count = 0;
  check(fs_servo_get_record(servo_, recent.data(), recent.size(), &count));
  recent.resize(count);
  for (const fs_tick& tick : recent) {
    if (ticks_.empty() || tick.state.time > ticks_.back().state.time) ticks_.push_back(tick);
  }
}

void Flight::print_line(double time) const {
  const bool terminal = isatty(STDOUT_FILENO);
  fs_wrench sent;
  check(fs_scene_get_hand(scene_, nullptr, nullptr, &sent));
  std::printf("%s%5.1f s   the hand feels %4.2f N:", terminal ? "\r\033[K" : "", time, length(sent.force));
  for (const fs_report& report : reports_) {
    const double force = length(report.wrench.force);
    if (force > 0.01) std::printf("   %s %.2f", report.name, force);
  }
  std::printf(terminal ? "" : "\n");
  std::fflush(stdout);
}

void Flight::print_table() const {
  std::printf("\n%-18s %10s %10s %10s %10s %10s %10s\n", "who pushed", "felt, s", "mean, N", "most, N", "sideways", "forward",
              "up");
  for (const auto& [name, felt] : felt_) {
    std::printf("%-18s %10.1f %10.2f %10.2f %10.2f %10.2f %10.2f\n", name.c_str(), felt.seconds, felt.mean(felt.sum), felt.most,
                felt.mean(felt.sideways), felt.mean(felt.forward), felt.mean(felt.up));
  }
  std::printf(
      "sideways, forward, up: the mean size of the force along the rover's axles, ahead of it and up from the ground, N\n");
  std::vector<double> late, compute;
  double step = 0;
  for (std::size_t i = 0; i < ticks_.size(); ++i) {
    late.push_back(ticks_[i].late * 1e6);
    compute.push_back(ticks_[i].compute * 1e6);
    if (i == 0) continue;
    const fs_vec3 a = ticks_[i - 1].sent.force, b = ticks_[i].sent.force;
    step = std::max(step, length({b.x - a.x, b.y - a.y, b.z - a.z}));
  }
  std::printf("\n%-18s %10s %10s %10s\n", "the servo", "p50", "p99", "max");
  for (const auto& [name, us] : {std::pair("late, us", late), std::pair("compute, us", compute)}) {
    std::printf("%-18s %10.1f %10.1f %10.1f\n", name, quantile(us, 0.5), quantile(us, 0.99), quantile(us, 1));
  }
  const char* granted[] = {"none: ordinary scheduling", "a raised nice value", "real-time scheduling (FIFO)",
                           "real-time scheduling (FIFO), memory locked"};
  std::printf("rate %.1f Hz, %llu ticks, %llu missed; worst step in force from one tick to the next %.3f N\n", stats_.rate,
              (unsigned long long)stats_.ticks, (unsigned long long)stats_.misses, step);
  std::printf("priority granted by the system: %s\n", granted[stats_.realtime]);
  const char* protections[] = {"limit of the change in force",
                               "limit of the hand's speed",
                               "limit of the slope",
                               "local damping",
                               "ramp at the start",
                               "fading in and out",
                               "blending of moves"};
  std::string off;
  for (int bit = 0; bit < 7; ++bit) {
    if (stats_.protections_off >> bit & 1) off += (off.empty() ? "" : ", ") + std::string(protections[bit]);
  }
  std::printf("protections switched off: %s\n", off.empty() ? "none" : off.c_str());
}

void Flight::write_ticks(const std::string& path) const {
  File file(path);
  std::fprintf(file.get(), "time,x,y,z,fx,fy,fz,late,compute\n");
  for (const fs_tick& t : ticks_) {
    const fs_vec3 &x = t.state.pose.position, &f = t.sent.force;
    std::fprintf(file.get(), "%.6f,%.7g,%.7g,%.7g,%.5g,%.5g,%.5g,%.7f,%.7f\n", t.state.time, x.x + 0.0, x.y + 0.0, x.z + 0.0,
                 f.x + 0.0, f.y + 0.0, f.z + 0.0, t.late, t.compute);  // + 0.0: no -0
  }
  file.finish();
  std::printf("every tick of it: %s\n", path.c_str());
}

void Flight::write_samples(const std::string& path) const {
  File file(path);
  std::fprintf(file.get(), "time,x,y,z");
  for (const auto& [name, felt] : felt_) std::fprintf(file.get(), ",%s", name.c_str());
  for (const auto& [time, hand, force] : samples_) {
    std::fprintf(file.get(), "\n%.3f,%.1f,%.1f,%.1f", time, hand.x, hand.y, hand.z);
    for (const auto& [name, felt] : felt_) std::fprintf(file.get(), ",%.4f", force.contains(name) ? force.at(name) : 0);
  }
  std::fprintf(file.get(), "\n");
  file.finish();
  std::printf("the force of each object: %s\n", path.c_str());
}

void Flight::require_all_felt() const {
  for (const auto& [name, felt] : felt_) {
    if (felt.seconds == 0) throw std::runtime_error(name + " was never felt");
  }
}

void Flight::require_no_fault() const {
  for (const fs_tick& tick : ticks_) {
    if (tick.faults) throw std::runtime_error("the servo stopped the force: fault " + std::to_string(tick.faults));
  }
  if (stats_.faults) throw std::runtime_error("the servo ended with fault " + std::to_string(stats_.faults));
}
