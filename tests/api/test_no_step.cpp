// No step in force, whatever is called in whatever order, from whatever thread, by whatever client.
//
// A servo keeps a weight from 0 to 1 for each version of a name (primitive, shape, points of the tool), for each view
// of a scene (frame, tool, clutch) and for each scene in it. A tick moves a weight by `period / fade` at most, called
// a share here. With F the force of a name in full, the hand at rest, one tick may change
// - for each name that changes, its two versions, the one that goes and the one that comes: 2 F shares. They may be
//   seen from two views, but the weights of these add up to 1 at most, as one goes while the other comes;
// - for each scene whose view changes, its two views: 2 shares of the sum of the F of all its names, as the weights of
//   the versions of a name add up to 1 at most;
// - for each scene that comes or goes: a share of the sum of the F of all its names.
// A weight changes only for a while after a call (memory_of_a_call); when nothing changes, the force is the same. A
// hand that moves adds the sum of all slopes times its way.
//
// The end of a client that takes too long acts at once; nothing here does that. Nothing is blended here either: a version
// of a name has one pose and one profile for good. test_blend changes these.
#include <malloc.h>
#include <sched.h>
#include <sys/resource.h>
#include <sys/syscall.h>

#include <array>
#include <csignal>
#include <mutex>

#include "api/world.h"

using namespace scenes;

namespace {

constexpr double period = 1e-3;      // s
constexpr double lifetime = 0.03;    // s, of the objects that have one

uint64_t ticks_of(double seconds) { return static_cast<uint64_t>(seconds / period + 0.5); }
// Ticks in which a call can still move a weight: what goes, what waited for it, and the end of a lifetime.
uint64_t memory_of_a_call(double fade) { return ticks_of(3 * fade + lifetime) + 5; }

fs_servo_options options_with(double fade) {
  fs_servo_options options = virtual_options();
  options.fade = fade;
  options.ramp = options.speed_limit = -1;
  return options;
}

// Compares each force that the device gets with the previous one.
class Watch {
 public:
  Watch(FakeDevice& fake, double slope = 0) : fake_(fake), slope_(slope) {
    const std::lock_guard lock(fake.mutex);
    force_ = fake.written.force;
    hand_ = fake.state.pose.position;
    fake.on_write = [this](FakeDevice& f) { look(f); };
  }
  ~Watch() {
    const std::lock_guard lock(fake_.mutex);
    fake_.on_write = nullptr;
  }
  Watch(const Watch&) = delete;
  Watch& operator=(const Watch&) = delete;

  void allow(double newtons) {  // a tick, from now on
    const std::lock_guard lock(fake_.mutex);
    allowed_ = newtons;
  }

  struct Step {
    double size = 0, allowed = 0;  // N
    uint64_t tick = 0;
  };
  // The step that exceeds the allowed one most; size 0: none does.
  Step worst() const {
    const std::lock_guard lock(fake_.mutex);
    return worst_;
  }
  void expect_none(const char* where) const {
    const Step step = worst();
    ck_assert_msg(step.size == 0, "%s: %llu of %llu ticks change the force by more than is allowed; tick %llu by %g N, "
                  "%g are allowed", where, static_cast<unsigned long long>(above_),
                  static_cast<unsigned long long>(ticks_), static_cast<unsigned long long>(step.tick), step.size,
                  step.allowed);
  }
  uint64_t ticks() const {
    const std::lock_guard lock(fake_.mutex);
    return ticks_;
  }

 private:
  void look(const FakeDevice& f) {
    ++ticks_;
    const fs_vec3 force = f.written.force, hand = f.state.pose.position;
    const double size = norm(force - force_);
    const double allowed = (allowed_ + slope_ * norm(hand - hand_)) * (1 + 1e-6) + 1e-9;
    if (!(size <= allowed)) {
      ++above_;
      if (worst_.size == 0 || size - allowed > worst_.size - worst_.allowed) worst_ = {size, allowed, ticks_};
    }
    force_ = force;
    hand_ = hand;
  }

