#include "check_forces.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdio>
#include <limits>
#include <map>
#include <numeric>
#include <string_view>
#include <tuple>
#include <vector>

#include "program.h"
#include "turns.h"

bool has_sides(const fs_object& object) {
  return object.primitive == FS_PRIMITIVE_PLANE || object.primitive == FS_PRIMITIVE_MESH;
}

namespace {

const double slight = 0.1;  // N: a smaller jump is felt as a texture at most

bool is_expression(const fs_profile& profile) {
  return profile.kind == FS_PROFILE_CUSTOM && fs_curve_get_expression(profile.curve);
}

}  // namespace

double most(const fs_profile& profile, const Distances& range) {
  if (profile.kind == FS_PROFILE_NONE || range.least > range.most) return 0;
  if (profile.reach > 0 && range.least > profile.reach) return 0;
  if (is_expression(profile)) return profile.gain > 0 ? profile.limit : 0;  // it may depend on time
  double distances[256], forces[256];
  for (int i = 0; i < 256; ++i) distances[i] = range.least + (range.most - range.least) * i / 255;
  forceserver::throw_on_error(fs_profile_evaluate(&profile, 0, 0, distances, 256, forces));
  return *std::max_element(forces, forces + 256);
}

namespace {

// Whether an expression has the name t.
bool names_time(std::string_view expression) {
  const auto is_part = [](char c) { return std::isalnum(static_cast<unsigned char>(c)) || c == '_' || c == '.'; };
  for (std::size_t i = 0; i < expression.size(); ++i) {
    const std::size_t begin = i;
    while (i < expression.size() && is_part(expression[i])) ++i;
    if (expression.substr(begin, i - begin) == "t") return true;
  }
  return false;
}

// The force of a profile at a distance, N; for an expression, the largest at several times.
double force_at(const fs_profile& profile, double distance) {
  if (profile.kind == FS_PROFILE_NONE) return 0;
  const int times = is_expression(profile) ? 32 : 1;
  double most = 0;
  for (int i = 0; i < times; ++i) {
    double force = 0;
    forceserver::throw_on_error(fs_profile_evaluate(&profile, 0, 0.3141 * i, &distance, 1, &force));
    most = std::max(most, force);
  }
  return most;
}

bool is_closed(const fs_shape* shape) {
  fs_shape_info info = fs_shape_info_init();
  forceserver::throw_on_error(fs_shape_get_info(shape, &info));
  return info.has_inside;
}

}  // namespace

std::vector<double> volumes_of(const fs_shape* shape) {
  std::size_t points = 0, triangles = 0;
  const fs_vec3* const at = fs_shape_get_points(shape, &points);
  const uint32_t* const corners = fs_shape_get_triangles(shape, &triangles);
  std::vector<uint32_t> part(points);  // of each point: another of the same part; the first of a part: itself
  std::iota(part.begin(), part.end(), 0u);
  const auto first_of = [&](uint32_t i) {
    while (part[i] != i) i = part[i] = part[part[i]];
    return i;
  };
  const auto join = [&](uint32_t a, uint32_t b) {
    part[std::max(first_of(a), first_of(b))] = std::min(first_of(a), first_of(b));
  };
  std::map<std::tuple<double, double, double>, uint32_t> places;  // files repeat points
  for (uint32_t i = 0; i < points; ++i) join(i, places.try_emplace({at[i].x, at[i].y, at[i].z}, i).first->second);
  for (std::size_t i = 0; i < 3 * triangles; i += 3) join(corners[i], corners[i + 1]), join(corners[i], corners[i + 2]);
  std::map<uint32_t, double> volumes;
  for (std::size_t i = 0; i < 3 * triangles; i += 3) {
    const uint32_t first = first_of(corners[i]);
    const fs_vec3 a = minus(at[corners[i]], at[first]), b = minus(at[corners[i + 1]], at[first]),
                  c = minus(at[corners[i + 2]], at[first]);
    volumes[first] += (a.x * (b.y * c.z - b.z * c.y) + a.y * (b.z * c.x - b.x * c.z) + a.z * (b.x * c.y - b.y * c.x)) / 6;
  }
  std::vector<double> out;
  for (const auto& [first, volume] : volumes) out.push_back(volume);
  return out;
}

