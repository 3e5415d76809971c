// forceserver hello-device: the first touch of a device that nobody has felt yet, step by step, with a small force. It finds
// axes, signs and scales that are wrong.
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdlib>
#include <random>
#include <utility>

#include "chatter.h"
#include "device_steps.h"
#include "directions.h"
#include "person.h"
#include "words.h"

namespace {

constexpr double ramp = 0.3;  // s, in which a push grows and ends
constexpr double largest_step = 0.02;  // of a push, from one command to the next
constexpr double hold = 3;  // s, in which a push stays when nobody answers
constexpr double servo_time = 60;  // s, the longest step with a servo
constexpr double ball_radius = 0.03;  // m
constexpr double run_away = 0.04;  // m, the handle in a push, which ends then
constexpr double longest_pause = 0.5;  // s without a state, after which a step is over

// The rest of a step cannot be done.
struct StepOver {
  std::string why;
};

// At its end the force of the device is 0.
class PushEnd {
 public:
  explicit PushEnd(const Device& device) : device_(device) {}
  PushEnd(const PushEnd&) = delete;
  PushEnd& operator=(const PushEnd&) = delete;
  ~PushEnd() {
    const fs_wrench none{};
    fs_device_write(device_.get(), &none);
  }

 private:
  const Device& device_;
};

// A name for the report that no file has yet: hello-sim-1.md, hello-sim-1-2.md and so on.
std::string free_name(const std::string& uri, const std::string& serial) {
  std::string name = "hello-" + uri.substr(0, uri.find(':')) + (serial.empty() ? "" : "-") + serial;
  for (char& c : name) {
    if (!std::isalnum(static_cast<unsigned char>(c)) && c != '.' && c != '-') c = '_';
  }
  std::string path = name + ".md";
  for (int number = 2; access(path.c_str(), F_OK) == 0; ++number) path = format("%s-%d.md", name.c_str(), number);
  return path;
}

// mm, of an answer such as "48" or "48mm"; "" gives 0: it was not measured.
std::optional<double> typed_distance(const std::string& line) {
  if (line.empty()) return 0;
  char* end = nullptr;
  const double value = std::strtod(line.c_str(), &end);
  const std::string unit = end;
  if (!(value >= 5 && value <= 1000) || (!unit.empty() && unit != "mm")) return std::nullopt;
  return value;
}

bool wait_a_moment() {
  sleep_for(1e-3);
  return true;
}

class Hello {
 public:
  explicit Hello(const HelloDeviceOptions& options) : options_(options) {}

  int run() {
    open();
    try {
      if (make_ready(page_, device_, options_.requests, options_.wait)) steps();
      else page_.note(Verdict::odd, "the steps at the handle were not tried, as the device is not ready");
    } catch (const GivenUp&) {
      page_.note(Verdict::odd, "the person gave up here");
    } catch (const Interrupted&) {
      page_.note(Verdict::odd, "it was interrupted here; the force is 0");
    } catch (const Error& failure) {
      page_.note(Verdict::failed, std::string("the device failed here: ") + failure.what());
    }
    device_.reset();
    page_.finish();
    const std::string cause = likely_cause(moves_, pushes_, scales_);
    if (!cause.empty()) page_.text(cause);
    Person::tell("\nThe report is in " + path_ + ".");
    return page_.has(Verdict::failed) || page_.has(Verdict::odd) ? exit_odd : exit_fine;
  }

 private:
  void open() {
    device_ = Device::open(options_.uri);
    info_ = device_.get_info();
    force_ = options_.force > 0 ? options_.force : std::min(1.0, info_.force_max);
    if (info_.force_axes > 0 && force_ > info_.force_max) {
      throw std::runtime_error(format("--force is %g N, and the device gives %g N at most", force_, info_.force_max));
    }
    path_ = options_.report.empty() ? free_name(options_.uri, info_.serial) : options_.report;
    page_.write_report(path_);
    page_.title("The first touch of the device " + options_.uri);
    describe_machine(page_, options_.uri);
    describe_device(page_, device_);
  }

