// What the bound of the slope takes away from each kind of profile, in newtons and millimetres.
#include <algorithm>
#include <cmath>
#include <vector>

#include "boundary.h"
#include "scenes/handles.h"
#include "stability.h"

namespace stability {

using namespace scenes;

namespace {

struct Loss {
  double most = 0, at = 0;  // N, m
  double until = 0;         // m; beyond it less than 1 % of the force is lost
};

Loss loss_of(const fs_object& object, double slope, double sign) {
  constexpr size_t count = 100'000;
  constexpr double step = 1e-6;  // m
  std::vector<double> distances(count), raw(count), capped(count);
  for (size_t i = 0; i < count; ++i) distances[i] = sign * step * (static_cast<double>(i) + 1e-6);
  require(fs_object_evaluate_law(&object, 0, 0, distances.data(), count, raw.data()), "fs_object_evaluate_law");
  require(fs_object_evaluate_law(&object, slope, 0, distances.data(), count, capped.data()), "fs_object_evaluate_law");
  Loss out;
  for (size_t i = 0; i < count; ++i) {
    const double lost = std::fabs(raw[i]) - std::fabs(capped[i]);
    if (lost > out.most + 1e-9) out.most = lost, out.at = std::fabs(distances[i]);
    if (lost > 0.01 * std::fabs(raw[i]) + 1e-6) out.until = std::fabs(distances[i]);
  }
  return out;
}

}  // namespace

void print_caps(Report& report) {
  const double all = budget(DeviceModel{}).stiffness;
  report.title(format("What the bound of the slope takes away, on the device of this suite at 1 kHz: alone (%.0f N/m), and where four "
                      "such objects share it", all));
  report.note("most lost at this distance / from here on less than 1 % is lost");
  constexpr fs_sense pull = FS_SENSE_ATTRACTIVE, push = FS_SENSE_REPULSIVE;
  struct Row {
    const char* what;
    fs_primitive primitive;
    fs_profile profile;
    double reach = 0;
  };
  for (const Row& row : {
           Row{"wall, 1000 N/m to 10 N", FS_PRIMITIVE_PLANE, fs_profile_init(FS_PROFILE_LINEAR_INCREASING, pull, 1000, 0, 10)},
           Row{"wall, 20,000 N/m to 20 N", FS_PRIMITIVE_PLANE, fs_profile_init(FS_PROFILE_LINEAR_INCREASING, pull, 20'000, 0, 20)},
           Row{"point, constant 3 N", FS_PRIMITIVE_POINT, fs_profile_init(FS_PROFILE_CONSTANT, pull, 3, 0, 3)},
           Row{"point, linear 150 N/m + 1 N", FS_PRIMITIVE_POINT, fs_profile_init(FS_PROFILE_LINEAR_INCREASING, pull, 150, 1, 5)},
           Row{"point, linear 2 N - 100 N/m", FS_PRIMITIVE_POINT, fs_profile_init(FS_PROFILE_LINEAR_DECREASING, push, -100, 2, 5)},
           Row{"point, gaussian 5 N, 5 mm", FS_PRIMITIVE_POINT, fs_profile_init(FS_PROFILE_GAUSSIAN, pull, 5, 5e-3, 5)},
           Row{"point, quadratic 50 kN/m^2 to 10 N", FS_PRIMITIVE_POINT, fs_profile_init(FS_PROFILE_QUADRATIC, pull, 5e4, 0, 10)},
           Row{"point, inverse 0.02 N m to 10 N", FS_PRIMITIVE_POINT, fs_profile_init(FS_PROFILE_INVERSE, push, 0.02, 0, 10)},
           Row{"linear 150 N/m, cut at 10 mm", FS_PRIMITIVE_POINT, fs_profile_init(FS_PROFILE_LINEAR_INCREASING, pull, 150, 0, 5), 10e-3},
       }) {
    fs_object object = fs_object_init("x", row.primitive);
    const bool is_plane = row.primitive == FS_PRIMITIVE_PLANE;
    (is_plane ? object.back : object.front) = row.profile;
    object.front.reach = row.reach;
    std::string line = format("%-36s", row.what);
    for (const double slope : {all, all / 4}) {
      const Loss loss = loss_of(object, slope, is_plane ? -1 : 1);
      line += loss.most > 0 ? format(" | %5.2f N at %5.2f mm / %5.2f mm", loss.most, 1e3 * loss.at, 1e3 * loss.until)
                            : format(" | %-29s", "nothing");
    }
    report.note(line);
  }
}

}  // namespace stability