  FakeDevice& fake_;
  const double slope_;  // N/m
  double allowed_ = 0;
  fs_vec3 force_{}, hand_{};
  Step worst_;
  uint64_t ticks_ = 0, above_ = 0;
};

// ---- What is felt: of each name `versions` versions, which push a hand at the origin hither and thither.

constexpr size_t versions = 9;
constexpr double slope_of_a_newton = 100;  // N/m: a name of force F has the slope 100 F and the limit F

struct Shapes {
  Shape line, other_line, sheet, box;
  Shapes() {
    const fs_vec3 ends[2]{{-1, 0, 0}, {1, 0, 0}}, other_ends[2]{{0.1, -1, 0}, {0.1, 1, 0}};
    line = make_polyline(ends, 2, false);
    other_line = make_polyline(other_ends, 2, false);
    const fs_vec3 corners[4]{{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}};
    const uint32_t triangles[6]{0, 1, 2, 0, 2, 3};
    fs_shape* made = nullptr;
    require(fs_shape_create_mesh(corners, 4, triangles, 2, &made), "fs_shape_create_mesh");
    sheet = Shape(made);
    box = make_mesh(box_mesh({0.03, 0.03, 0.03}));
  }
};
const Shapes& shapes() {
  static const Shapes all;
  return all;
}

struct Name {
  std::string name;
  double force;         // N, at most
  bool is_smooth;       // its slope is bounded: for a hand that moves
  size_t version = 0;   // the one to set
};

fs_object version_of(const Name& name, size_t version) {
  const size_t axis = std::hash<std::string>()(name.name) % 3;
  const fs_vec3 e = axis == 0 ? fs_vec3{1, 0, 0} : axis == 1 ? fs_vec3{0, 1, 0} : fs_vec3{0, 0, 1};
  fs_object o = fs_object_init(name.name.c_str(), FS_PRIMITIVE_POINT);
  const auto place = [&](fs_vec3 x) { require(fs_pose_from_z(x, e, &o.pose), "fs_pose_from_z"); };
  const auto shape = [&](fs_primitive primitive, const Shape& s) {
    o.primitive = primitive;
    o.shape = s.get();
  };
  switch (version) {
    case 0: place(0.012 * e); break;
    case 1: place(-0.007 * e); shape(FS_PRIMITIVE_POLYLINE, shapes().line); break;
    case 2: place(0.004 * e); o.primitive = FS_PRIMITIVE_PLANE; break;
    case 3: place(-0.01 * e); shape(FS_PRIMITIVE_POLYLINE, shapes().other_line); break;
    case 4: place(-0.006 * e); shape(FS_PRIMITIVE_MESH, shapes().sheet); break;
    case 5: place(0.05 * e); shape(FS_PRIMITIVE_MESH, shapes().box); break;
    case 6: place(-0.012 * e); o.tool_points = 2; break;
    case 7: place(-0.02 * e); o.tool_points = 3; break;
    default: place(-0.005 * e); o.primitive = FS_PRIMITIVE_PLANE; o.tool_points = 1; break;
  }
  o.front = name.is_smooth || version % 3 == 0 ? attract(slope_of_a_newton * name.force, name.force)
                                               : constant(FS_SENSE_ATTRACTIVE, name.force);
  if (o.primitive == FS_PRIMITIVE_PLANE || version == 4) o.back = o.front;
  return o;
}

// What a run may do besides setting, disabling and removing.
struct Kinds {
  bool versions, views, groups, lifetimes;

  explicit Kinds(uint64_t seed) {
    Random random(seed);
    versions = random.coin(0.7);
    views = random.coin();
    groups = random.coin(0.6);
    lifetimes = random.coin(0.4);
  }
  std::string text() const {
    return std::string(versions ? "versions, " : "") + (views ? "views, " : "") + (groups ? "groups, " : "") +
           (lifetimes ? "lifetimes, " : "");
  }
};

// Changes a scene at random, and knows how far that may change the force.
class Actor {
 public:
  Actor(fs_scene* scene, std::vector<Name> names, const Kinds& kinds, double fade, uint64_t seed)
      : names_(std::move(names)), until_(names_.size(), 0), in_group_(names_.size(), false), kinds_(kinds), fade_(fade),
        scene_(scene), random_(seed) {
    for (Name& name : names_) name.version = random_.below(versions);
  }

  // How far the following ticks may change the force, N, while the scene itself neither comes nor goes.
  double allowed(uint64_t tick) const {
    double sum = 0;
    for (size_t i = 0; i < names_.size(); ++i) sum += until_[i] > tick ? rows() * names_[i].force : 0;
    if (view_until_ > tick) sum += 2 * force();
    return sum * period / fade_;
  }
  double most_allowed() const { return (rows() + (kinds_.views ? 2 : 0)) * force() * period / fade_; }
  double force() const {  // of all names
    double sum = 0;
    for (const Name& name : names_) sum += name.force;
    return sum;
  }
  const std::string& done() const { return done_; }
  void note_ticks(uint64_t ticks) { done_ += "[" + std::to_string(ticks) + "] "; }

  // One call. It may fail because another thread or client came before it.
  void act(uint64_t tick) {
    const uint64_t choice = random_.below(20);
    if (choice < 13) {
      act_on(random_.below(names_.size()), tick);
    } else if (choice < 16) {
      if (kinds_.views) change_view(tick);
    } else if (choice < 19) {
      if (kinds_.groups) group(tick);
    } else {
      done("clear", PATIENTLY(fs_scene_clear(scene_)));
      for (size_t i = 0; i < names_.size(); ++i) touch(i, tick);
    }
  }

  // Closes an open group, and puts the tool where the hand is.
  void come_to_rest(uint64_t tick) {
    if (has_group_) commit(tick);
    if (!kinds_.views) return;
    const fs_frame frame = fs_frame_init();
    const fs_vec3 point{};
    done("let go", PATIENTLY(fs_scene_set_clutch(scene_, false)));
    done("frame 0", PATIENTLY(fs_scene_set_frame(scene_, &frame)));
    done("tool 0", PATIENTLY(fs_scene_set_tool(scene_, &point, 1)));
    touch_view(tick);
  }

  bool shares_groups = false;  // with other threads: a group may be open already, or closed

 private:
  double rows() const { return kinds_.versions ? 2 : 1; }  // of a name, that change at a time