double volume_of(const fs_shape* shape) {
  const std::vector<double> parts = volumes_of(shape);
  return std::accumulate(parts.begin(), parts.end(), 0.0);
}

namespace {

// No place within a closed mesh is farther from its surface, m.
double half_of_thickness(const fs_shape* shape) {
  fs_shape_info info = fs_shape_info_init();
  forceserver::throw_on_error(fs_shape_get_info(shape, &info));
  const fs_vec3 size = minus(info.upper, info.lower);
  return 0.5 * std::min({size.x, size.y, size.z});
}

// The largest force of a profile at a distance or farther, within a range of them, N.
class Strongest {
 public:
  Strongest(const fs_profile& profile, const Distances& range) : range_(range), forces_(4096) {
    if (!(range.least < range.most)) return;
    std::vector<double> distances(forces_.size());
    for (std::size_t i = 0; i < distances.size(); ++i) {
      distances[i] = range.least + (range.most - range.least) * double(i) / double(distances.size() - 1);
    }
    forceserver::throw_on_error(fs_profile_evaluate(&profile, 0, 0, distances.data(), distances.size(), forces_.data()));
    if (is_expression(profile)) std::fill(forces_.begin(), forces_.end(), most(profile, range));
    for (std::size_t i = forces_.size() - 1; i-- > 0;) forces_[i] = std::max(forces_[i], forces_[i + 1]);
  }
  double beyond(double distance) const {
    if (!(distance < range_.most)) return 0;
    const double place = (distance - range_.least) / (range_.most - range_.least) * double(forces_.size() - 1);
    return forces_[std::size_t(std::max(0.0, place))];
  }

