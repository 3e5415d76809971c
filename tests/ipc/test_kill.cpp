// Clients are killed at any moment, again and again: their objects fade, the force of another client is not disturbed,
// their names are free at once, and nothing of them remains.
#include <sys/ptrace.h>

#include <deque>

#include "ipc/case.h"
#include "ipc/victim.h"
#include "ipc/watch.h"

using namespace life;
using namespace scenes;

constexpr int standard_kills = is_sanitized ? 20 : 60;
constexpr double fade = 0.1, lease = 0.02;      // s, of those that are killed at any moment
constexpr double client_limit = 2;              // N
constexpr double device_limit = 3;              // N: some victims together come to more
constexpr double honest_step = 0.002;           // N, at a tick at most
constexpr size_t growth_limit = 64'000'000;     // bytes; less than what some hundred scenes or meshes take

static int kills = standard_kills;
static uint64_t seed = 1;

// --------------------------------------------------------------------------------------------------- the honest client

// Pushes with 1 N in a direction that rotates; each rotation waits until the one before is felt. Its thread checks with
// `is_good` alone, as Check is for the main thread.
class Honest {
 public:
  explicit Honest(const std::string& endpoint) : scene_(connect(endpoint, "honest")) {
    set_prey();
    turn();
    expect(PATIENTLY(fs_object_set(scene_.get(), &push_)), "set");
    expect(PATIENTLY(fs_scene_sync(scene_.get(), long_enough)), "sync");
    eventually([this] { return is_felt(); });
    complaint_.clear();
  }
  ~Honest() { stop(); }

  void start() { thread_ = std::thread([this] { run(); }); }
  void stop() {
    is_over_ = true;
    if (thread_.joinable()) thread_.join();
  }
  uint64_t turns() const { return turns_; }
  std::string complaint() {
    const std::lock_guard lock(mutex_);
    return complaint_;
  }

 private:
  void expect(bool is_good, const std::string& what) {
    const std::lock_guard lock(mutex_);
    if (!is_good && complaint_.empty()) complaint_ = what;
  }
  void expect(fs_status status, const char* call) {
    expect(status == FS_OK, std::string(call) + ": " + fs_status_name(status) + ": " + fs_last_error());
  }

  void turn() {
    before_ = wanted_;
    angle_ += honest_step;
    wanted_ = {std::cos(angle_), std::sin(angle_), 0};
    push_ = push("push", 1, wanted_);
  }
  // An object that the victims may change; it is not felt.
  void set_prey() {
    fs_object prey = fs_object_init("prey", FS_PRIMITIVE_PLANE);
    expect(PATIENTLY(fs_object_set(scene_.get(), &prey)), "set");
  }

  bool is_felt() {
    fs_response response;
    expect(PATIENTLY(fs_scene_get_hand(scene_.get(), nullptr, &response, nullptr)), "hand");
    const fs_vec3 force = response.wrench.force;
    const bool is_there = norm(force - wanted_) < 1e-9;
    expect(is_there || norm(force - before_) < 1e-9, "its force is another: " + std::to_string(norm(force)) + " N");
    return is_there;
  }

  void run() {
    wanted_ = {std::cos(angle_), std::sin(angle_), 0};
    const fs_twist still{};
    for (; !is_over_ && complaint().empty(); ++turns_) {
      turn();
      expect(PATIENTLY(fs_object_move(scene_.get(), "push", &push_.pose, &still, FS_NOW)), "move");
      expect(eventually([this] { return is_felt(); }), "its move is not felt");
      if (turns_ % 16) continue;
      set_prey();
      expect(PATIENTLY(fs_scene_sync(scene_.get(), long_enough)), "sync");
      size_t count = 0;
      expect(PATIENTLY(fs_scene_get_clients(scene_.get(), nullptr, 0, &count)), "clients");
      expect(PATIENTLY(fs_scene_get_reports(scene_.get(), nullptr, 0, &count)), "reports");
      expect(PATIENTLY(fs_scene_get_motions(scene_.get(), nullptr, nullptr, 0, &count)), "motions");
      for (fs_event event{}; fs_scene_next_event(scene_.get(), 0, &event) == FS_OK && event.kind != FS_EVENT_NONE;) {
        expect(event.kind == FS_EVENT_EDITED || event.kind == FS_EVENT_READY || event.kind == FS_EVENT_DEVICE ||
                   event.kind == FS_EVENT_OVERFLOW,
               "event " + std::to_string(event.kind) + ": " + event.text);
      }
    }
  }

