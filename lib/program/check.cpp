// forceserver check: describes a scene or a mesh, and reports what is odd in it.
#include <algorithm>
#include <cctype>
#include <cstdarg>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <string_view>
#include <vector>

#include "program.h"
#include "words.h"

namespace {

const double faint = 1e-3;  // N: nobody feels a smaller force

class Findings {
 public:
  [[gnu::format(printf, 3, 4)]] void add(const std::string& name, const char* format, ...) {
    std::printf("  odd: %s%s", name.c_str(), name.empty() ? "" : ": ");
    va_list arguments;
    va_start(arguments, format);
    std::vprintf(format, arguments);
    va_end(arguments);
    std::printf("\n");
    ++count_;
  }
  int finish() const {
    if (count_ == 0) std::printf("nothing odd\n");
    else std::printf("%d odd %s\n", count_, count_ == 1 ? "thing" : "things");
    return count_ == 0 ? exit_fine : exit_odd;
  }

 private:
  int count_ = 0;
};

// A length as text, in a unit that suits its size.
std::string metres(double value) {
  char text[32];
  const double size = std::abs(value);
  if (size >= 1000) std::snprintf(text, sizeof text, "%.4g km", value / 1000);
  else if (size >= 1 || size == 0) std::snprintf(text, sizeof text, "%.4g m", value);
  else if (size >= 1e-3) std::snprintf(text, sizeof text, "%.4g mm", value * 1e3);
  else std::snprintf(text, sizeof text, "%.4g um", value * 1e6);
  return text;
}

fs_vec3 minus(const fs_vec3& a, const fs_vec3& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }

fs_vec3 rotate(const fs_quat& q, const fs_vec3& v) {
  const fs_vec3 t = {2 * (q.y * v.z - q.z * v.y), 2 * (q.z * v.x - q.x * v.z), 2 * (q.x * v.y - q.y * v.x)};
  return {v.x + q.w * t.x + q.y * t.z - q.z * t.y, v.y + q.w * t.y + q.z * t.x - q.x * t.z,
          v.z + q.w * t.z + q.x * t.y - q.y * t.x};
}

fs_shape_info describe(const fs_shape* shape) {
  fs_shape_info info = fs_shape_info_init();
  require(fs_shape_get_info(shape, &info));
  std::size_t points = 0, triangles = 0;
  fs_shape_get_points(shape, &points);
  fs_shape_get_triangles(shape, &triangles);
  const fs_vec3 size = minus(info.upper, info.lower);
  if (info.primitive == FS_PRIMITIVE_MESH) {
    std::printf("%s mesh of %zu %s and %zu points", info.closed ? "a closed" : "an open", triangles,
                triangles == 1 ? "triangle" : "triangles", points);
  } else {
    std::printf("%s polyline of %zu points", info.closed ? "a closed" : "an open", points);
  }
  std::printf(", %s x %s x %s", metres(size.x).c_str(), metres(size.y).c_str(), metres(size.z).c_str());
  return info;
}

void check_shape(const std::string& name, const fs_shape* shape, Findings& findings) {
  fs_shape_info info = fs_shape_info_init();
  require(fs_shape_get_info(shape, &info));
  std::size_t triangles = 0;
  fs_shape_get_triangles(shape, &triangles);
  auto plural = [](std::uint64_t n, const char* one, const char* many) { return n == 1 ? one : many; };
  using Count = unsigned long long;

  if (info.open_edges > 0) {
    findings.add(name, "%llu open %s: the mesh has holes or a border, where front and back meet",
                 Count(info.open_edges), plural(info.open_edges, "edge", "edges"));
  }
  if (info.odd_edges > 0) {
    findings.add(name, "%llu odd %s: of three or more triangles, or of two that disagree about the front",
                 Count(info.odd_edges), plural(info.odd_edges, "edge", "edges"));
  }
  if (info.degenerate > 0) {
    findings.add(name, "%llu %s without area", Count(info.degenerate),
                 plural(info.degenerate, "triangle", "triangles"));
  }
  if (triangles > 2000000) {
    findings.add(name, "%zu triangles: it takes seconds until it can be felt, and about %zu MB", triangles,
                 triangles * 150 / 1000000);
  }
  const fs_vec3 size = minus(info.upper, info.lower);
  const double across = length(size), far = std::max(length(info.lower), length(info.upper));
  if (across == 0) findings.add(name, "all its points are the same");
  // Mesh files mostly hold single precision: 24 bits.
  const double rounded = far * std::numeric_limits<float>::epsilon() / 2;
  if (across > 0 && rounded > 1e-4 * across) {
    findings.add(name, "it lies %s from its origin but is only %s across: single precision, as in most files, rounds "
                 "its points by %s", metres(far).c_str(), metres(across).c_str(), metres(rounded).c_str());
  }
}

int check_mesh(const CheckOptions& options) {
  const Shape shape = open<Shape>(fs_shape_load, options.file.c_str(), options.scale);
  std::printf("%s: ", options.file.c_str());
  const fs_shape_info info = describe(shape.get());
  std::printf("\n");
  Findings findings;
  check_shape("", shape.get(), findings);
  const double across = length(minus(info.upper, info.lower));
  if (across > 10 || (across > 0 && across < 1e-3)) {
    findings.add("", "%s across at %g m per unit of the file: is another --scale meant (0.001: millimetres)?",
                 metres(across).c_str(), options.scale);
  }
  return findings.finish();
}

// "linear increasing"
std::string kind_name(fs_profile_kind kind) {
  std::string words = word_of(fs_profile_kind_name(kind));
  std::replace(words.begin(), words.end(), '_', ' ');
  return words;
}

void describe_profile(const char* side, const fs_profile& profile) {
  if (profile.kind == FS_PROFILE_NONE) return;
  std::printf("; %s%s %s, at most %g N", side, profile.sense == FS_SENSE_ATTRACTIVE ? "attractive" : "repulsive",
              kind_name(profile.kind).c_str(), profile.limit);
  if (profile.reach > 0) std::printf(" within %s", metres(profile.reach).c_str());
}

// The range of distances between one side of an object and the hand, m. If the hand never comes to this side, `least`
// is larger than `most`.
struct Distances {
  double least, most;
};

// The largest force of a profile within a range of distances, N.
double most(const fs_profile& profile, const Distances& range) {
  if (profile.kind == FS_PROFILE_NONE || range.least > range.most) return 0;
  if (profile.reach > 0 && range.least > profile.reach) return 0;
  if (profile.kind == FS_PROFILE_CUSTOM) return profile.gain > 0 ? profile.limit : 0;  // it may depend on time
  double distances[256], forces[256];
  for (int i = 0; i < 256; ++i) distances[i] = range.least + (range.most - range.least) * i / 255;
  require(fs_profile_evaluate(&profile, 0, 0, distances, 256, forces));
  return *std::max_element(forces, forces + 256);
}

// The force of a profile at a distance, N; for an expression, the largest at several times.
double force_at(const fs_profile& profile, double distance) {
  if (profile.kind == FS_PROFILE_NONE) return 0;
  const int times = profile.curve && fs_curve_get_expression(profile.curve) ? 32 : 1;
  double most = 0;
  for (int i = 0; i < times; ++i) {
    double force = 0;
    require(fs_profile_evaluate(&profile, 0, 0.3141 * i, &distance, 1, &force));
    most = std::max(most, force);
  }
  return most;
}

bool has_sides(const fs_object& object) {
  return object.primitive == FS_PRIMITIVE_PLANE || object.primitive == FS_PRIMITIVE_MESH;
}

// The distances on both sides; an object without sides has only a front.
struct Sides {
  Distances front, back;
};

bool is_closed(const fs_shape* shape) {
  fs_shape_info info = fs_shape_info_init();
  require(fs_shape_get_info(shape, &info));
  return info.closed;
}

// A polyline that is not straight asks for an infinite stiffness with any profile (fs_report).
bool is_bent(fs_shape* shape) {
  const Scene scene = open<Scene>(fs_scene_create);
  fs_object probe = fs_object_init("probe", FS_PRIMITIVE_POLYLINE);
  probe.shape = shape;
  probe.front = fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, 1, 0, 1);
  require(fs_object_set(scene.get(), &probe));
  fs_report report;
  require(fs_scene_get_report(scene.get(), probe.name, &report));
  return !std::isfinite(report.stiffness_wanted);
}

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
      findings.add(name, "its force jumps at its surface, where front and back do not agree: a jump of %.3g N",
                   jump);
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
  if (object.primitive == FS_PRIMITIVE_POLYLINE && strongest > faint && is_bent(object.shape)) {
    findings.add(name, "its force changes its direction where two of its parts are equally near: a jump of up "
                 "to %.3g N", 2 * strongest);
  }
  if (object.primitive == FS_PRIMITIVE_MESH && strongest > faint) {  // only a note: every solid mesh does this
    std::printf("  note: %s: where another of its faces becomes the nearest, as deep inside of it, its force changes "
                "its direction: a jump of up to %.3g N\n", name.c_str(), 2 * strongest);
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
  const bool is_room = object.primitive == FS_PRIMITIVE_MESH && is_closed(object.shape);  // the hand cannot leave it
  const bool pulls = front && object.front.sense == FS_SENSE_ATTRACTIVE && grows_without_end(object.front);
  if (sides && pulls && !back && !is_room) {
    findings.add(name, "it pulls the hand towards it from everywhere in front, harder with the distance; for a wall "
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

struct Workspace {  // in scene metres
  fs_vec3 centre;
  double radius;  // of the sphere around the device's cylinder
};

// Lower and upper bounds of the distances between an object and the hand in the workspace.
Sides distances_of(const fs_object& object, const Workspace& workspace) {
  fs_pose inverse = object.pose;
  inverse.orientation = {object.pose.orientation.w, -object.pose.orientation.x, -object.pose.orientation.y,
                         -object.pose.orientation.z};
  const fs_vec3 centre = rotate(inverse.orientation, minus(workspace.centre, object.pose.position));
  const Distances never = {1, 0};
  if (object.primitive == FS_PRIMITIVE_PLANE) {
    const double lowest = centre.z - workspace.radius, highest = centre.z + workspace.radius;
    return {highest > 0 ? Distances{std::max(0.0, lowest), highest} : never,
            lowest < 0 ? Distances{std::max(0.0, -highest), -lowest} : never};
  }
  double distance = length(centre);
  if (object.shape) {
    fs_shape_info info = fs_shape_info_init();
    require(fs_shape_get_info(object.shape, &info));
    distance = length({std::max({info.lower.x - centre.x, 0.0, centre.x - info.upper.x}),
                       std::max({info.lower.y - centre.y, 0.0, centre.y - info.upper.y}),
                       std::max({info.lower.z - centre.z, 0.0, centre.z - info.upper.z})});
  }
  const double least = std::max(0.0, distance - workspace.radius);
  const Distances all = {least, least + 2 * workspace.radius + length(object.pose.position)};
  if (object.primitive != FS_PRIMITIVE_MESH) return {all, never};
  return {all, least > 0 && is_closed(object.shape) ? never : all};  // the back of a closed mesh is its inside
}

// Finds a point or path that pulls the hand with half of the device's force or more from nearly everywhere: from
// three quarters of all distances. force_max: of the device, N of the scene.
void check_pull(const fs_object& object, const Distances& range, double force_max, Findings& findings) {
  const fs_profile& profile = object.front;
  if (has_sides(object) || profile.sense != FS_SENSE_ATTRACTIVE || profile.kind == FS_PROFILE_NONE) return;
  double least = std::numeric_limits<double>::infinity(), from = least;
  for (int i = 255; i >= 0; --i) {
    const double distance = range.least + (range.most - range.least) * i / 255;
    const double force = force_at(profile, distance);
    if (force < force_max / 2) break;
    least = std::min(least, force);
    from = distance;
  }
  if (from > range.least + (range.most - range.least) / 4) return;
  findings.add(object.name, "it pulls the hand with %.3g N or more from everywhere beyond %s: give it a smaller limit, "
               "or a force that falls with the distance", least, metres(from).c_str());
}

// What the objects of a scene are checked against.
struct Surroundings {
  Workspace workspace;
  fs_device_info device;
  double force_scale;
  std::size_t tool_points;
};

// rendered: what the servo can render of all objects together (fs_servo_stats).
void check_slope(const fs_object& object, const fs_report& report, const fs_servo_stats& rendered, double rate,
                 Findings& findings) {
  const double slope = report.stiffness_wanted, most = rendered.max_stiffness;
  if (!object.enabled || !std::isfinite(slope)) return;  // a jump is told elsewhere
  if (slope > most) {
    findings.add(object.name, "its slope of %.4g N/m at the device would shake it when nobody holds it: a servo at %g Hz with "
                 "a local damping of %.3g N s/m renders %.4g N/m, shared by all that overlap, and reduces it to %.4g N/m", slope,
                 rate, rendered.damping,
                 most, report.stiffness_applied);
  } else if (report.stiffness_applied < 0.99 * slope) {
    std::printf("  note: %s: its steepest slope is %.4g N/m at the device; a servo reduces it to %.4g N/m, because what is "
                "felt at one place shares %.4g N/m\n", object.name, slope, report.stiffness_applied, most);
  }
}

void check_object(const fs_object& object, const Surroundings& around, Findings& findings) {
  const std::string name = object.name;
  if (object.shape) check_shape(name, object.shape, findings);
  if (!object.enabled) findings.add(name, "it is disabled, so it is not felt");
  const bool solid = object.contact.keep != FS_KEEP_NONE;
  const bool profiles = object.front.kind != FS_PROFILE_NONE || object.back.kind != FS_PROFILE_NONE;
  const Sides distances = distances_of(object, around.workspace);
  const bool front_first = distances.front.least <= distances.front.most;
  const double away = (front_first ? distances.front : distances.back).least;
  if (!solid && !profiles) {
    findings.add(name, "it has no profile and is not solid, so it is not felt");
  } else if (profiles) {
    const double most_force = std::max(most(object.front, distances.front), most(object.back, distances.back));
    const bool damps = object.damping > 0 && most_force > 0;  // even if the force itself is too faint to feel
    const bool is_felt = most_force >= faint || damps || solid;
    if (!is_felt && away == 0) {
      findings.add(name, "its force is 0 wherever the hand gets");
    } else if (!is_felt) {
      findings.add(name, "the hand cannot get %s: it is at least %s of the scene away from the device's workspace",
                   has_sides(object) ? "to the side on which it is felt" : "near enough to feel it",
                   metres(away).c_str());
    }
    check_jumps(object, distances, findings);
    check_senses(object, distances, findings);
    check_pull(object, distances.front, around.device.force_max / around.force_scale, findings);
  } else if (away > 0) {
    findings.add(name, "it lies %s of the scene outside of the device's workspace", metres(away).c_str());
  }
  const double limit = std::max({object.front.limit, object.back.limit, object.contact.limit});
  const double force_max = around.device.force_max;
  if (limit > force_max) findings.add(name, "its limit of %g N is above the device's %g N", limit, force_max);
  const std::uint32_t points = around.tool_points >= 32 ? ~0u : (1u << around.tool_points) - 1;
  if (object.tool_points != 0 && (object.tool_points & points) == 0) {
    findings.add(name, "its tool_points select none of the tool's points, of which there are %zu",
                 around.tool_points);
  } else if (object.tool_points & ~points) {
    findings.add(name, "its tool_points select points that the tool does not have: it has %zu", around.tool_points);
  }
}

int check_scene(const CheckOptions& options) {
  const Scene scene = open<Scene>(fs_scene_create);
  require(fs_scene_load(scene.get(), options.file.c_str()));
  const Device device = open<Device>(fs_device_open, options.device.c_str());
  fs_device_info info = fs_device_info_init();
  require(fs_device_get_info(device.get(), &info));
  fs_frame frame = fs_frame_init();
  require(fs_scene_get_frame(scene.get(), nullptr, &frame));
  fs_vec3 tool[FS_TOOL_POINTS_MAX];
  std::size_t tool_points = 0;
  require(fs_scene_get_tool(scene.get(), tool, std::size(tool), &tool_points));
  double tool_length = 0;  // from the handle to its farthest point, m
  for (std::size_t i = 0; i < tool_points; ++i) tool_length = std::max(tool_length, length(tool[i]));

  // One tick of a servo shows which slopes it renders.
  fs_servo_options servo_options = fs_servo_options_init();
  servo_options.mode = FS_SERVO_VIRTUAL;
  Servo servo = open<Servo>(fs_servo_start, scene.get(), device.get(), &servo_options);
  const fs_status status = fs_servo_step(servo.get(), 1);
  if (status != FS_ERROR_DISCONNECTED) require(status);  // a device behind a link is not ready at once
  std::size_t count = 0;
  require(fs_scene_get_reports(scene.get(), nullptr, 0, &count));
  std::vector<fs_report> reports(count);
  require(fs_scene_get_reports(scene.get(), reports.data(), count, &count));
  fs_servo_stats rendered = fs_servo_stats_init();
  require(fs_scene_get_servo_stats(scene.get(), &rendered));
  servo.reset();  // each reader of an expression has to parse it, which takes longer than anything else here

  std::printf("%s: a scene of %zu %s for a tool of %zu %s; ", options.file.c_str(), count,
              count == 1 ? "object" : "objects", tool_points, tool_points == 1 ? "point" : "points");
  if (frame.scale == 1) std::printf("scale 1:1\n");
  else std::printf("a metre of the device is %s of the scene\n", metres(frame.scale).c_str());
  Findings findings;
  if (count == 0) findings.add("", "it is empty");
  if (frame.force_scale == 0) findings.add("", "its force_scale is 0, so nothing is felt");
  const fs_quat& q = frame.pose.orientation;
  const fs_vec3 centre = rotate({q.w, -q.x, -q.y, -q.z}, frame.pose.position);
  const double radius = std::hypot(info.workspace_radius, info.workspace_height / 2) * frame.scale + tool_length;
  const Workspace workspace = {{-centre.x * frame.scale, -centre.y * frame.scale, -centre.z * frame.scale}, radius};
  const Surroundings around = {workspace, info, frame.force_scale, tool_points};
  for (const fs_report& report : reports) {
    fs_object object = fs_object_init("", FS_PRIMITIVE_POINT);
    require(fs_object_get(scene.get(), report.name, &object));
    const std::unique_ptr<fs_object, Release<fs_object_release>> released(&object);
    std::printf("%s: ", object.name);
    if (object.shape) describe(object.shape);
    else std::printf("%s", object.primitive == FS_PRIMITIVE_PLANE ? "a plane" : "a point");
    describe_profile(has_sides(object) ? "front " : "", object.front);
    describe_profile("back ", object.back);
    if (object.contact.keep != FS_KEEP_NONE) std::printf("; solid");
    if (!std::isfinite(report.stiffness_wanted)) std::printf("; infinitely steep where it jumps");
    else if (report.stiffness_wanted > 0) std::printf("; steepest slope %.4g N/m at the device", report.stiffness_wanted);
    std::printf("\n");
    check_object(object, around, findings);
    check_slope(object, report, rendered, info.rate, findings);
  }
  return findings.finish();
}

}  // namespace

int check(const CheckOptions& options) {
  std::string extension = std::filesystem::path(options.file).extension().string();
  for (char& c : extension) c = char(std::tolower(static_cast<unsigned char>(c)));
  return extension == ".json" ? check_scene(options) : check_mesh(options);
}