  void act_on(size_t i, uint64_t tick) {
    Name& name = names_[i];
    switch (random_.below(9)) {
      case 0: case 1: case 2:
        if (kinds_.versions) name.version = random_.below(versions);
        [[fallthrough]];
      case 3: {
        const fs_object o = object(name);
        done(("set " + name.name + std::to_string(name.version) + (o.enabled ? "" : "-off")).c_str(),
             PATIENTLY(fs_object_set(scene_, &o)));
        break;
      }
      case 4:  // to where it is: what has expired lives again
        if (kinds_.versions) break;  // a pose acts at once, also on the version that goes
        done(("move " + name.name).c_str(), move(name));
        break;
      case 5: case 6: {  // only parts that fit every version of the object
        constexpr uint32_t all = FS_PART_POSE | FS_PART_PROFILES | FS_PART_CONTACT | FS_PART_SHAPE | FS_PART_OTHER;
        if (kinds_.versions && random_.coin()) name.version = random_.below(versions);
        const fs_object o = object(name);
        done(("change " + name.name + std::to_string(name.version) + (o.enabled ? "" : "-off")).c_str(),
             PATIENTLY(fs_object_change(scene_, &o, kinds_.versions ? all : uint32_t{FS_PART_OTHER})));
        break;
      }
      default: done(("remove " + name.name).c_str(), PATIENTLY(fs_object_remove(scene_, name.name.c_str()))); break;
    }
    touch(i, tick);
  }
  fs_status move(const Name& name) {
    const fs_object o = version_of(name, name.version);
    const fs_twist still{};
    return fs_object_move(scene_, o.name, &o.pose, &still, FS_NOW);
  }
  // The version to set: enabled or not, with a lifetime or without.
  fs_object object(const Name& name) {
    fs_object o = version_of(name, name.version);
    o.enabled = random_.coin(0.8);
    if (kinds_.lifetimes && random_.coin(0.3)) o.lifetime = lifetime;
    return o;
  }

  void change_view(uint64_t tick) {
    switch (random_.below(4)) {
      case 0: {
        fs_frame frame = fs_frame_init();
        const uint64_t which = random_.below(5);
        if (which == 1) frame.pose.position = {0.02, 0, 0};
        if (which == 2) frame.pose.position = {0, -0.03, 0.01};
        if (which == 3) frame.pose.orientation = turn({1, 2, 3}, 1);
        if (which == 4) {
          frame.scale = 2;
          frame.force_scale = 0.5;  // so that a slope stays what it is
        }
        done(("frame " + std::to_string(which)).c_str(), PATIENTLY(fs_scene_set_frame(scene_, &frame)));
        break;
      }
      case 1: {
        const fs_vec3 points[3]{{0, 0, 0}, {0.005, 0, 0}, {0, 0.02, 0}};
        const uint64_t which = random_.below(3);
        done(("tool " + std::to_string(which)).c_str(),
             which == 0 ? fs_scene_set_tool(scene_, points, 1)
                        : which == 1 ? fs_scene_set_tool(scene_, points, 2) : fs_scene_set_tool(scene_, points + 2, 1));
        break;
      }
      case 2: done("hold", PATIENTLY(fs_scene_set_clutch(scene_, true))); break;
      default: done("let go", PATIENTLY(fs_scene_set_clutch(scene_, false))); break;
    }
    touch_view(tick);
  }

  void group(uint64_t tick) {
    if (!has_group_) {
      has_group_ = done("begin", PATIENTLY(fs_scene_begin(scene_))) == FS_OK;
    } else if (random_.coin(0.7)) {
      commit(tick);
    } else {  // nothing of it was or is felt
      done("cancel", PATIENTLY(fs_scene_cancel(scene_)));
      has_group_ = false;
      in_group_.assign(names_.size(), false);
      view_in_group_ = false;
    }
  }
  void commit(uint64_t tick) {
    done("commit", PATIENTLY(fs_scene_commit(scene_)));
    has_group_ = false;
    for (size_t i = 0; i < names_.size(); ++i) {
      if (in_group_[i]) touch(i, tick);
      in_group_[i] = false;
    }
    if (view_in_group_) touch_view(tick);
    view_in_group_ = false;
  }

  void touch(size_t i, uint64_t tick) {
    if (has_group_) {
      in_group_[i] = true;
    } else {
      until_[i] = tick + memory_of_a_call(fade_);
    }
  }
  void touch_view(uint64_t tick) {
    if (has_group_) {
      view_in_group_ = true;
    } else {
      view_until_ = tick + memory_of_a_call(fade_);
    }
  }

  fs_status done(const char* what, fs_status status) {
    const bool is_known =
        status == FS_OK || status == FS_ERROR_NOT_FOUND || (shares_groups && status == FS_ERROR_STATE);
    ck_assert_msg(is_known, "%s: %s: %s", what, fs_status_name(status), fs_last_error());
    done_ += what;
    done_ += status == FS_OK ? " " : "(failed) ";
    return status;
  }

  std::vector<Name> names_;
  std::vector<uint64_t> until_;  // for each name: the tick until which it may change
  std::vector<bool> in_group_;   // for each name: the open group has changed it
  uint64_t view_until_ = 0;
  bool view_in_group_ = false, has_group_ = false;
  const Kinds kinds_;
  const double fade_;
  fs_scene* scene_;
  Random random_;
  std::string done_;
};

// This number of names with forces of about a newton; several of them have distinct forces.
std::vector<Name> names_of(const std::string& prefix, size_t count, bool is_smooth) {
  std::vector<Name> names;
  for (size_t i = 0; i < count; ++i) {
    names.push_back({prefix + static_cast<char>('a' + i), 1 + 0.3 * static_cast<double>(i), is_smooth});
  }
  return names;
}

// The force of a scene's objects on a hand at x in the default frame, when nothing is fading.
fs_vec3 in_full(fs_scene* scene, fs_vec3 x) {
  const Tool tool = make_tool(scene);
  return force_at(tool.get(), x);
}

// Counts the runs with a step, and keeps the worst: all runs end before the test fails.
struct Findings {
  size_t runs = 0, with_step = 0;
  double worst = 0;  // as many times what is allowed
  std::string sentence;