  Scene scene_;
  fs_object push_;
  fs_vec3 wanted_{}, before_{};
  double angle_ = 0;
  std::atomic<uint64_t> turns_{0};
  std::atomic<bool> is_over_{false};
  std::mutex mutex_;
  std::string complaint_;
  std::thread thread_;
};

// --------------------------------------------------------------------------------------------------- the force's steps

// Each tick's change of the force that all scenes have together, against what it may be: everything of those who are
// there, or not yet faded out, may be on its way in or out, both as an object and as a client that is gone
// (`fades_at_once`). Who is there at a tick is known when the next victim is in, so ticks are judged later.
class Steps {
 public:
  explicit Steps(fs_servo* servo) : watch_(servo) { watch_.skip(); }

  void look() {
    watch_.look([this](const fs_tick& tick, const fs_tick* before) {
      check_tick(tick, device_limit);
      if (!before) return;
      steps_.push_back({tick.state.time, tick.state.time - before->state.time,
                        norm(tick.response.wrench.force - before->response.wrench.force)});
    });
  }

  // A victim that began at `begin` is connected: so the one before it with the same name is known to be gone, and
  // fades.
  void add_victim(double begin, double now) {
    if (!victims_.empty()) victims_.back().end = now + lease + fade;
    victims_.push_back({begin, never});
    judge(now);
  }
  void end() { judge(never); }

  const Watch& watch() const { return watch_; }
  double largest() const { return largest_; }             // N per ms
  double largest_share() const { return largest_share_; }  // of what was allowed
  double most_allowed() const { return most_allowed_; }    // N per ms

 private:
  static constexpr double never = 1e300, fades_at_once = 2;
  struct Step {
    double time, elapsed, size;  // s, s, N
  };
  struct Victim {
    double begin, end;  // s
  };

  void judge(double until) {
    for (; !steps_.empty() && steps_.front().time <= until; steps_.pop_front()) {
      const Step& step = steps_.front();
      std::erase_if(victims_, [&](const Victim& victim) { return victim.end < step.time - step.elapsed; });
      const auto there = std::count_if(victims_.begin(), victims_.end(),
                                       [&](const Victim& victim) { return victim.begin <= step.time; });
      const double faded = fades_at_once * victim_force * static_cast<double>(there) / fade * step.elapsed;
      const double allowed = faded + honest_step + 1e-4;
      ck_assert_msg(step.size <= allowed, "the force steps by %g N within %g ms, %g N are allowed (%d victims)",
                    step.size, 1e3 * step.elapsed, allowed, static_cast<int>(there));
      const double ms = std::fmax(1, 1e3 * step.elapsed);
      largest_ = std::fmax(largest_, step.size / ms);
      if (there) largest_share_ = std::fmax(largest_share_, step.size / allowed);
      most_allowed_ = std::fmax(most_allowed_, allowed / ms);
    }
  }

  Watch watch_;
  std::deque<Step> steps_;
  std::vector<Victim> victims_;
  double largest_ = 0, largest_share_ = 0, most_allowed_ = 0;
};

// ----------------------------------------------------------------------------------------------------------- the place

// A server with an honest client; nothing of any other client may remain.
struct Place {
  ServerRig rig;
  Honest honest;
  Holdings before;

  Place(double the_lease, double the_fade)
      : rig(server_options(the_lease), servo_options(the_fade)), honest(rig.endpoint) {
    const fs_object prey = fs_object_init("prey", FS_PRIMITIVE_PLANE);
    OK(fs_object_set(rig.base.get(), &prey));
    before = holdings();
    honest.start();
    ++before.threads;
  }

  double now() { return scenes::now(rig.base.get()); }
  void check_honest(const std::string& victim) {
    const std::string complaint = honest.complaint();
    ck_assert_msg(complaint.empty(), "%s; the honest client: %s", victim.c_str(), complaint.c_str());
  }
  void end() {
    Holdings after;
    ck_assert_msg(eventually([&] { return (after = holdings()) == before; }), "before: %s; after: %s",
                  to_text(before).c_str(), to_text(after).c_str());
    ck_assert_uint_gt(honest.turns(), 0);
    honest.stop();
    check_honest("at the end");
  }

 private:
  static fs_server_options server_options(double the_lease) {
    fs_server_options options = fs_server_options_init();
    options.force_limit = client_limit;
    options.lease = the_lease;
    options.max_clients = 4096;  // as many scenes fade out at a time when a victim does nothing but come and go
    return options;
  }
  static fs_servo_options servo_options(double the_fade) {
    fs_servo_options options = world_options();
    options.mode = FS_SERVO_THREAD;
    options.fade = the_fade;
    options.force_limit = device_limit;
    return options;
  }
};

