// What the surface of a solid does: it sticks and slips. The files and the server that keep it.
#include <cmath>
#include <fstream>
#include <numbers>

#include "scenes/folder.h"
#include "api/hand.h"

using namespace scenes;

namespace {

// A table of such a surface, and a hand on it, 2 mm deep: 2 N.
struct Table : Hand {
  Surface surface;
  fs_object object = fs_object_init("table", FS_PRIMITIVE_PLANE);

  explicit Table(const fs_surface_settings& settings, double limit = 1000) : surface(make_surface(settings)) {
    object.surface = surface.get();
    put(object, solid(FS_KEEP_FRONT, 1000, limit));
    go({0, 0, 0.01});
    slide({0, 0, -0.002});
  }
  // N, against the hand, which has been slid to x.
  double friction_at(double x) { return -slide({x, 0, -0.002}, 1e-5).x; }
};

// ---------------------------------------------------------------------------------------------------- stick and slip

// While it slips, hand = way + lag and lag = depth * (static - (static - dynamic) * way / distance).
START_TEST(friction_falls_with_the_way) {
  Table table(sticky(0.8, 0.4, 0.004));
  const fs_vec3 stuck = table.proxy();
  EXPECT_NEAR(table.friction_at(0.0016), 1.6, 1e-9);
  EXPECT_VECTOR(table.proxy(), stuck, 1e-12);
  EXPECT_NEAR(table.friction_at(0.0032), 1.2, 1e-6);  // it has slipped by 2 mm
  EXPECT_NEAR(table.proxy().x, 0.002, 1e-6);
  EXPECT_NEAR(table.friction_at(0.0048), 0.8, 1e-6);  // by 4 mm
  EXPECT_NEAR(table.friction_at(0.010), 0.8, 1e-9);
  // It goes on slipping where the hand comes back by less than a tenth of the difference, else it sticks.
  EXPECT_NEAR(table.friction_at(0.00993), 0.73, 1e-9);
  EXPECT_NEAR(table.friction_at(0.010), 0.8, 1e-9);
  EXPECT_NEAR(table.friction_at(0.011), 0.8, 1e-9);
  EXPECT_NEAR(table.friction_at(0.01091), 0.71, 1e-9);
  EXPECT_NEAR(table.friction_at(0.0118), 1.6, 1e-9);
  // In the other direction, too; and above the surface it forgets.
  EXPECT_NEAR(table.friction_at(0.0118 - 0.0016 - 0.0048), -0.8, 1e-6);
  table.slide({0.003, 0, 0.001});
  table.slide({0.003, 0, -0.002});
  EXPECT_NEAR(table.friction_at(0.0046), 1.6, 1e-6);
}
END_TEST

// A distance of 0, or less than the loop bears, is longer: from tick to tick the force changes by no more than the hand's way explains.
START_TEST(it_falls_no_steeper_than_the_contact) {
  for (const double distance : {0.0, 1e-5, 0.0016}) {
    Table table(sticky(0.8, 0.4, distance));
    double last = table.felt.wrench.force.x, steepest = 0;
    for (int i = 1; i <= 1000; ++i) {
      const double force = table.go({1e-5 * i, 0, -0.002}).x;
      if (force > last) steepest = std::max(steepest, (force - last) / 1e-5);
      last = force;
    }
    EXPECT_NEAR(steepest, 1000, 1);  // slope / (1 - slope / stiffness), of half of the stiffness
    EXPECT_NEAR(last, -0.8, 1e-9);
  }
}
END_TEST

// Equal coefficients are those of a contact.
START_TEST(equal_coefficients_are_coulomb) {
  Hand plain;
  fs_contact contact = solid(FS_KEEP_FRONT);
  contact.friction = 0.7;
  plain.plane("table", {0, 0, 0}, {0, 0, 1}, contact);
  Table table(sticky(0.7, 0.7, 0.001));
  plain.go({0, 0, 0.01});
  plain.slide({0, 0, -0.002});
  Random random(3);
  for (int i = 0; i < 2000; ++i) {
    const fs_vec3 to = table.x + fs_vec3{random.between(-1, 1) * 1e-4, random.between(-1, 1) * 1e-4, random.between(-1, 1) * 2e-5};
    const fs_vec3 a = table.go(to), b = plain.go(to);
    EXPECT_VECTOR(a, b, 1e-12);
  }
}
END_TEST

// The proxy is only ever moved towards the hand: so the energy of the spring never grows by a slip. On planes, in a corner and on
// meshes, where coefficients mix; with a limit, and as often as the rate wants.
START_TEST(slips_only_lose_energy) {
  Random random(11);
  for (int round = 0; round < times(60, 600); ++round) {
    Hand hand;
    std::vector<Surface> surfaces;
    const auto add = [&](fs_object o, const char* name) {
      const double still = random.between(0, 2);
      surfaces.push_back(make_surface(sticky(still, still * random.between(0.1, 1), random.coin() ? 0 : random.log_between(1e-5, 1e-2))));
      std::strcpy(o.name, name);
      o.surface = still > 0 || random.coin() ? surfaces.back().get() : nullptr;
      hand.put(o, solid(FS_KEEP_FRONT, 1000, 1000));
    };
    fs_object floor = fs_object_init("", FS_PRIMITIVE_PLANE), side = floor;
    OK(fs_pose_from_z({0, 0, 0}, {0, 0, 1}, &floor.pose));
    OK(fs_pose_from_z({0.005, 0, 0}, {-1, 0, random.between(-0.5, 0.5)}, &side.pose));
    add(floor, "floor");
    if (random.coin()) add(side, "side");
    hand.go({0, 0, 0.01});
    const double step = random.log_between(1e-6, 1e-3);
    for (int i = 0; i < 1000; ++i) {
      const fs_vec3 before = hand.proxy();
      const fs_vec3 way = random.in_box(0.006) - hand.x;
      hand.go(hand.x + (step / norm(way)) * way);
      ck_assert_double_le(norm(hand.x - hand.proxy()), norm(hand.x - before) + 1e-12);
    }
  }
}
END_TEST

// Two springs in series that are pulled slowly: the hand sticks until both have taken up what the last slip let go, and slips for half
// an oscillation.
START_TEST(the_period_of_stick_and_slip) {
  constexpr double still = 0.6, sliding = 0.3, depth = 0.002, k = 1000, normal = k * depth;
  for (const double k_hand : {40.0, 20.0, 10.0}) {
    if (is_sanitized && k_hand < 40) break;  // the softer the hand, the longer this takes
    const double mass = 0.3, damping = 0.01 * std::sqrt(k_hand * mass), fades = 2 * mass / damping;
    const double speed = 2 * (still - sliding) * normal / (k_hand * 8 * fades);  // so slowly that it is at rest before it slips
    Table table(sticky(still, sliding, 1e-4));
    double x = 0, v = 0;
    std::vector<double> slips;
    double peak = 0;
    const double expected = (still - sliding) * normal * 2 * (k + k_hand) / (k * k_hand * speed) + std::numbers::pi * std::sqrt(mass / k_hand);
    for (int i = 0; i < 1000 * 5 * expected; ++i) {
      const double force = table.go({x, 0, -depth}).x, target = speed * i * dt;
      v += dt * (force + k_hand * (target - x) - damping * v) / mass;
      x += dt * v;
      peak = std::max(peak, -force);
      // A slip begins where friction falls from its peak.
      if (peak > 0.95 * still * normal && -force < 0.9 * still * normal) {
        slips.push_back(i * dt);
        peak = 0;
      }
    }
    ck_assert_uint_ge(slips.size(), 4);
    const double period = (slips.back() - slips[1]) / static_cast<double>(slips.size() - 2);
    if (std::getenv("VERBOSE")) std::printf("  %g N/m: a period of %.2f s, expected %.2f s\n", k_hand, period, expected);
    EXPECT_NEAR(period / expected, 1, 0.05);
  }
}
END_TEST

// Whatever is done to the surface while it holds the hand, the hand feels it softly.
START_TEST(a_surface_is_replaced_while_it_sticks) {
  Table table(sticky(0.8, 0.8, 0));
  EXPECT_NEAR(table.friction_at(0.001), 1, 1e-9);
  const Surface ice = make_surface(sticky(0.1, 0.05, 0.001));
  for (fs_surface* const other : {ice.get(), table.surface.get(), static_cast<fs_surface*>(nullptr), table.surface.get()}) {
    table.object.surface = other;
    OK(fs_object_change(table.scene.get(), &table.object, FS_PART_CONTACT));
    fs_vec3 last = table.felt.wrench.force;
    for (int i = 0; i < 200; ++i) {
      const fs_vec3 force = table.go(table.x);
      ck_assert_double_le(norm(force - last), 0.1);
      last = force;
    }
  }
}
END_TEST

// ----------------------------------------------------------------------------------------------------------- handles

START_TEST(bad_settings_are_refused_by_name) {
  const struct {
    const char* field;
    void (*spoil)(fs_surface_settings&);
  } cases[] = {
      {"static_friction", [](fs_surface_settings& s) { s.static_friction = -0.1; }},
      {"static_friction", [](fs_surface_settings& s) { s.static_friction = 2.1; }},
      {"static_friction", [](fs_surface_settings& s) { s.static_friction = NAN; }},
      {"dynamic_friction is 0.6, must be within 0.05..0.5", [](fs_surface_settings& s) { s.dynamic_friction = 0.6; }},
      {"dynamic_friction", [](fs_surface_settings& s) { s.dynamic_friction = 0.04; }},
      {"dynamic_friction", [](fs_surface_settings& s) { s.dynamic_friction = NAN; }},
      {"slip_distance", [](fs_surface_settings& s) { s.slip_distance = -1e-9; }},
      {"slip_distance", [](fs_surface_settings& s) { s.slip_distance = INFINITY; }},
      {"slip_distance", [](fs_surface_settings& s) { s.slip_distance = NAN; }},
      {"reserved", [](fs_surface_settings& s) { s.reserved = 1; }},
      {"struct_size", [](fs_surface_settings& s) { s.struct_size = 3; }},
  };
  for (const auto& [field, spoil] : cases) {
    fs_surface_settings bad = sticky(0.5, 0.3, 0.001);
    spoil(bad);
    fs_surface* out = nullptr;
    EXPECT_SENTENCE(FS_ERROR_INVALID, fs_surface_create(&bad, &out), field);
    ck_assert_ptr_null(out);
  }
  const fs_surface_settings good = sticky(0.5, 0.3, 0.001);
  fs_surface* out = nullptr;
  EXPECT(FS_ERROR_INVALID, fs_surface_create(nullptr, &out));
  EXPECT(FS_ERROR_INVALID, fs_surface_create(&good, nullptr));
  ck_assert_ptr_null(fs_surface_retain(nullptr));
  fs_surface_destroy(nullptr);
}
END_TEST

START_TEST(objects_that_cannot_have_one) {
  const Scene scene = make_scene();
  const Surface surface = make_surface(sticky(0.5, 0.3, 0.001));
  fs_object o = fs_object_init("s", FS_PRIMITIVE_POINT);
  o.surface = surface.get();
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_object_set(scene.get(), &o), "surface is given, must be null for a POINT");
  o = fs_object_init("w", FS_PRIMITIVE_PLANE);
  o.surface = surface.get();
  o.contact.friction = 0.1;
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_object_set(scene.get(), &o), "contact.friction is 0.1, must be 0");
  o.contact.friction = 0;
  OK(fs_object_set(scene.get(), &o));  // it waits until the object is solid
}
END_TEST