 private:
  Distances range_;
  std::vector<double> forces_;
};

// Finds the places where the force jumps. A hand that passes there feels a knock; a hand that rests there is shaken.
void check_jumps(const fs_object& object, const Sides& distances, Findings& findings) {
  const std::string name = object.name;
  const bool sides = has_sides(object);
  if (distances.front.least == 0 || distances.back.least == 0) {
    const auto along_normal = [](const fs_profile& profile, double side) {
      return (profile.sense == FS_SENSE_REPULSIVE ? side : -side) * force_at(profile, 0);
    };
    const double front = along_normal(object.front, 1), back = sides ? along_normal(object.back, -1) : -front;
    const double jump = std::abs(front - back);
    const bool goes_on = object.primitive == FS_PRIMITIVE_MESH && jump <= faint && std::abs(front) > faint;
    if (goes_on) {
      findings.add(name, "its force goes on through its surface, so it turns at once at an edge: a jump of up to %.3g N",
                   2 * std::abs(front));
    } else if (jump > faint && sides) {
      findings.add(name, "its force jumps at its surface, where front and back do not agree: a jump of %.3g N", jump);
    } else if (jump > faint) {
      findings.add(name, "its force reverses across its %s: a jump of %.3g N",
                   object.primitive == FS_PRIMITIVE_POINT ? "point" : "line", jump);
    }
  }
  for (const fs_profile* profile : {&object.front, &object.back}) {
    const double reach = profile->reach;
    const Distances& range = profile == &object.front ? distances.front : distances.back;
    if (!(reach > 0) || reach < range.least || reach > range.most) continue;
    const double jump = force_at(*profile, reach);
    const char* const side = !sides ? "" : profile == &object.front ? " in front" : " behind";
    if (jump <= faint) continue;
    findings.add(name, "its force%s ends at its reach of %s: a jump of %.3g N", side, metres(reach).c_str(), jump);
  }
  const double strongest = std::max(most(object.front, distances.front), most(object.back, distances.back));
  if (object.primitive == FS_PRIMITIVE_POLYLINE && strongest > faint) {
    const Strongest front(object.front, distances.front);
    const double jump = jump_between_parts(object.shape, [&](double distance) { return front.beyond(distance); });
    const char* const sentence = "its force changes its direction where two of its parts are equally near: a jump of up to";
    if (jump >= slight) findings.add(name, "%s %.3g N", sentence, jump);
    else if (jump > faint) std::printf("  note: %s: %s %.3g N\n", name.c_str(), sentence, jump);
  }
  if (object.primitive == FS_PRIMITIVE_MESH) {  // only a note: every mesh with such a force does this
    const double force = is_closed(object.shape)
                             ? most(object.back, {0, std::min(distances.back.most, half_of_thickness(object.shape))})
                             : strongest;
    if (force > faint) {
      std::printf(
          "  note: %s: where another of its faces becomes the nearest, as deep inside of it, its force changes "
          "its direction: a jump of up to %.3g N\n",
          name.c_str(), 2 * force);
    }
  }
}

// Looks at an expression in the first 20 s: a force that jumps in time knocks the hand, wherever it is.
void check_time(const std::string& name, const fs_profile& profile, const Distances& range, Findings& findings) {
  if (!is_expression(profile) || !names_time(fs_curve_get_expression(profile.curve)) || range.least > range.most) return;
  const int places = 32;
  const double seconds = 20, step = 0.01;
  double distances[places];
  for (int i = 0; i < places; ++i) distances[i] = range.least + (range.most - range.least) * i * i / (places * places);
  using Forces = std::array<double, places>;
  const auto at = [&](double time) {
    Forces forces;
    forceserver::throw_on_error(fs_profile_evaluate(&profile, 0, time, distances, places, forces.data()));
    return forces;
  };
  const auto change = [](const Forces& a, const Forces& b) {
    double most = 0;
    for (int i = 0; i < places; ++i) most = std::max(most, std::abs(b[i] - a[i]));
    return most;
  };
  // The steps with the largest changes are looked at more closely.
  std::vector<std::pair<double, double>> steps;  // N, s
  Forces before = at(0);
  for (int i = 1; i <= seconds / step; ++i) {
    const Forces now = at(i * step);
    steps.emplace_back(change(before, now), (i - 1) * step);
    before = now;
  }
  std::sort(steps.rbegin(), steps.rend());
  double jump = 0, when = 0;
  for (std::size_t i = 0; i < 16 && steps[i].first > std::max(faint, jump); ++i) {
    double begin = steps[i].second, end = begin + step;
    Forces first = at(begin), last = at(end);
    while (end - begin > 1e-7) {
      const double middle = (begin + end) / 2;
      const Forces half = at(middle);
      if (change(first, half) > change(half, last)) end = middle, last = half;
      else begin = middle, first = half;
    }
    if (change(first, last) > jump) jump = change(first, last), when = end;
  }
  if (jump >= slight) {
    findings.add(name, "its force jumps in time: by about %.2g N at %.4g s after its start", jump, when);
  } else if (steps[0].first > faint) {
    std::printf("  note: %s: its force changes with time, by up to %.3g N in 10 ms\n", name.c_str(), steps[0].first);
  }
}

// Finds profiles with a wrong sense or on the wrong side. Profiles on both sides are taken as intended: a plane that
// holds the hand at it, or a force that is the same everywhere, such as gravity.
void check_senses(const fs_object& object, const Sides& distances, Findings& findings) {
  const std::string name = object.name;
  const bool sides = has_sides(object);
  const bool front = most(object.front, distances.front) > faint, back = most(object.back, distances.back) > faint;
  const auto grows_without_end = [&](const fs_profile& profile) {
    return force_at(profile, distances.front.most) > force_at(profile, distances.front.least) + faint;
  };
  const bool is_room = object.primitive == FS_PRIMITIVE_MESH && is_closed(object.shape) && volume_of(object.shape) < 0;
  const bool pulls = front && object.front.sense == FS_SENSE_ATTRACTIVE && grows_without_end(object.front);
  if (sides && pulls && !back && !is_room) {
    findings.add(name,
                 "it pulls the hand towards it from everywhere in front, harder with the distance; for a wall "
                 "use \"back\" with sense attractive");
  }
  if (front && object.front.sense == FS_SENSE_REPULSIVE && grows_without_end(object.front)) {
    findings.add(name, "it pushes the hand away%s, harder with the distance", sides ? " in front" : "");
  }
  // Inside a mesh, a repulsive force that falls with the distance from the surface keeps the hand inside.
  const bool falls = force_at(object.back, distances.back.most) < force_at(object.back, distances.back.least) - faint;
  const bool keeps_within = object.primitive == FS_PRIMITIVE_MESH && falls;
  if (back && !front && object.back.sense == FS_SENSE_REPULSIVE && !keeps_within) {
    findings.add(name, "its back drives the hand deeper; for a wall use sense attractive");
  }
}

// Finds a point, path or mesh that pulls the hand with half of the device's force or more from nearly everywhere: from
// three quarters of all distances. force_max: of the device, N of the scene.
void check_pull(const fs_object& object, const Distances& range, double force_max, Findings& findings) {
  const fs_profile& profile = object.front;
  if (object.primitive == FS_PRIMITIVE_PLANE || profile.sense != FS_SENSE_ATTRACTIVE || profile.kind == FS_PROFILE_NONE) return;
  double least = std::numeric_limits<double>::infinity(), from = least;
  for (int i = 255; i >= 0; --i) {
    const double distance = range.least + (range.most - range.least) * i / 255;
    const double force = force_at(profile, distance);
    if (force < force_max / 2) break;
    least = std::min(least, force);
    from = distance;
  }
  if (from > range.least + (range.most - range.least) / 4) return;
  findings.add(object.name,
               "it pulls the hand with %.3g N or more from everywhere beyond %s: give it a smaller limit, "
               "or a force that falls with the distance",
               least, metres(from).c_str());
}

// Finds a plane that has the whole workspace behind it, and so pushes the hand wherever it is. One that is the same on both sides
// is meant so.
void check_behind(const fs_object& object, const Sides& distances, Findings& findings) {
  if (object.primitive != FS_PRIMITIVE_PLANE || distances.front.least <= distances.front.most) return;
  if (object.front.kind != FS_PROFILE_NONE && object.back.kind <= FS_PROFILE_CONSTANT) return;
  const double force = most(object.back, distances.back);
  if (force <= faint || distances.back.least <= 0) return;
  findings.add(object.name, "the hand is behind it wherever it is, by %s at least: it is pushed with up to %.3g N all the time",
               metres(distances.back.least).c_str(), force);
}

}  // namespace