  void steps() {
    step("The pose", [&] { test_pose(); });
    step("The buttons", [&] { test_buttons(); });
    if (info_.force_axes == 0) {
      page_.heading("The force");
      page_.leave_out("not tried", "the device has no force");
      return;
    }
    const ForceEnding ending;
    try {
      step(format("A force of %g N along each axis", force_), [&] { test_force(ending); });
      if (pushes_.size() < 2 * info_.force_axes) {
        page_.heading("A soft ball, and the stop");
        page_.leave_out("not tried", "the force along each axis was not tried before");
      } else if (may_be_rendered(moves_, pushes_) && scales_.empty()) {
        step(format("A soft ball of %g N", force_), [&] { test_ball(ending); });
        step("The stop", [&] { test_stop(ending); });
      } else {
        page_.heading("A soft ball, and the stop");
        page_.leave_out("not tried", "the poses or the forces are wrong, so what a servo renders may push anywhere");
      }
    } catch (...) {
      device_.reset();  // its force is 0 before a signal counts again
      throw;
    }
  }

  template <class Function>
  void step(const std::string& heading, Function f) {
    page_.heading(heading);
    try {
      f();
    } catch (const Skipped&) {
      page_.leave_out("skipped", "by the person");
    } catch (const StepOver& over) {
      page_.note(Verdict::failed, over.why);
    }
  }

  fs_vec3 position(const char* during) const {
    for (const double begin = now();; sleep_for(1e-3)) {
      const Place place = fresh_place(device_, info_);
      if (place.position) return *place.position;
      if (now() - begin > longest_pause) throw StepOver{format("%s: %s", during, place.why.c_str())};
    }
  }

  void test_pose() {
    for (int axis = 0; axis < 3; ++axis) test_move({axis, 1});
  }

  void test_move(const Direction& asked) {
    const auto is_enter = [](const std::string& line) { return line.empty(); };
    person_.ask("Hold the handle in the middle of its workspace, then press Enter.", "Enter: it is there", is_enter,
                wait_a_moment);
    const fs_vec3 start = position("the pose");
    const std::string way = words_for(asked);
    const std::optional<std::string> answer = person_.ask(
        format("Move the handle %s by about 50 mm, then press Enter.", way.c_str()),
        "Enter: it is there; or a number: by how many mm, as a ruler shows it, 5 to 1000",
        [](const std::string& line) { return typed_distance(line).has_value(); }, wait_a_moment);
    judge_move(asked, minus(position("the pose"), start), *typed_distance(*answer) / 1e3);
  }

  // told: m, by a ruler; 0: not measured.
  void judge_move(const Direction& asked, const fs_vec3& moved, double told) {
    const std::string way = "a move " + words_for(asked) + ": the pose ";
    const double scale = length(moved) / (told > 0 ? told : 0.05);
    if (scale < 0.01) {
      page_.note(Verdict::failed, way + format("hardly moves (%.3f mm)", length(moved) * 1e3));
      moves_.push_back({asked, std::nullopt});
      return;
    }
    const std::optional<Direction> got = direction_of(moved);
    if (!got) {
      page_.note(Verdict::odd,
                 way + format("went by %.1f, %.1f, %.1f mm, along no single axis", moved.x * 1e3, moved.y * 1e3, moved.z * 1e3));
      return;
    }
    moves_.push_back({asked, got});
    const bool is_scale_right = told > 0 ? std::fabs(scale - 1) <= 0.1 : scale >= 0.5 && scale <= 2;
    if (!is_scale_right) scales_.push_back(scale);
    std::vector<std::string> wrong;
    if (got->axis != asked.axis) {
      const auto [first, second] = std::minmax(asked.axis, got->axis);
      wrong.push_back(format("%c and %c are exchanged", "xyz"[first], "xyz"[second]));
    }
    if (got->sign != asked.sign) wrong.push_back(got->axis == asked.axis ? "its sign is wrong" : "and a sign is wrong");
    if (!is_scale_right) wrong.push_back(format("its scale is wrong by a factor of %.3g", scale));
    page_.expect(wrong.empty(), Verdict::failed,
                 way + format("went along %s by %.3g mm", name_of(*got).c_str(), length(moved) * 1e3) +
                     (wrong.empty() ? "" : ": " + join(wrong, "")));
  }

  void test_buttons() {
    std::uint32_t seen = 0;
    person_.ask(
        "Press each button once, then Enter.", "Enter: done, or there is no button",
        [](const std::string& line) { return line.empty(); },
        [&] {
          seen |= device_.read().buttons;
          return wait_a_moment();
        });
    std::vector<std::string> numbers;
    for (int i = 0; i < 32; ++i) {
      if (seen >> i & 1) numbers.push_back(std::to_string(i));
    }
    page_.figure("seen", join(numbers, "none"));
  }

