// The arm's client: what the tip of the arm can reach, a closed mesh that the hand cannot leave.
#include <vector>

#include "../quickstart_source/beat.h"
#include "worlds.h"

// A segment of a spherical shell around the shoulder: 0.4 to 1.2 m away, 60 degrees up and down, 90 to the left and right.
static fs_shape* make_envelope() {
  const uint32_t rows = 24, turns = 36, around = 2 * (rows + 1);  // points of a section: outside upwards, inside downwards
  std::vector<fs_vec3> points;
  std::vector<uint32_t> faces;
  for (uint32_t turn = 0; turn <= turns; ++turn) {
    for (uint32_t i = 0; i < around; ++i) {
      const bool is_outside = i <= rows;
      const double radius = is_outside ? 1.2 : 0.4, azimuth = M_PI * (turn / double(turns) - 0.5);
      const double elevation = M_PI / 1.5 * ((is_outside ? i : around - 1 - i) / double(rows) - 0.5);
      points.push_back({radius * std::cos(elevation) * std::cos(azimuth), radius * std::cos(elevation) * std::sin(azimuth),
                        radius * std::sin(elevation)});
    }
  }
  // Two triangles; a, b, c, d run counter-clockwise as seen from outside, so the front is outside and the back inside.
  const auto add = [&](uint32_t a, uint32_t b, uint32_t c, uint32_t d) { faces.insert(faces.end(), {a, b, c, a, c, d}); };
  for (uint32_t turn = 0; turn < turns; ++turn) {
    for (uint32_t i = 0; i < around; ++i) {
      const uint32_t here = turn * around, next = here + around, j = (i + 1) % around;
      add(here + i, next + i, next + j, here + j);
    }
  }
  for (uint32_t i = 0; i < rows; ++i) {  // the two ends
    const uint32_t inner = around - 1 - i, end = turns * around;
    add(i, i + 1, inner - 1, inner);
    add(end + i, end + inner, end + inner - 1, end + i + 1);
  }
  fs_shape* shape;
  check(fs_shape_create_mesh(points.data(), points.size(), faces.data(), faces.size() / 3, &shape));
  return shape;
}

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: arm ENDPOINT    (such as shm:lab)\n");
    return 2;
  }
  Beat beat;
  fs_scene* scene;
  check(fs_scene_connect(argv[1], "arm", &scene));
  const fs_frame frame = arm_frame();
  check(fs_scene_set_frame(scene, &frame));
  fs_object envelope = fs_object_init("envelope", FS_PRIMITIVE_MESH);
  envelope.shape = make_envelope();
  envelope.contact.keep = FS_KEEP_BACK;
  envelope.contact.stiffness = 100;  // at the hand 6 times as steep
  envelope.contact.limit = 8;
  check(fs_object_set(scene, &envelope));
  fs_shape_destroy(envelope.shape);
  check(fs_scene_sync(scene, 2));
  std::printf("the envelope is at the server\n");
  std::fflush(stdout);
  while (beat.wait(0.1)) {
  }
  fs_scene_destroy(scene);
}