// ------------------------------------------------------------------------------------------------------- at any moment

START_TEST(kill_at_any_moment) {
  Place place(lease, fade);
  Steps steps(place.rig.servo.get());
  Random random(seed);
  std::vector<size_t> memory(static_cast<size_t>(kills));
  int unborn = 0, stopped = 0;
  const double start = place.now();
  for (int k = 0; k < kills; ++k) {
    const char* work = victim_works[random.below(std::size(victim_works))];
    const double begin = place.now();
    Process victim({"--victim", place.rig.endpoint, "victim", work, std::to_string(random.bits())});
    std::string line = "killed before it said anything";
    const bool waits = random.coin(0.85);
    if (waits) {
      const bool is_heard = victim.hear(line, 30);
      ck_assert_msg(is_heard && line == "connected", "kill %d: a victim that %s: %s", k, work, line.c_str());
      steps.add_victim(begin, place.now());
      wait_a_little(random.log_between(1e-4, 0.03));
    } else {  // still connecting: it has set nothing yet
      wait_a_little(random.log_between(1e-4, 0.005));
      ++unborn;
    }
    if (random.coin(0.3)) {  // it stops in the middle of something, and never goes on
      victim.send(SIGSTOP);
      wait_a_little(random.log_between(1e-4, 0.02));
      ++stopped;
    }
    victim.send(SIGKILL);
    const int status = victim.wait();
    ck_assert_msg(!victim.hear(line, 0) || (!waits && line == "connected"), "kill %d: a victim that %s: %s", k, work,
                  line.c_str());
    ck_assert_msg(WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL, "kill %d: a victim that %s ended by itself", k,
                  work);
    if (k % 4 == 3 || k + 1 == kills) steps.look();
    place.check_honest("kill " + std::to_string(k) + ", of one that " + work);
    memory[static_cast<size_t>(k)] = resident_bytes();
  }
  const double duration = place.now() - start;
  place.end();
  steps.look();
  steps.end();
  ck_assert_uint_eq(steps.watch().gaps(), 0);

  const auto mean = [&](int first, int last) {
    size_t sum = 0;
    for (int i = first; i < last; ++i) sum += memory[static_cast<size_t>(i)];
    return sum / static_cast<size_t>(std::max(1, last - first));
  };
  const size_t early = mean(0, kills / 4), late = mean(3 * kills / 4, kills);
  std::printf("  %d kills in %.1f s: %d before they had connected, %d that stood still\n", kills, duration, unborn,
              stopped);
  std::printf("  %lu ticks (%lu of them stopped, the machine being too slow), %lu moves of the honest client felt\n",
              static_cast<unsigned long>(steps.watch().ticks()), static_cast<unsigned long>(steps.watch().late()),
              static_cast<unsigned long>(place.honest.turns()));
  std::printf("  largest step %.4f N per ms; up to %.4f were allowed, and no step had more than %.0f %% of its own\n",
              steps.largest(), steps.most_allowed(), 100 * steps.largest_share());
  std::printf("  %.1f MB resident in the first quarter, %.1f MB in the last; %s\n", 1e-6 * static_cast<double>(early),
              1e-6 * static_cast<double>(late), to_text(place.before).c_str());
  ck_assert_msg(is_sanitized || late < early + growth_limit, "%zu bytes resident at first, %zu at last", early, late);
}
END_TEST

// --------------------------------------------------------------------------------------- at each write and system call

