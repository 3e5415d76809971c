// The terrain's client: the ground, and a clutch. It watches the arm's client too, and measures how far the two worlds
// have slid against each other: where the hand is in the terrain's world, seen in the arm's world, minus where it is in
// the arm's own. It writes this to a table, and ends with 1 if something is not as it should be.
#include <array>
#include <vector>

#include "../quickstart_source/beat.h"
#include "worlds.h"

// m, the height of the ground in the terrain's world.
static double height(double x, double y) { return 0.09 + 0.004 * std::sin(50 * x) + 0.003 * std::cos(40 * y + 20 * x); }

static fs_shape* make_ground() {
  const uint32_t size = 121;  // points each way, 4 mm apart: 0.48 m of the model, 4.8 m of the arm's world
  std::vector<fs_vec3> points;
  std::vector<uint32_t> faces;
  for (uint32_t i = 0; i < size * size; ++i) {
    const double x = base.x + 0.004 * (double(i % size) - 60), y = base.y + 0.004 * (double(i / size) - 60);
    points.push_back({x, y, height(x, y)});
    if (i % size && i >= size) faces.insert(faces.end(), {i - size - 1, i - size, i, i - size - 1, i, i - 1});
  }
  fs_shape* shape;
  check(fs_shape_create_mesh(points.data(), points.size(), faces.data(), faces.size() / 3, &shape));
  return shape;
}

static double length(const fs_vec3& v) { return std::sqrt(v.x * v.x + v.y * v.y + v.z * v.z); }

// What is seen at one moment; all places in the arm's world, m.
struct Sight {
  fs_vec3 tip, slide;
  double ground;                        // the height of the ground below the tip, as it should be
  double too_high;                      // how much higher the ground is felt than it should be; NAN: it is not touched
  double ground_force, envelope_force;  // N
};

static Sight look(fs_scene* scene) {
  fs_view arm, own;
  fs_report ground, envelope;
  check(fs_scene_get_view(scene, "arm", &arm));  // the two views may be a tick apart
  check(fs_scene_get_view(scene, nullptr, &own));
  check(fs_scene_get_report(scene, "ground", &ground));
  check(fs_scene_get_report(scene, "arm/envelope", &envelope));
  Sight out;
  out.tip = arm.tool.position;
  const fs_vec3 seen = in_arm(own.tool.position), below = in_terrain(out.tip);
  out.slide = {seen.x - out.tip.x, seen.y - out.tip.y, seen.z - out.tip.z};
  out.ground = in_arm({below.x, below.y, height(below.x, below.y)}).z;
  out.ground_force = length(ground.wrench.force);
  out.envelope_force = length(envelope.wrench.force);
  out.too_high = NAN;
  if (out.ground_force > 0) {
    // The proxy lies on the ground of the terrain's world. Seen through both frames it is a place in the arm's world.
    const fs_vec3 device = on_device(own.frame, ground.point), origin = arm.frame.pose.position;
    const fs_vec3 felt = {arm_scale * (device.x - origin.x), arm_scale * (device.y - origin.y),
                          arm_scale * (device.z - origin.z)};
    const fs_vec3 there = in_terrain(felt);
    out.too_high = felt.z - in_arm({there.x, there.y, height(there.x, there.y)}).z;
  }
  return out;
}

static int failures = 0;

