// What a client believes and what the server has are the same, whatever was refused, edited by another, or done in groups:
// two clients change their own and each other's objects at random, and after each round both sides are compared.
#include <algorithm>
#include <array>
#include <map>
#include <thread>

#include "api/world.h"

using namespace scenes;

namespace {

constexpr uint32_t most_objects = 4;
const std::array<const char*, 7> names{"a", "b", "c", "d", "e", "f", "g"};

// Polylines and meshes that are taken at once, after a while, and never.
struct Shapes {
  Shape line, small, slow, too_large;
  Curve curve = make_table(std::array<double, 3>{0.1, 0.2, 0.1}.data(), 3, 0.01);
  Shapes() {
    const fs_vec3 points[3]{{0, 0, 0}, {0.01, 0, 0}, {0.02, 0.01, 0}};
    line = make_polyline(points, 3, false);
    small = make_mesh(sphere_mesh(0.01, 50));
    slow = make_mesh(sphere_mesh(0.02, 2'000));
    too_large = make_mesh(sphere_mesh(0.03, 50'000));  // 1.2 MB
  }
};

std::vector<fs_motion> motions_of(fs_scene* scene, const char* client) {
  size_t count = 0;
  OK(fs_scene_get_motions(scene, client, nullptr, 0, &count));
  std::vector<fs_motion> out(count);
  OK(fs_scene_get_motions(scene, client, out.data(), out.size(), &count));
  ck_assert_uint_eq(count, out.size());
  return out;
}

struct Party {
  const char* name;
  Scene scene;
  bool has_group = false;
  size_t changes = 0, refused = 0, edits = 0, groups = 0;  // that were tried; by their sync; of the other's; with edits
};

class Pair {
 public:
  explicit Pair(uint64_t seed, const fs_server_options& options) : random(seed), rig(options) {
    rig.step();  // at time 0 of a virtual clock FS_NOW cannot be told from it
    for (Party& p : parties) p.scene = rig.join(p.name);
  }

  fs_object object(const std::string& name) {
    fs_object out = fs_object_init(name.c_str(), FS_PRIMITIVE_POINT);
    switch (random.below(10)) {
      case 0: case 1: out.primitive = FS_PRIMITIVE_PLANE; break;
      case 2: out.primitive = FS_PRIMITIVE_POLYLINE; out.shape = shapes.line.get(); break;
      case 3: out.primitive = FS_PRIMITIVE_MESH; out.shape = shapes.small.get(); break;
      case 4: out.primitive = FS_PRIMITIVE_MESH; out.shape = shapes.slow.get(); break;
      case 5: out.primitive = FS_PRIMITIVE_MESH; out.shape = shapes.too_large.get(); break;
      default: break;
    }
    out.front = attract(random.between(1, 100), 1);
    if (random.coin(0.2)) {
      out.front = {FS_PROFILE_CUSTOM, FS_SENSE_ATTRACTIVE, random.between(0, 2), 0, 0, 1, 0, shapes.curve.get(), {}};
    }
    if (out.primitive >= FS_PRIMITIVE_PLANE && random.coin(0.3)) out.back = constant(FS_SENSE_ATTRACTIVE, 0.1);
    out.pose.position = random.in_box(0.1);
    out.enabled = random.coin(0.9);
    out.damping = random.coin(0.3) ? random.between(0, 5) : 0;
    out.tool_points = static_cast<uint32_t>(random.below(4));
    if (random.coin(0.3)) out.front.reach = random.between(0, 1);
    if (random.coin(0.2)) out.front.sense = FS_SENSE_REPULSIVE;
    if (random.coin(0.2)) out.lifetime = 1e3;
    return out;
  }

  // One change, which may fail: then by a status that the headers name. TIMEOUT where the server has not answered in time,
  // because it builds a mesh or is held up: it may act on the change still, before the next sync.
  void change(Party& me, const Party& other) {
    fs_scene* const s = me.scene.get();
    const bool is_of_other = random.coin(0.35);
    const std::string bare = names[random.below(names.size())];
    const std::string name = is_of_other ? std::string(other.name) + "/" + bare : bare;
    const fs_pose pose = at(random.in_box(0.1));
    const fs_twist twist{random.in_box(0.01), {}};
    fs_status status = FS_OK;
    switch (random.below(is_of_other ? 6 : 16)) {
      case 0: case 1: status = fs_object_move(s, name.c_str(), &pose, random.coin() ? &twist : nullptr, FS_NOW); break;
      case 2: case 3: {
        fs_object o = object(name);
        status = fs_object_change(s, &o, static_cast<uint32_t>(random.below(32)));
        break;
      }
      case 4: status = fs_object_remove(s, name.c_str()); break;
      case 5: {
        fs_object got = fs_object_init("", FS_PRIMITIVE_POINT);
        status = fs_object_get(s, name.c_str(), &got);
        if (status == FS_OK) status = fs_object_change(s, &got, FS_PART_PROFILES | FS_PART_OTHER);
        fs_object_release(&got);
        break;
      }
      case 6: if (random.coin(0.3)) status = fs_scene_clear(s); break;
      case 7: {
        fs_frame frame = fs_frame_init();
        frame.pose.position = random.in_box(0.01);
        frame.scale = random.between(0.5, 2);
        status = fs_scene_set_frame(s, &frame);
        break;
      }
      case 8: {
        std::array<fs_vec3, 3> points{random.in_box(0.01), random.in_box(0.01), random.in_box(0.01)};
        status = fs_scene_set_tool(s, points.data(), 1 + random.below(3));
        break;
      }
      default: {
        const fs_object o = object(name);
        status = fs_object_set(s, &o);
      }
    }
    const bool is_known = status == FS_OK || status == FS_ERROR_NOT_FOUND || status == FS_ERROR_FULL ||
                          status == FS_ERROR_INVALID ||
                          (is_of_other && (status == FS_ERROR_STATE || status == FS_ERROR_TIMEOUT));
    ck_assert_msg(is_known, "%s of %s: %s: %s", name.c_str(), me.name, fs_status_name(status), fs_last_error());
    me.changes += status == FS_OK;
    me.edits += status == FS_OK && is_of_other;
    me.groups += status == FS_OK && is_of_other && me.has_group;
  }

  void act() {
    const size_t i = random.below(2);
    Party& me = parties[i];
    if (!me.has_group && random.coin(0.1)) {
      OK(fs_scene_begin(me.scene.get()));
      me.has_group = true;
    } else if (me.has_group && random.coin(0.25)) {
      end_group(me);
    }
    change(me, parties[1 - i]);
    if (random.coin(0.1)) rig.step(random.below(30));
  }

  void end_group(Party& me) {
    if (me.has_group) OK(random.coin(0.9) ? fs_scene_commit(me.scene.get()) : fs_scene_cancel(me.scene.get()));
    me.has_group = false;
  }

  // Until all that waits has come to its end.
  void settle() {
    for (Party& me : parties) end_group(me);
    for (int i = 0; i < 2; ++i) {
      for (Party& me : parties) {
        while (const fs_status status = rig.sync(me.scene.get())) {
          ck_assert_msg(status == FS_ERROR_FULL || status == FS_ERROR_INVALID || status == FS_ERROR_NOT_FOUND,
                        "sync: %s: %s", fs_status_name(status), fs_last_error());
          ++me.refused;
        }
      }
    }
  }

  static void expect_same(const fs_object& a, const fs_object& b, const std::string& what) {
    const auto same = [&](const char* field, const auto& x, const auto& y) {
      ck_assert_msg(std::memcmp(&x, &y, sizeof x) == 0, "%s: its %s differs", what.c_str(), field);
    };
    same("primitive", a.primitive, b.primitive);
    same("pose", a.pose, b.pose);
    same("twist", a.twist, b.twist);
    same("time", a.time, b.time);
    same("start", a.start, b.start);
    same("lifetime", a.lifetime, b.lifetime);
    for (const auto& [x, y] : {std::pair(a.front, b.front), std::pair(a.back, b.back)}) {
      same("kind", x.kind, y.kind);
      same("sense", x.sense, y.sense);
      same("gain", x.gain, y.gain);
      same("offset", x.offset, y.offset);
      same("width", x.width, y.width);
      same("limit", x.limit, y.limit);
      same("reach", x.reach, y.reach);
      ck_assert_msg(!x.curve == !y.curve, "%s: only one has a curve", what.c_str());
    }
    same("damping", a.damping, b.damping);
    same("contact", a.contact, b.contact);
    same("tool_points", a.tool_points, b.tool_points);
    same("enabled", a.enabled, b.enabled);
    ck_assert_msg(!a.shape == !b.shape, "%s: only one has a shape", what.c_str());
    if (!a.shape) return;
    size_t x, y;
    fs_shape_get_points(a.shape, &x);
    fs_shape_get_points(b.shape, &y);
    ck_assert_msg(x == y, "%s: its shape has %zu points for its client, %zu at the server", what.c_str(), x, y);
  }

  void compare() {
    for (const size_t i : {0, 1}) {
      fs_scene* const own = parties[i].scene.get();
      fs_scene* const other = parties[1 - i].scene.get();
      const std::string prefix = std::string(parties[i].name) + "/";
      std::map<std::string, int> mine, theirs;
      for (const fs_report& r : own_reports_of(own)) mine[r.name] = r.state;
      for (const fs_report& r : reports_of(other)) {
        if (std::string(r.name).starts_with(prefix)) theirs[r.name + prefix.size()] = r.state;
      }
      for (const char* name : names) {
        const std::string full = prefix + name;
        const bool is_listed = mine.contains(name);
        ck_assert_msg(is_listed == theirs.contains(name), "%s is listed for one of two", full.c_str());
        ck_assert_msg(is_listed == has(own, name), "%s: its client %s, but it is %slisted", full.c_str(),
                      is_listed ? "has it not" : "has it", is_listed ? "" : "not ");
        if (!is_listed) {
          ck_assert_msg(!has(other, full.c_str()), "%s is there, its client does not know", full.c_str());
          continue;
        }
        ck_assert_int_eq(mine[name], theirs[name]);
        const bool is_refused = mine[name] == FS_OBJECT_REFUSED;
        ck_assert_msg(has(other, full.c_str()) != is_refused, "%s is %srefused", full.c_str(), is_refused ? "" : "not ");
        compared += !is_refused;
        if (!is_refused) expect_same(Got(own, name).object, Got(other, full.c_str()).object, full);
      }
      std::map<std::string, fs_motion> moves;
      for (const fs_motion& m : motions_of(own, parties[i].name)) moves[m.name] = m;
      for (const fs_motion& m : motions_of(other, parties[i].name)) {
        const fs_motion& ours = moves[m.name + prefix.size()];
        ck_assert_msg(std::memcmp(&ours.pose, &m.pose, sizeof m.pose) == 0 && ours.time == m.time &&
                          std::memcmp(&ours.twist, &m.twist, sizeof m.twist) == 0 && ours.horizon == m.horizon,
                      "%s moves for %g s there, for %g s here", m.name, m.horizon, ours.horizon);
      }
      fs_view here, there;
      OK(fs_scene_get_view(own, nullptr, &here));
      OK(fs_scene_get_view(other, parties[i].name, &there));
      ck_assert_msg(std::memcmp(&here, &there, sizeof here) == 0, "the view of %s differs", parties[i].name);
      const std::vector<fs_vec3> tool = tool_of(own);
      ck_assert_uint_eq(tool.size(), there.point_count);
      ck_assert(std::memcmp(tool.data(), there.points, tool.size() * sizeof tool[0]) == 0);
    }
  }

  // What a client has, it can move and remove.
  void use() {
    Party& me = parties[random.below(2)];
    for (const fs_report& r : own_reports_of(me.scene.get())) {
      const fs_pose pose = at(random.in_box(0.1));
      OK(fs_object_move(me.scene.get(), r.name, &pose, nullptr, FS_NOW));
    }
    settle();
    compare();
    for (const fs_report& r : own_reports_of(me.scene.get())) {
      if (random.coin()) OK(fs_object_remove(me.scene.get(), r.name));
    }
    settle();
    compare();
  }

  // It leaves, and another of its name comes, which has nothing.
  void reconnect() {
    Party& me = parties[random.below(2)];
    me.scene.reset();
    me.scene = rig.join(me.name);
    rig.step_through_fade();
  }

  Random random;
  const Shapes shapes;
  ServerRig rig;
  std::array<Party, 2> parties{Party{"me", nullptr}, Party{"bob", nullptr}};
  size_t compared = 0;
};

fs_server_options few() {
  fs_server_options options = fs_server_options_init();
  options.max_objects = most_objects;
  options.max_megabytes = 1;
  options.lease = 1e-3;
  return options;
}

void run_rounds(int rounds, uint64_t seed) {
  Pair pair(seed, few());
  for (int round = 0; round < rounds; ++round) {
    for (uint64_t i = 3 + pair.random.below(30); i > 0; --i) pair.act();
    pair.settle();
    pair.compare();
    if (round % 8 == 7) pair.use();
    if (round % 16 == 15) pair.reconnect();
    if (pair.random.coin(0.3)) pair.rig.step_through_fade();
  }
  std::printf("  seed %llu: %zu objects compared", static_cast<unsigned long long>(seed), pair.compared);
  for (const Party& p : pair.parties) {
    std::printf("; %s: %zu changes, %zu refused, %zu of the other's, %zu of these in groups", p.name, p.changes, p.refused,
                p.edits, p.groups);
    ck_assert(p.changes > 10 && p.refused > 0 && p.edits > 0 && p.groups > 0);
  }
  std::printf("\n");
  ck_assert_uint_gt(pair.compared, 10);
}

}  // namespace

START_TEST(at_random) { run_rounds(40, static_cast<uint64_t>(_i) + 1); }
END_TEST

// The same while other threads of a client ask, and change its objects.
START_TEST(from_several_threads) {
  Pair pair(7, few());
  for (int round = 0; round < 6; ++round) {
    std::atomic<bool> is_done{false};
    fs_scene* const scene = pair.parties[0].scene.get();
    std::thread asks([&] {
      while (!is_done) {
        for (const char* name : names) has(scene, name);
        reports_of(scene);
        tool_of(scene);
      }
    });
    std::thread moves([&] {
      Random random(static_cast<uint64_t>(round));
      while (!is_done) {
        const fs_pose pose = at(random.in_box(0.1));
        const fs_status status = fs_object_move(scene, names[random.below(names.size())], &pose, nullptr, FS_NOW);
        ck_assert(status == FS_OK || status == FS_ERROR_NOT_FOUND || status == FS_ERROR_TIMEOUT || status == FS_ERROR_FULL);
      }
    });
    for (int i = 0; i < 60; ++i) pair.act();
    pair.settle();
    is_done = true;
    asks.join();
    moves.join();
    pair.settle();
    pair.compare();
  }
}
END_TEST

// test_agreement [--seeds N]: so many random runs.
int main(int argc, char** argv) {
  const int seeds = argc > 2 && std::strcmp(argv[1], "--seeds") == 0 ? std::atoi(argv[2]) : times(3, 6);
  Suite* suite = suite_create("agreement");
  TCase* test_case = new_case(suite, "two clients");
  tcase_add_loop_test(test_case, at_random, 0, seeds);
  tcase_add_test(test_case, from_several_threads);
  return run_suite(suite);
}