  void add(const Watch::Step& step, const std::string& run) {
    ++runs;
    if (step.size == 0) return;
    ++with_step;
    if (step.size / step.allowed <= worst) return;
    worst = step.size / step.allowed;
    char text[200];
    std::snprintf(text, sizeof text, "a step of %g N, %g are allowed: ", step.size, step.allowed);
    sentence = text + run;
  }
  void expect_none() const {
    ck_assert_msg(with_step == 0, "%zu of %zu runs have a step; the worst: %s", with_step, runs, sentence.c_str());
  }
};

std::string described(uint64_t seed, const Kinds& kinds, double fade) {
  return "seed " + std::to_string(seed) + ", " + kinds.text() + "fade " + std::to_string(fade) + " s: ";
}

// ---- One thread: calls, and any number of ticks between them.

constexpr double fades[3]{0.02, 0.1, 0.2};  // s

// The hand: at rest, or about at 0.2 m/s within 2 cm.
void swing(FakeDevice& fake) {
  fake.on_read = [](FakeDevice& f, double time) {
    f.state.pose.position = {0.02 * std::sin(9 * time), 0.02 * std::sin(7 * time), 0.02 * std::sin(5 * time)};
  };
}

void one_thread(uint64_t seed, bool moves, Findings& findings) {
  const double fade = fades[seed % 3];
  const Kinds kinds(seed);
  ServoRig rig(options_with(fade));
  rig.step();
  if (moves) swing(rig.fake);
  std::vector<Name> names = names_of("", 1 + seed % 3, moves);
  Actor actor(rig.base.get(), names, kinds, fade, seed);
  Watch watch(rig.fake, moves ? slope_of_a_newton * actor.force() : 0);
  const auto ticks = [&](uint64_t count) {
    for (uint64_t i = 0; i < count; ++i) {
      watch.allow(actor.allowed(watch.ticks()));
      rig.step();
    }
    actor.note_ticks(count);
  };
  Random random(seed + 1000);
  for (int k = 0; k < 60; ++k) {
    actor.act(watch.ticks());
    const uint64_t lengths[]{0, 0, 1, 2, random.below(20), random.below(150)};
    ticks(lengths[random.below(6)]);
    if (watch.worst().size != 0) break;
  }
  actor.come_to_rest(watch.ticks());
  ticks(memory_of_a_call(fade));
  findings.add(watch.worst(), described(seed, kinds, fade) + actor.done());
  if (watch.worst().size != 0) return;
  EXPECT_VECTOR(rig.fake.written.force, in_full(rig.base.get(), rig.fake.state.pose.position), 1e-9);
}

constexpr uint64_t runs_a_seed = 30;

// ---- Several threads, which are delayed at random places.

std::atomic<int> microseconds_held{0};
void hold_up(int) {
  const timespec time{0, microseconds_held * 1000};
  nanosleep(&time, nullptr);
}

// Delays threads of this process as long as this object lives: wherever they are, for up to 3 ms.
class Holder {
 public:
  Holder(std::vector<pthread_t> threads, uint64_t seed) : threads_(std::move(threads)) {
    struct sigaction action {};
    action.sa_handler = hold_up;
    action.sa_flags = SA_RESTART;
    sigaction(SIGUSR1, &action, nullptr);
    thread_ = std::thread([this, seed] {
      Random random(seed);
      while (!is_done_) {
        microseconds_held = static_cast<int>(random.below(3000));
        pthread_kill(threads_[random.below(threads_.size())], SIGUSR1);
        wait_a_little(random.between(1e-5, 2e-3));
      }
    });
  }
  ~Holder() {
    is_done_ = true;
    thread_.join();
  }

 private:
  const std::vector<pthread_t> threads_;
  std::atomic<bool> is_done_{false};
  std::thread thread_;
};

// Ticks as long as this object lives, some 20,000 times a second.
class Ticks {
 public:
  explicit Ticks(fs_servo* servo) : thread_([this, servo] {
    while (!is_done_) {
      fs_servo_step(servo, 1);
      wait_a_little(1e-5);
    }
  }) {}
  ~Ticks() {
    is_done_ = true;
    thread_.join();
  }
  pthread_t id() { return thread_.native_handle(); }