static void expect(bool holds, const char* sentence) {
  std::printf("%s: %s\n", holds ? "yes" : "NO", sentence);
  if (!holds) ++failures;
}

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fprintf(stderr, "usage: terrain ENDPOINT TABLE.csv    (such as shm:lab; the arm's client is there already)\n");
    return 2;
  }
  Beat beat;
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  fs_scene* scene;
  check(fs_scene_connect(argv[1], "terrain", &scene));
  const fs_frame frame = terrain_frame();
  check(fs_scene_set_frame(scene, &frame));
  fs_object ground = fs_object_init("ground", FS_PRIMITIVE_MESH);
  ground.shape = make_ground();
  ground.contact.keep = FS_KEEP_FRONT;
  ground.contact.stiffness = 1000;  // at the hand 0.6 times as steep
  ground.contact.limit = 8;
  check(fs_object_set(scene, &ground));
  fs_shape_destroy(ground.shape);

  // When the hand of `hand.txt` began: at the servo's first tick.
  fs_servo_stats stats = fs_servo_stats_init();
  fs_device_info device = fs_device_info_init();
  double now;
  check(fs_scene_get_time(scene, &now));
  check(fs_scene_get_servo_stats(scene, &stats));
  check(fs_scene_get_device_info(scene, &device));
  const double begin = now - double(stats.ticks + stats.misses) / device.rate;

  struct Mark {
    double time;  // s
    const char* what;
  };
  constexpr std::array<Mark, 7> marks = {{{2.9, "at rest"},
                                          {4.8, "on the ground"},
                                          {8.6, "after the clutch"},
                                          {11, "on the ground"},
                                          {13.2, "at the envelope"},
                                          {17.1, "after the clutch"},
                                          {19, "on the ground"}}};
  std::array<Sight, marks.size()> at;
  std::size_t seen = 0;
  std::FILE* table = std::fopen(argv[2], "w");
  if (!table) {
    std::perror(argv[2]);
    return 1;
  }
  std::fprintf(table,
               "time,clutch,slide x,slide y,slide z,tip x,tip y,tip z,ground,too high,ground's force,"
               "envelope's force\n");
  std::printf("   time                              slide      the ground is felt    ground   envelope\n");
  bool is_held = false;
  while (seen < marks.size()) {
    if (!beat.wait(0.01)) return 1;  // Ctrl-C
    check(fs_scene_get_time(scene, &now));
    const double time = now - begin;
    // The hand goes from its first place to another while the clutch is held, and much later from there back.
    const bool hold = (time > 6 && time < 8.2) || (time > 14.4 && time < 16.2);
    if (hold != is_held) {
      check(fs_scene_set_clutch(scene, hold));
      is_held = hold;
      std::printf("%5.1f s   the clutch of the terrain is %s\n", time, hold ? "held" : "released");
    }
    const Sight sight = look(scene);
    std::fprintf(table, "%.3f,%d,%.4f,%.4f,%.4f,%.4f,%.4f,%.4f,%.4f,%.4f,%.3f,%.3f\n", time, is_held, sight.slide.x,
                 sight.slide.y, sight.slide.z, sight.tip.x, sight.tip.y, sight.tip.z, sight.ground, sight.too_high,
                 sight.ground_force, sight.envelope_force);
    if (time < marks[seen].time) continue;
    at[seen] = sight;
    char felt[24] = "-";
    if (std::isfinite(sight.too_high)) std::snprintf(felt, sizeof felt, "%.0f mm too high", 1e3 * sight.too_high);
    std::printf("%5.1f s   %-22s %5.0f mm   %20s   %5.1f N   %5.1f N\n", time, marks[seen].what, 1e3 * length(sight.slide), felt,
                sight.ground_force, sight.envelope_force);
    ++seen;
  }
  std::fclose(table);
  fs_scene_destroy(scene);

  const double slide = length(at[2].slide);
  std::printf("\n");
  expect(length(at[0].slide) < 0.005, "at first the worlds agree");
  expect(at[1].ground_force > 1 && std::fabs(at[1].too_high) < 0.005, "and the ground is felt where it is");
  expect(slide > 0.15 && slide < 0.32, "a hand that moves while one clutch is held makes that world slide");
  const fs_vec3 change = {at[3].slide.x - at[2].slide.x, at[3].slide.y - at[2].slide.y, at[3].slide.z - at[2].slide.z};
  expect(length(change) < 0.005, "the slide stays when the clutch is released");
  expect(at[3].ground_force > 1 && at[3].too_high > 0.1, "the ground is then felt where it is not");
  expect(at[4].envelope_force > 1 && length(at[4].tip) > 1.2 && length(at[4].tip) < 1.3,
         "the envelope, which is in the arm's world, holds the hand where it is");
  expect(length(at[5].slide) < 0.02, "the clutch and the way back remove the slide");
  expect(at[6].ground_force > 1 && std::fabs(at[6].too_high) < 0.02, "and the ground is felt where it is");
  return failures > 0;
}