Sides distances_of(const fs_object& object, const Workspace& workspace) {
  fs_pose inverse = object.pose;
  inverse.orientation = {object.pose.orientation.w, -object.pose.orientation.x, -object.pose.orientation.y,
                         -object.pose.orientation.z};
  const fs_vec3 centre = rotate(inverse.orientation, minus(workspace.centre, object.pose.position));
  const Distances never = {1, 0};
  if (object.primitive == FS_PRIMITIVE_PLANE) {
    const double along = rotate(inverse.orientation, workspace.axis).z;  // the cosine between its normal and the axis
    const double half = workspace.cylinder_radius * std::sqrt(std::fmax(0, 1 - along * along)) +
                        workspace.half_height * std::abs(along) + workspace.tool_length;
    const double lowest = centre.z - half, highest = centre.z + half;
    return {highest > 0 ? Distances{std::max(0.0, lowest), highest} : never,
            lowest < 0 ? Distances{std::max(0.0, -highest), -lowest} : never};
  }
  double distance = length(centre);
  if (object.shape) {
    fs_shape_info info = fs_shape_info_init();
    forceserver::throw_on_error(fs_shape_get_info(object.shape, &info));
    distance = length({std::max({info.lower.x - centre.x, 0.0, centre.x - info.upper.x}),
                       std::max({info.lower.y - centre.y, 0.0, centre.y - info.upper.y}),
                       std::max({info.lower.z - centre.z, 0.0, centre.z - info.upper.z})});
  }
  const double least = std::max(0.0, distance - workspace.radius);
  const Distances all = {least, least + 2 * workspace.radius + length(object.pose.position)};
  if (object.primitive != FS_PRIMITIVE_MESH) return {all, never};
  return {all, least > 0 && is_closed(object.shape) ? never : all};  // the back of a closed mesh is its inside
}

void check_forces(const fs_object& object, const Sides& distances, double force_max, Findings& findings) {
  check_behind(object, distances, findings);
  check_jumps(object, distances, findings);
  check_time(object.name, object.front, distances.front, findings);
  check_time(object.name, object.back, distances.back, findings);
  check_senses(object, distances, findings);
  check_pull(object, distances.front, force_max, findings);
}