  // Each direction once, in an order that the person cannot know.
  void test_force(const ForceEnding& ending) {
    std::vector<Direction> directions;
    for (int axis = 0; axis < static_cast<int>(info_.force_axes); ++axis)
      directions.insert(directions.end(), {{axis, 1}, {axis, -1}});
    std::shuffle(directions.begin(), directions.end(), std::mt19937(std::random_device()()));
    Person::tell("Hold the handle loosely in the middle of its workspace.");
    for (const Direction& direction : directions) test_direction(direction, ending);
  }

  void test_direction(const Direction& asked, const ForceEnding& ending) {
    Push push = push_once(asked, ending);
    while (push.answer == 'p') push = push_once(asked, ending);
    const std::optional<Direction> felt = direction_of(push.answer);
    pushes_.push_back({asked, felt});
    const std::optional<Direction> went = length(push.moved) > 2e-3 ? direction_of(push.moved) : std::nullopt;
    const std::string pose = went ? format("the pose goes along %s by %.1f mm", name_of(*went).c_str(), length(push.moved) * 1e3)
                                  : "the pose hardly moves";
    const bool is_pose_right = !went || *went == asked;
    if (felt == asked && !is_pose_right) moves_.push_back({asked, went});
    const std::string does = felt == asked ? "does" : felt ? "pushes " + words_for(*felt) : "is not felt";
    page_.expect(felt == asked && is_pose_right, Verdict::failed,
                 format("a force along %s should push %s: it %s, %s %s", name_of(asked).c_str(), words_for(asked).c_str(),
                        does.c_str(), went && (felt == asked) != is_pose_right ? "but" : "and", pose.c_str()));
  }

  struct Push {
    char answer;
    fs_vec3 moved;  // m, until the force began to end
  };

  // The force grows, stays until the person has answered, for 3 s at most, and ends. While no state comes there is no force; then it grows
  // again.
  Push push_once(const Direction& direction, const ForceEnding& ending) {
    const PushEnd end(device_);
    const fs_vec3 start = position("not pushed");
    fs_vec3 moved{};
    double seen = now(), part = 0;
    const auto give = [&](double wanted) {
      const Place place = fresh_place(device_, info_);
      if (place.position) seen = now(), moved = minus(*place.position, start), part = wanted;
      else part = 0;
      if (now() - seen > longest_pause) throw StepOver{"the push was ended: " + place.why};
      device_.write({vector_of(direction, force_ * part), {}});
      ending.pause(1e-3);
    };
    const char* const help = "r right, l left, a away, t towards you, u up, d down, n nothing, p push again";
    const double begin = now();
    std::optional<char> answer = person_.ask_letter("Which way does it push?", help, "rlatudnp", [&] {
      give(std::min({1.0, (now() - begin) / ramp, part + largest_step}));
      return length(moved) < run_away && now() - begin < ramp + hold;
    });
    const fs_vec3 went = moved;
    if (length(went) >= run_away) part = 0;  // it ends at once
    for (double over = now(), t = 0; t < ramp; t = now() - over) give(std::min(part, 1 - t / ramp));
    device_.write({});
    if (!answer) {
      const std::string why =
          length(went) < run_away ? format("after %g s", hold) : format("as the handle ran %g mm away", run_away * 1e3);
      answer = person_.ask_letter("The push has ended " + why + ". Which way was it?", help, "rlatudnp",
                                  [&] { return ending.pause(1e-3), true; });
    }
    wait_for_rest(device_, ending);
    return {*answer, went};
  }

  // A ball in the middle of the workspace, and the servo that renders it; what happens meanwhile.
  class Ball {
   public:
    Ball(const Device& device, double force, const ForceEnding& ending) : ending_(ending) {
      fs_object ball = fs_object_init("ball", FS_PRIMITIVE_POINT);
      ball.front = fs_profile_init(FS_PROFILE_LINEAR_DECREASING, FS_SENSE_REPULSIVE, -force / ball_radius, force, force);
      scene_.object_set(ball);
      fs_servo_options options = fs_servo_options_init();
      options.force_limit = force;
      servo_ = Servo::start(scene_, device, &options);
    }