 private:
  std::atomic<bool> is_done_{false};
  std::thread thread_;
};

void several_threads(uint64_t seed, Findings& findings) {
  constexpr double fade = 1;
  constexpr size_t count = 3;
  Kinds kinds(seed);
  kinds.lifetimes = false;  // in virtual time they would be over at once
  ServoRig rig(options_with(fade));
  rig.step();
  std::vector<std::unique_ptr<Actor>> actors;
  double allowed = 0, force = 0;
  for (size_t i = 0; i < count; ++i) {
    Kinds own = kinds;
    own.views = kinds.views && i == 0;
    const std::vector<Name> names = names_of(std::to_string(i), 1, false);
    actors.push_back(std::make_unique<Actor>(rig.base.get(), names, own, fade, 10 * seed + i));
    actors[i]->shares_groups = true;
    allowed += (kinds.versions ? 2 : 1) * actors[i]->force() * period / fade;
    force += actors[i]->force();
  }
  if (kinds.views) allowed += 2 * force * period / fade;
  Watch watch(rig.fake);
  watch.allow(allowed);
  {
    Ticks ticks(rig.servo.get());
    std::atomic<bool> is_done{false};
    std::vector<std::thread> threads;
    std::vector<pthread_t> ids{ticks.id()};
    for (size_t i = 0; i < count; ++i) {
      threads.emplace_back([&, i] {
        Random random(seed + i);
        for (int k = 0; k < (is_sanitized ? 500 : 1500); ++k) {
          actors[i]->act(0);
          if (random.coin(0.3)) wait_a_little(random.between(0, 1e-3));
        }
        while (!is_done) wait_a_little();  // until no one delays it any more
      });
      ids.push_back(threads.back().native_handle());
    }
    {
      const Holder holder(ids, seed);
      while (watch.ticks() < 1000) wait_a_little();
      wait_a_little(0.4);
    }
    is_done = true;
    for (std::thread& thread : threads) thread.join();
  }
  for (auto& actor : actors) actor->come_to_rest(0);
  rig.step(memory_of_a_call(fade));
  findings.add(watch.worst(), described(seed, kinds, fade));
  if (watch.worst().size == 0) EXPECT_VECTOR(rig.fake.written.force, in_full(rig.base.get(), {}), 1e-9);
}

// ---- Clients of a server that come, change, leave and come again.

struct Client {
  std::string name;
  Scene scene;
  std::unique_ptr<Actor> actor;
};

void clients(uint64_t seed, Findings& findings) {
  const double fade = fades[seed % 3];
  const bool leaves = seed % 4 > 1;
  const Kinds kinds(seed);
  fs_server_options server_options = fs_server_options_init();
  server_options.lease = 0.01;
  ServerRig rig(server_options, options_with(fade));
  rig.step();
  Random random(seed);
  std::array<Client, 2> all;
  uint64_t connections = 0;
  const auto join = [&](size_t i) {
    Client& c = all[i];
    c.name = i ? "bob" : "ann";
    c.scene = rig.join(c.name.c_str());
    const std::vector<Name> names = names_of(c.name, 1 + seed % 2, false);
    c.actor = std::make_unique<Actor>(c.scene.get(), names, kinds, fade, 100 * seed + ++connections);
  };
  for (size_t i = 0; i < all.size(); ++i) join(i);
  Actor own(rig.base.get(), names_of("own", 1, false), kinds, fade, seed);
  Watch watch(rig.fake);
  double gone = 0;  // N, of the clients that have left since nothing was fading
  const auto ticks = [&](uint64_t count) {
    double allowed = own.most_allowed() + gone;
    for (const Client& c : all) allowed += c.actor->most_allowed() + (leaves ? c.actor->force() * period / fade : 0);
    watch.allow(allowed);
    for (uint64_t i = 0; i < count; ++i) {
      rig.step();
      if (random.coin(0.2)) wait_a_little(1e-4);  // the server takes something
    }
  };
  std::string done;
  for (int round = 0; round < 4 && watch.worst().size == 0; ++round) {
    for (int k = 0; k < 40; ++k) {
      const size_t i = random.below(3);
      if (i == 2) {
        own.act(0);
      } else {
        all[i].actor->act(0);
      }
      if (leaves && random.coin(0.03)) {
        Client& c = all[random.below(2)];
        gone += c.actor->most_allowed() + c.actor->force() * period / fade;
        done += c.name + " leaves after " + c.actor->done();
        c.scene.reset();
        if (random.coin()) ticks(random.below(30));
        join(static_cast<size_t>(&c - all.data()));
      }
      const uint64_t lengths[]{0, 0, 1, 2, random.below(20), random.below(100)};
      ticks(lengths[random.below(6)]);
    }
    own.come_to_rest(0);
    for (Client& c : all) c.actor->come_to_rest(0);
    for (Client& c : all) OK(rig.sync(c.scene.get()));
    wait_a_little(5e-3);
    ticks(memory_of_a_call(fade) + ticks_of(server_options.lease) + 10);
    fs_vec3 expected = in_full(rig.base.get(), {});
    for (Client& c : all) expected = expected + in_full(c.scene.get(), {});
    if (watch.worst().size == 0) EXPECT_VECTOR(rig.fake.written.force, expected, 1e-9);
    gone = 0;
  }
  for (const Client& c : all) done += c.name + ": " + c.actor->done();
  findings.add(watch.worst(), described(seed, kinds, fade) + "own: " + own.done() + done);
}

// A constant pull along x.
fs_object pull(const char* name, double force = 5) {
  fs_object o = fs_object_init(name, FS_PRIMITIVE_POINT);
  o.pose = at(0.01, 0, 0);
  o.front = constant(FS_SENSE_ATTRACTIVE, force);
  return o;
}

size_t heap() {
  const struct mallinfo2 info = mallinfo2();
  return info.uordblks + info.hblkhd;
}

}  // namespace

START_TEST(in_one_thread) {
  Findings findings;
  for (uint64_t k = 0; k < runs_a_seed; ++k) one_thread(runs_a_seed * static_cast<uint64_t>(_i) + k, false, findings);
  findings.expect_none();
}
END_TEST

START_TEST(with_a_moving_hand) {
  Findings findings;
  for (uint64_t k = 0; k < runs_a_seed; ++k) one_thread(runs_a_seed * static_cast<uint64_t>(_i) + k, true, findings);
  findings.expect_none();
}
END_TEST

START_TEST(in_several_threads) {
  Findings findings;
  for (uint64_t k = 0; k < 2; ++k) several_threads(2 * static_cast<uint64_t>(_i) + k, findings);
  findings.expect_none();
}
END_TEST

START_TEST(with_clients) {
  Findings findings;
  for (uint64_t k = 0; k < 4; ++k) clients(4 * static_cast<uint64_t>(_i) + k, findings);
  findings.expect_none();
}
END_TEST