// A victim stops before the first of its writes into shared memory, the next before the second, and so on: in the
// middle of where an object is, and of a group that belongs together. The server waits for none of them, and takes
// nothing by halves.
START_TEST(stop_at_each_write) {
  Place place(0.005, 0.01);
  Watch watch(place.rig.servo.get());
  watch.skip();
  const double up = 3 * flip_force, one_over = flip_force, all_over = -3 * flip_force;  // N
  std::vector<int> seen(3);
  fs_tick last{};
  const auto look = [&] {
    watch.look([&](const fs_tick& tick, const fs_tick*) {
      check_tick(tick, device_limit);
      const fs_vec3 force = tick.response.wrench.force;
      EXPECT_NEAR(std::hypot(force.x, force.y), 1, 1e-9);  // the honest client's
      last = tick;
    });
    return last.response.wrench.force.z;
  };
  bool is_over = false;
  for (int number = 1; !is_over; number += is_sanitized ? 7 : times(5, 1)) {
    Process victim({"--writes", place.rig.endpoint, "writer", std::to_string(number)});
    std::string line = "nothing";
    victim.hear(line);
    if (line == "unsupported") {
      std::printf("  SKIPPED, as a process cannot stop itself at a write here\n");
      break;
    }
    ck_assert_str_eq(line.c_str(), "connected");
    ck_assert(eventually([&] { return std::fabs(look() - up) < 1e-9; }));
    victim.say("go");
    int status = 0;
    ck_assert(eventually([&] {
      is_over = victim.hear(line, 0);
      return is_over || (waitpid(victim.id(), &status, WUNTRACED | WNOHANG) == victim.id() && WIFSTOPPED(status));
    }));
    // While the victim is stopped, the honest client is felt as before, and each step of the victim has taken effect as
    // a whole or not at all.
    const uint64_t turns = place.honest.turns();
    ck_assert(eventually([&] {
      look();
      return place.honest.turns() > turns + 2;
    }));
    wait_a_little(0.003);
    const double force = look();
    const double wanted[] = {up, one_over, all_over};
    const auto found = std::find_if(wanted, wanted + 3, [&](double f) { return std::fabs(force - f) < 1e-9; });
    ck_assert_msg(found != wanted + 3, "write %d: a force of %g N", number, force);
    ++seen[static_cast<size_t>(found - wanted)];
    ck_assert(!is_over || found == wanted + 2);
    victim.kill_it();
    ck_assert(eventually([&] { return look() == 0; }));
    place.check_honest("write " + std::to_string(number));
  }
  place.end();
  std::printf("  %d that stopped at a write: %d before the first move counted, %d before the group did, %d after it\n",
              seen[0] + seen[1] + seen[2], seen[0], seen[1], seen[2]);
}
END_TEST

// One victim is killed as it begins or ends its first system call, the next one at its second, and so on: connecting,
// sending, requesting.
START_TEST(kill_at_each_system_call) {
  Place place(0.005, 0.01);
  bool is_over = false;
  int killed = 0;
  for (int number = 1; !is_over; number += is_sanitized ? 11 : 1) {
    Process victim({"--calls", place.rig.endpoint, "caller"});
    int status = 0;
    for (int i = 0; i <= number; ++i) {  // the first time it stops itself
      ck_assert_int_eq(waitpid(victim.id(), &status, __WALL), victim.id());
      if (!WIFSTOPPED(status)) break;
      if (i == 0) ptrace(PTRACE_SETOPTIONS, victim.id(), nullptr, PTRACE_O_EXITKILL);
      if (i < number) ptrace(PTRACE_SYSCALL, victim.id(), nullptr, nullptr);
    }
    is_over = !WIFSTOPPED(status);
    std::string line = "nothing";
    if (is_over) {
      victim.forget();
      victim.hear(line, 0);
      if (line == "unsupported") {
        std::printf("  SKIPPED, as a process cannot be traced here\n");
        break;
      }
      ck_assert_msg(WIFEXITED(status) && WEXITSTATUS(status) == 0, "system call %d: %s", number, line.c_str());
    } else {
      victim.kill_it();
      ++killed;
    }
    place.check_honest("system call " + std::to_string(number));
  }
  place.end();
  std::printf("  %d killed at the beginning or end of a system call\n", killed);
}
END_TEST

static int show_help() {
  std::printf(
      "test_kill [--kills N] [--seed N]\n"
      "Kills N clients (%d) of a server at any moment, and checks each tick of its servo, a client that goes on, and\n"
      "that nothing remains. A hundred take one to three seconds.\n",
      standard_kills);
  return EXIT_FAILURE;
}

int main(int count, char** arguments) {
  const std::string first = count > 1 ? arguments[1] : "";
  if (first == "--victim") return be_a_victim(count, arguments);
  if (first == "--writes") return be_a_writer(count, arguments);
  if (first == "--calls") return be_a_caller(count, arguments);
  for (int i = 1; i < count; i += 2) {
    const std::string key = arguments[i];
    if (i + 1 == count || (key != "--kills" && key != "--seed")) return show_help();
    const unsigned long long value = std::strtoull(arguments[i + 1], nullptr, 10);
    if (key == "--kills") kills = static_cast<int>(value);
    if (key == "--seed") seed = value;
  }
  if (kills < 1) return show_help();
  Suite* suite = suite_create("kill");
  TCase* test_case = life::new_case(suite, "kill");
  tcase_set_timeout(test_case, 120 + 0.5 * kills);
  tcase_add_test(test_case, kill_at_any_moment);
  tcase_add_test(test_case, stop_at_each_write);
  tcase_add_test(test_case, kill_at_each_system_call);
  return run_suite(suite);
}