void expect_surface(fs_scene* scene, const char* name, const fs_surface_settings& wanted) {
  fs_object got = fs_object_init(nullptr, FS_PRIMITIVE_POINT);
  OK(fs_object_get(scene, name, &got));
  ck_assert_ptr_nonnull(got.surface);
  fs_surface_settings settings = fs_surface_settings_init();
  OK(fs_surface_get_settings(got.surface, &settings));
  ck_assert_mem_eq(&settings, &wanted, sizeof wanted);
  fs_object_release(&got);
}

START_TEST(they_live_as_long_as_their_objects) {
  const Scene scene = make_scene();
  const fs_surface_settings settings = sticky(0.5, 0.3, 0.001);
  {
    const Surface surface = make_surface(settings);
    for (const char* name : {"a", "b"}) {
      fs_object o = fs_object_init(name, FS_PRIMITIVE_PLANE);
      o.surface = surface.get();
      o.contact = solid(FS_KEEP_FRONT);
      OK(fs_object_set(scene.get(), &o));
    }
  }
  expect_surface(scene.get(), "a", settings);
  OK(fs_object_remove(scene.get(), "a"));
  expect_surface(scene.get(), "b", settings);
}
END_TEST

START_TEST(surfaces_in_files) {
  const Folder folder;
  const std::string path = folder / "scene.json";
  const fs_surface_settings settings = sticky(0.1 + 0.2, 0.1, 1e-4);
  const Surface surface = make_surface(settings);
  {
    const Scene scene = make_scene();
    for (const char* name : {"a", "b"}) {
      fs_object o = fs_object_init(name, FS_PRIMITIVE_PLANE);
      o.surface = surface.get();
      o.contact = solid(FS_KEEP_FRONT);
      OK(fs_object_set(scene.get(), &o));
    }
    OK(fs_scene_save(scene.get(), path.c_str()));
  }
  const Scene again = make_scene();
  OK(fs_scene_load(again.get(), path.c_str()));
  expect_surface(again.get(), "b", settings);
  fs_object a = fs_object_init(nullptr, FS_PRIMITIVE_POINT), b = a;
  OK(fs_object_get(again.get(), "a", &a));
  OK(fs_object_get(again.get(), "b", &b));
  ck_assert_ptr_eq(a.surface, b.surface);  // one, as it was
  fs_object_release(&a);
  fs_object_release(&b);
  const struct {
    const char *surfaces, *word;
  } bad[] = {
      {R"({"ice": {"static_friction": 3}})", "static_friction"},
      {R"({"ice": {"sticky": 3}})", "\"sticky\" is unknown"},
      {R"({"ice": 3})", "ice"},
      {R"([])", "surfaces"},
      {R"({"snow": {}})", "a key of \"surfaces\""},
  };
  for (const auto& [surfaces, word] : bad) {
    std::ofstream(path) << std::string(R"({"forceserver": "scene", "version": 1, "surfaces": )") + surfaces +
                         R"(, "objects": [{"name": "w", "primitive": "plane", "surface": "ice"}]})";
    EXPECT_SENTENCE(FS_ERROR_PARSE, fs_scene_load(again.get(), path.c_str()), word);
  }
  ck_assert_uint_eq(object_count(again.get()), 2);
}
END_TEST

}  // namespace

int main() {
  Suite* const suite = suite_create("surface");
  add_case(suite, "stick and slip",
           {friction_falls_with_the_way, it_falls_no_steeper_than_the_contact, equal_coefficients_are_coulomb,
            slips_only_lose_energy, the_period_of_stick_and_slip, a_surface_is_replaced_while_it_sticks});
  add_case(suite, "handles",
           {bad_settings_are_refused_by_name, objects_that_cannot_have_one, they_live_as_long_as_their_objects, surfaces_in_files});
  return run_suite(suite);
}