// The server's thread waits for the processor at times, as on a machine that is busy, while a client switches an object
// on and off.
START_TEST(with_a_server_that_is_held_up) {
  constexpr double fade = 1;
  cpu_set_t one;
  CPU_ZERO(&one);
  const int here = sched_getcpu();
  CPU_SET(here < 0 ? 0 : here, &one);
  sched_setaffinity(0, sizeof one, &one);
  ServerRig rig(fs_server_options_init(), options_with(fade));
  rig.step();
  const Scene scene = rig.join("c");
  fs_object o = pull("a", 1);
  set(scene, o);
  rig.settle(scene.get());
  rig.step(ticks_of(fade) + 5);
  EXPECT_NEAR(norm(rig.fake.written.force), 1, 1e-9);
  for (const auto& thread : std::filesystem::directory_iterator("/proc/self/task")) {
    std::string name;
    std::ifstream comm(thread.path() / "comm");
    const sched_param idle{};
    if (!std::getline(comm, name) || name != "fs-server") continue;
    sched_setscheduler(std::stoi(thread.path().filename()), SCHED_IDLE, &idle);
  }
  Watch watch(rig.fake);
  watch.allow(period / fade);  // one object, in or out
  std::atomic<bool> is_done{false};
  std::thread busy([&] {  // leaves the processor to the server's thread for a moment only
    setpriority(PRIO_PROCESS, static_cast<id_t>(syscall(SYS_gettid)), 5);
    while (!is_done) {
      const auto start = std::chrono::steady_clock::now();
      while (std::chrono::steady_clock::now() - start < std::chrono::milliseconds(20)) {}
      wait_a_little(2e-3);
    }
  });
  {
    const Ticks ticks(rig.servo.get());
    const auto start = std::chrono::steady_clock::now();
    while (std::chrono::steady_clock::now() - start < std::chrono::seconds(times(1, 2))) {
      o.enabled = !o.enabled;
      const fs_status status = fs_object_change(scene.get(), &o, FS_PART_OTHER);
      ck_assert(status == FS_OK || status == FS_ERROR_TIMEOUT);  // the server may have no time for a second
      wait_a_little(1.3e-3);
    }
    is_done = true;
    busy.join();
  }
  watch.expect_none("on and off");
}
END_TEST

// A second change within the fade of the first.
struct Steps {
  ServoRig rig{options_with(1)};
  Watch watch{rig.fake};
  fs_scene* scene = rig.base.get();

  void set(const fs_object& o) { OK(fs_object_set(scene, &o)); }
  void step(uint64_t ticks) { rig.step(ticks); }
};

START_TEST(three_versions) {  // a point, a plane at half weight, the point again that now drives away
  Steps s;
  s.watch.allow(2 * 5 * period);
  s.set(pull("a"));
  s.step(1500);
  fs_object plane = pull("a");
  plane.primitive = FS_PRIMITIVE_PLANE;
  plane.pose = at(0, 0, -0.002);
  s.set(plane);
  s.step(500);
  fs_object other = pull("a");
  other.pose = at(-0.01, 0, 0);
  other.tool_points = 1;  // another version, so that the pose cannot act at once
  s.set(other);
  s.step(3000);
  s.watch.expect_none("point, plane, point");
  EXPECT_VECTOR(s.rig.fake.written.force, (fs_vec3{-5, 0, 0}), 1e-9);
}
END_TEST

START_TEST(a_version_comes_back_changed) {  // with another sense than the one that it faded out with
  Steps s;
  s.watch.allow(2 * 5 * period);
  s.set(pull("a"));
  s.step(1500);
  fs_object plane = pull("a");
  plane.primitive = FS_PRIMITIVE_PLANE;
  plane.pose = at(0, 0, -0.002);
  s.set(plane);
  s.step(500);
  fs_object other = pull("a");
  other.front.sense = FS_SENSE_REPULSIVE;
  s.set(other);
  s.step(3000);
  s.watch.expect_none("point, plane, point");
  EXPECT_VECTOR(s.rig.fake.written.force, (fs_vec3{-5, 0, 0}), 1e-9);
}
END_TEST

START_TEST(two_shapes) {  // a line, another at 0.95 of its weight, the first again with a shape of its own
  Steps s;
  s.watch.allow(2 * 5 * period);
  const auto line = [&](double x) {
    const fs_vec3 ends[2]{{x, -0.1, 0}, {x, 0.1, 0}};
    const Shape shape = make_polyline(ends, 2, false);
    fs_object o = pull("line");
    o.pose = at(0, 0, 0);
    o.primitive = FS_PRIMITIVE_POLYLINE;
    o.shape = shape.get();
    s.set(o);
  };
  line(-0.05);
  s.step(2000);
  line(0.05);
  s.step(950);
  line(-0.05);
  s.step(3000);
  s.watch.expect_none("line, line, line");
  EXPECT_VECTOR(s.rig.fake.written.force, (fs_vec3{-5, 0, 0}), 1e-9);
}
END_TEST

static void two_views(void (*put)(fs_scene*, double x), fs_vec3 end) {
  Steps s;
  s.watch.allow(2 * 5 * period);
  fs_object o = pull("b");
  o.pose = at(0, 0, 0);
  put(s.scene, -0.05);
  s.step(2000);
  s.set(o);
  s.step(2000);
  put(s.scene, 0.05);
  s.step(950);
  put(s.scene, -0.05);
  s.step(3000);
  s.watch.expect_none("there and back");
  EXPECT_VECTOR(s.rig.fake.written.force, end, 1e-9);
}
START_TEST(two_frames) {
  two_views([](fs_scene* scene, double x) {
    fs_frame frame = fs_frame_init();
    frame.pose.position.x = x;
    OK(fs_scene_set_frame(scene, &frame));
  }, {-5, 0, 0});
}
END_TEST
START_TEST(two_tools) {
  two_views([](fs_scene* scene, double x) {
    const fs_vec3 point{x, 0, 0};
    OK(fs_scene_set_tool(scene, &point, 1));
  }, {5, 0, 0});
}
END_TEST