    // A moment of the ball. False: its time is over.
    bool go_on() {
      ending_.pause(0.01);
      std::vector<fs_tick> ticks;
      for (const fs_recorded_tick& recorded : scene_.get_record(last_)) {
        last_ = recorded.number;
        ticks.push_back(recorded.tick);
      }
      if (const std::optional<Chatter::Swing> swing = chatter_.add(ticks)) swing_ = swing;
      const std::uint32_t faults = scene_.get_servo_stats().faults;
      if (faults) throw StepOver{"the servo ended the force: " + fault_names(faults)};
      return now() - begin_ < servo_time;
    }
    double sent() const {  // N, at the last tick
      fs_wrench wrench{};
      scene_.get_hand(nullptr, nullptr, &wrench);
      return length(wrench.force);
    }
    bool pushes() const {  // the ball itself, not only the damping of the servo
      fs_response response{};
      scene_.get_hand(nullptr, &response, nullptr);
      return length(response.wrench.force) > 0.05 && sent() > 0;
    }
    const Scene& scene() const { return scene_; }
    const std::optional<Chatter::Swing>& swing() const { return swing_; }

   private:
    const ForceEnding& ending_;
    Scene scene_ = Scene::create();
    Servo servo_;
    Chatter chatter_;
    std::optional<Chatter::Swing> swing_;  // the last
    uint64_t last_ = 0;  // number of the last tick that was looked at
    double begin_ = now();  // s
  };

  void test_ball(const ForceEnding& ending) {
    Ball ball(device_, force_, ending);
    const std::optional<char> answer =
        person_.ask_letter("Touch the ball of 30 mm in radius in the middle of the workspace: is it there, round, and quiet?",
                           "y yes, n no, t it trembles", "ynt", [&] { return ball.go_on(); });
    const fs_servo_stats stats = ball.scene().get_servo_stats();
    page_.figure("rendered", format("at most %.0f N/m, for a delay of %.3f ms", stats.max_stiffness, stats.delay * 1e3));
    const auto& swing = ball.swing();
    page_.expect(!swing, Verdict::odd,
                 swing ? format("the hand chatters: %.0f times a second, %.2g mm from end to end", swing->frequency,
                                swing->size * 1e3)
                       : "the hand does not chatter");
    if (!answer) return page_.note(Verdict::odd, "the ball: no answer in time; the force has ended");
    page_.expect(answer == 'y', Verdict::failed,
                 std::string("the ball is there, round, and quiet") + (answer == 'y'   ? ""
                                                                       : answer == 't' ? ": it trembles"
                                                                                       : ": it is not"));
  }

  void test_stop(const ForceEnding& ending) {
    Ball ball(device_, force_, ending);
    const auto is_pushed = [&](const std::string& line) { return line.empty() && ball.pushes(); };
    const std::optional<std::string> enter =
        person_.ask("Go into the ball, so that it pushes, and press Enter there: the force must end at once.",
                    "Enter while you feel it push", is_pushed, [&] { return ball.go_on(); });
    if (!enter) return page_.note(Verdict::odd, "the stop: Enter was not pressed in the ball in time; the force has ended");
    const double begin = now();
    ball.scene().stop_force();
    while (ball.sent() > 0 && now() - begin < 1) sleep_for(1e-4);
    const double taken = now() - begin;
    page_.expect(taken < 0.05, Verdict::failed,
                 format("the force that is sent is 0 soon after the stop: after %.1f ms", taken * 1e3));
    const std::optional<char> answer = person_.ask_letter("Is there no force any more?", "y none, n there still is", "yn",
                                                          [&] { return ending.pause(1e-3), true; });
    page_.expect(answer == 'y', Verdict::failed,
                 std::string("after the stop there is no force") + (answer == 'y' ? "" : ": the person still feels one"));
  }

  const HelloDeviceOptions& options_;
  DevicePage page_;
  Device device_;
  Person person_;
  fs_device_info info_ = fs_device_info_init();
  double force_ = 0;  // N
  std::string path_;  // of the report
  std::vector<Trial> moves_, pushes_;
  std::vector<double> scales_;  // of the poses, as likely_cause takes them
};

}  // namespace

int hello_device(const HelloDeviceOptions& options) {
  load_driver(options.driver);
  return Hello(options).run();
}
