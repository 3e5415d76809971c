// crossings [COUNT]: hands cross the surfaces of solid meshes as often as COUNT says (10,000), at up to 0.5 m/s, and no proxy
// may come through. Prints how far it is; ends with 1 if one has passed.
#include <cstdio>
#include <cstdlib>

#include <unistd.h>

#include "api/hand.h"

using namespace scenes;

namespace {

// A square sheet of cells x cells squares, of two triangles each, over which the height changes at random.
struct Sheet {
  static constexpr double half = 0.05;  // m
  int cells;
  MeshData mesh;

  Sheet(Random& random, int cells, double height) : cells(cells) {
    const auto n = static_cast<uint32_t>(cells + 1);
    for (uint32_t i = 0; i < n; ++i) {
      for (uint32_t k = 0; k < n; ++k) {
        mesh.points.push_back({half * (2.0 * k / cells - 1), half * (2.0 * i / cells - 1), height * random.between(-1, 1)});
      }
    }
    for (uint32_t i = 0; i + 1 < n; ++i) {
      for (uint32_t k = 0; k + 1 < n; ++k) {
        const uint32_t a = i * n + k, c = a + n + 1;
        mesh.triangles.insert(mesh.triangles.end(), {a, a + 1, c, a, c, a + n});
      }
    }
  }
  // Of the sheet above a place.
  double height_at(double x, double y) const {
    const double u = (x / half + 1) / 2 * cells, v = (y / half + 1) / 2 * cells;
    const int k = std::clamp(static_cast<int>(u), 0, cells - 1), i = std::clamp(static_cast<int>(v), 0, cells - 1);
    const double s = u - k, t = v - i;
    const auto z = [&](int row, int column) { return mesh.points[static_cast<size_t>(row * (cells + 1) + column)].z; };
    const double far = z(i + 1, k + 1);
    return s >= t ? z(i, k) + s * (z(i, k + 1) - z(i, k)) + t * (far - z(i, k + 1))
                  : z(i, k) + t * (z(i + 1, k) - z(i, k)) + s * (far - z(i + 1, k));
  }
};

struct Count {
  long done = 0, all = 0, passed = 0;
  void add(bool is_through, const char* what, fs_vec3 proxy) {
    if (is_through && ++passed <= 10) std::printf("%s: a proxy has come through, to %.17g %.17g %.17g\n", what, proxy.x, proxy.y, proxy.z);
    if (++done % std::max(1L, all / 100) == 0 && isatty(STDERR_FILENO)) {
      std::fprintf(stderr, "\r%ld of %ld crossings, %ld through", done, all, passed);
    }
  }
};

Count count{.all = 10'000};

// From above it goes through the sheet, farther and about below it, and comes back.
void cross(const Sheet& sheet, long times, Random& random) {
  Hand hand;
  fs_contact contact = solid(FS_KEEP_FRONT);
  contact.friction = random.between(0, 1) < 0.3 ? random.between(0, 1) : 0;
  hand.mesh("sheet", sheet.mesh, contact);
  constexpr double within = 0.8 * Sheet::half;
  for (long i = 0; i < times; ++i) {
    const double x = random.between(-within, within), y = random.between(-within, within);
    const double step = 0.0005 * random.between(0.05, 1);
    hand.slide({x, y, sheet.height_at(x, y) + random.between(1e-6, 2e-4)}, hand.is_placed ? 0.01 : step);
    hand.slide({std::clamp(x + random.between(-1e-3, 1e-3), -within, within),
                std::clamp(y + random.between(-1e-3, 1e-3), -within, within), sheet.height_at(x, y) - random.between(1e-5, 1e-3)},
               step);
    const fs_vec3 p = hand.proxy();
    count.add(p.z < sheet.height_at(p.x, p.y), "sheet", p);
    hand.slide({hand.x.x, hand.x.y, 0.02}, 0.01);
  }
}

// From anywhere to anywhere through a closed mesh.
void cross(const MeshData& mesh, const char* what, long times, Random& random) {
  Hand hand;
  hand.mesh("body", mesh, solid(FS_KEEP_FRONT));
  hand.go({0, 0, 0.1});
  for (long done = 0; done < times;) {
    const fs_vec3 from = hand.x, to = random.in_box(0.05);
    const double step = 0.0005 * random.between(0.1, 1);
    const int ticks = static_cast<int>(std::ceil(norm(to - from) / step));
    bool was_touching = false;
    for (int k = 1; k <= ticks; ++k) {
      hand.go(from + (static_cast<double>(k) / ticks) * (to - from));
      const bool has_crossed = hand.touches() && !was_touching;
      was_touching = hand.touches();
      if (!has_crossed && !(was_touching && k == ticks)) continue;
      count.add(std::fabs(winding(mesh, hand.proxy())) > 0.6, what, hand.proxy());
      ++done;
    }
  }
}

START_TEST(no_proxy_comes_through) {
  Random random(11);
  const long part = count.all / 8 + 1;
  for (const double height : {0.0, 1e-5, 5e-4, 3e-3}) cross(Sheet(random, 60, height), part, random);
  cross(box_mesh({0.03, 0.03, 0.0005}), "slab of 1 mm", part, random);
  cross(wedge(20), "wedge of 20 degrees", part, random);
  cross(sphere_mesh(0.03, 500), "sphere", part, random);
  cross(torus_mesh(0.03, 0.01, 600), "torus", part, random);
  std::printf("%ld crossings, %ld through\n", count.done, count.passed);
  ck_assert_int_eq(count.passed, 0);
}
END_TEST

}  // namespace

int main(int argc, char** argv) {
  if (argc > 1) count.all = std::atol(argv[1]);
  setenv("CK_TIMEOUT_MULTIPLIER", "20", 0);  // a million take some minutes
  Suite* const suite = suite_create("crossings");
  add_case(suite, "all", {no_proxy_comes_through});
  return run_suite(suite);
}