// Objects come and go one after the other, each still fading when the next comes: the weight of each is known. New
// objects take the place in the scene of those that have faded out.
START_TEST(one_after_the_other) {
  constexpr double fade = 0.1;
  constexpr int every = 7, there = 23;  // ticks
  ServoRig rig(options_with(fade));
  rig.step();
  const auto name = [](int i) { return "n" + std::to_string(i); };
  const auto force = [](int i) { return (i % 2 ? -1 : 1) * (1 + 0.1 * (i % 7)); };  // along x
  const auto expected = [&](int tick) {
    double sum = 0;
    for (int i = 0; i * every <= tick; ++i) {
      const int age = tick - i * every;
      sum += force(i) * std::fmax(0, std::fmin(age, 2 * there - age)) * period / fade;
    }
    return sum;
  };
  for (int tick = 0; tick < 150 * every; ++tick) {
    const int due = tick - there;
    if (due >= 0 && due % every == 0) OK(fs_object_remove(rig.base.get(), name(due / every).c_str()));
    if (tick % every == 0) {
      const int i = tick / every;
      fs_object o = pull(name(i).c_str(), std::fabs(force(i)));
      o.pose = at(force(i) < 0 ? -0.01 : 0.01, 0, 0);
      OK(fs_object_set(rig.base.get(), &o));
    }
    rig.step();
    // Either the tick that first uses a change moves a weight already, or the next one does; it is the same for all.
    const double now = expected(tick + 1), late = expected(tick);
    EXPECT_NEAR(rig.fake.written.force.x, (now + late) / 2, std::fabs(now - late) / 2 + 1e-9);
  }
}
END_TEST

// Sets and removes of one name leave nothing behind, whether ticks come between them or not.
static int sets = times(40'000, 200'000);
START_TEST(many_sets_and_removes) {
  if (is_sanitized) return;
  const int ticks_every = _i;  // sets; 0: none
  ServoRig rig(options_with(0.1));
  rig.step();
  const Name name{"a", 1, false};
  size_t before = 0;
  for (int k = 0; k < sets; ++k) {
    const fs_object o = version_of(name, static_cast<size_t>(k) % versions);
    OK(fs_object_set(rig.base.get(), &o));
    if (k % 3) OK(fs_object_remove(rig.base.get(), "a"));
    if (ticks_every && k % ticks_every == 0) rig.step();
    if (k == 2'000) before = heap();
  }
  const size_t after = heap();
  ck_assert_msg(after < before + 100'000, "%zu bytes are used, %zu at the start", after, before);
  rig.step(500);
  EXPECT_VECTOR(rig.fake.written.force, in_full(rig.base.get(), {}), 1e-9);
}
END_TEST

// A tool that evaluates only now and then does not keep memory from being used again.
START_TEST(a_lazy_tool) {
  const int rounds = is_sanitized ? 200 : times(1000, 3000);
  constexpr double fade = 0.005;
  ServoRig rig(options_with(fade));
  rig.step();
  const Tool tool = make_tool(rig.base.get());
  EXPECT_VECTOR(force_at(tool.get(), {}), (fs_vec3{}), 0);
  size_t before = 0;
  for (int round = 0; round < rounds; ++round) {
    std::vector<std::string> names;
    for (int i = 0; i < 20; ++i) {
      names.push_back(std::to_string(round) + "-" + std::to_string(i));
      const fs_object o = pull(names.back().c_str(), 0.1);
      OK(fs_object_set(rig.base.get(), &o));
    }
    rig.step(7);
    for (const std::string& name : names) OK(fs_object_remove(rig.base.get(), name.c_str()));
    rig.step(8);
    if (round == rounds / 10) before = heap();
    if (round % 1000 == 999) EXPECT_VECTOR(force_at(tool.get(), {}), (fs_vec3{}), 0);
  }
  const size_t after = heap();
  if (!is_sanitized) ck_assert_msg(after < before + 200'000, "%zu bytes are used, %zu at the start", after, before);
  const fs_object last = pull("last");
  OK(fs_object_set(rig.base.get(), &last));
  EXPECT_VECTOR(force_at(tool.get(), {}), (fs_vec3{5, 0, 0}), 1e-12);  // in full, at once
  ck_assert_uint_eq(object_count(rig.base.get()), 1);
}
END_TEST

// Tools come and go beside a servo and many objects; the servo feels nothing of it.
START_TEST(tools_come_and_go) {
  const int count = is_sanitized ? 5'000 : times(20'000, 100'000);
  ServoRig rig(options_with(0.01));
  OK(fs_scene_begin(rig.base.get()));
  for (int i = 0; i < count; ++i) {
    fs_object o = pull(std::to_string(i).c_str(), 1);
    o.pose = at(1 + 0.001 * i, 0, 0);
    o.front.reach = 0.005;
    OK(fs_object_set(rig.base.get(), &o));
  }
  const fs_object near = pull("near");
  OK(fs_object_set(rig.base.get(), &near));
  OK(fs_scene_commit(rig.base.get()));
  rig.step(30);
  Watch watch(rig.fake);
  watch.allow(0);
  {
    const Ticks ticks(rig.servo.get());
    for (int k = 0; k < 20; ++k) {
      const Tool tool = make_tool(rig.base.get());
      EXPECT_VECTOR(force_at(tool.get(), {}), (fs_vec3{5, 0, 0}), 1e-12);
      EXPECT_VECTOR(force_at(tool.get(), {1.0045, 0, 0}), (fs_vec3{-1 - 5, 0, 0}), 6.1);
      wait_a_little(1e-3);
    }
    while (watch.ticks() < 20) wait_a_little();
  }
  watch.expect_none("tools come and go");
}
END_TEST

// ---- An object that is replaced all the time stays felt.

static void expect_felt(const World& world, double force, int tick) {
  const double felt = norm(world.fake.written.force);
  ck_assert_msg(std::fabs(felt - force) <= 0.01 * force, "tick %d: %g N are felt, not %g", tick, felt, force);
}

START_TEST(a_mesh_replaced_at_1000_hz) {  // by an equal one, so that the force stays
  World world(_i);
  world.step();
  const auto put = [&] {
    const Shape shape = make_mesh(box_mesh({0.03, 0.03, 0.03}));
    fs_object o = solid("box", shape);
    o.pose = at(-0.04, 0, 0);
    o.front = constant(FS_SENSE_ATTRACTIVE, 2);
    world.set(o);
  };
  put();
  world.settle();
  expect_felt(world, 2, 0);
  for (int k = 1; k < times(300, 1500); ++k) {
    put();
    world.step();
    expect_felt(world, 2, k);
    if (_i == connected) wait_a_little(2e-4);
  }
  world.settle();
  world.step(ticks_of(2 * world_fade));
  expect_felt(world, 2, -1);
}
END_TEST

static void stream_a_frame(int variant, double fade) {  // at 25 Hz
  fs_servo_options options = world_options();
  options.fade = fade;
  World world(variant, options);
  world.step();
  world.set(push("push"));
  world.settle();
  world.step(1100);
  expect_felt(world, 2, 0);
  for (int k = 1; k < 4000; ++k) {
    if (k % 40 == 0) {
      fs_frame frame = fs_frame_init();
      frame.pose.position = {1e-5 * k, 0, 0};
      OK(fs_scene_set_frame(world.scene, &frame));
      if (variant == connected) wait_a_little();
    }
    world.step();
    expect_felt(world, 2, k);
  }
}
START_TEST(a_stream_of_frames) { stream_a_frame(_i, 0.03); }  // a fade is over when the next frame comes
END_TEST
START_TEST(a_stream_of_frames_that_fade) { stream_a_frame(_i, 1); }
END_TEST

// ---- As many objects as a scene may have: with --long.

START_TEST(as_many_as_there_may_be) {
  constexpr int most = 1'048'576;
  ServoRig rig(options_with(0.003));
  const auto put = [&](const char* prefix, int i) {
    fs_object o = pull((prefix + std::to_string(i)).c_str(), 1);
    o.pose = at(0.01 + 0.001 * i, 0, 0);
    o.front.reach = 0.0125;
    return fs_object_set(rig.base.get(), &o);
  };
  const auto fill = [&](const char* prefix) {
    OK(fs_scene_begin(rig.base.get()));
    for (int i = 0; i < most; ++i) OK(put(prefix, i));
    OK(fs_scene_commit(rig.base.get()));
  };
  const auto expect = [&](double force) { EXPECT_VECTOR(rig.fake.written.force, (fs_vec3{force, 0, 0}), 1e-9); };
  rig.step();
  fill("a");
  EXPECT(FS_ERROR_FULL, put("b", 0));
  rig.step(10);
  expect(3);  // of those at 10, 11 and 12 mm
  OK(fs_object_remove(rig.base.get(), "a0"));
  EXPECT(FS_ERROR_FULL, put("b", 0));  // it still fades out
  rig.step(10);
  expect(2);
  const bool is_free = eventually([&] {
    rig.step();
    return put("b", 0) == FS_OK;
  });
  ck_assert(is_free);
  EXPECT(FS_ERROR_FULL, put("b", 1));
  rig.step(10);
  expect(3);
  OK(fs_scene_clear(rig.base.get()));
  rig.step(10);
  expect(0);
  int there = 0;
  const bool are_free = eventually([&] {  // a call may tidy up only some
    rig.step();
    while (there < 10'000 && put("c", there) == FS_OK) ++there;
    return there == 10'000;
  });
  ck_assert(are_free);
  fill("c");
  rig.step(10);
  expect(3);
}
END_TEST

// test_no_step [--seeds N] [--long]: N times as many random runs; only what takes long.
int main(int argc, char** argv) {
  int seeds = 1;
  bool is_long = false;
  for (int i = 1; i < argc; ++i) {
    if (std::strcmp(argv[i], "--seeds") == 0 && i + 1 < argc) seeds = std::atoi(argv[++i]);
    if (std::strcmp(argv[i], "--long") == 0) is_long = true;
  }
  Suite* suite = suite_create("no step");
  if (is_long) {
    TCase* test_case = new_case(suite, "long");
    tcase_set_timeout(test_case, 600);
    tcase_add_test(test_case, as_many_as_there_may_be);
    sets = 1'000'000;
    for (const int every : {0, 10}) tcase_add_loop_test(test_case, many_sets_and_removes, every, every + 1);
    return run_suite(suite);
  }
  TCase* random = new_case(suite, "at random");
  for (const TTest* test : {in_several_threads, with_clients}) tcase_add_loop_test(random, test, 0, seeds);
  tcase_add_test(random, with_a_server_that_is_held_up);
  add_once(suite, "tools", {tools_come_and_go});
  add_on_both(suite, "replaced", {a_mesh_replaced_at_1000_hz});
  add_on_both(suite, "streamed", {a_stream_of_frames, a_stream_of_frames_that_fade});
  if (seeks_races) return run_suite(suite);
  for (const TTest* test : {in_one_thread, with_a_moving_hand}) tcase_add_loop_test(random, test, 0, seeds);
  add_once(suite, "second changes", {three_versions, a_version_comes_back_changed, two_shapes, two_frames, two_tools,
                                     one_after_the_other, a_lazy_tool});
  TCase* memory = new_case(suite, "memory");
  for (const int every : {0, 10}) tcase_add_loop_test(memory, many_sets_and_removes, every, every + 1);
  return run_suite(suite);
}
