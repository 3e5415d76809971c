// forceserver check: describes a scene or a mesh, and reports what is odd in it.
#include <algorithm>
#include <cctype>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <vector>

#include "check_forces.h"
#include "program.h"
#include "words.h"

namespace {

const double far_away = 20;  // radii of the workspace: nobody means such a distance

fs_shape_info describe(fs_shape* shape) {
  forceserver::throw_on_error(fs_shape_build(shape));  // only then it is known whether its parts meet
  fs_shape_info info = fs_shape_info_init();
  forceserver::throw_on_error(fs_shape_get_info(shape, &info));
  std::size_t points = 0, triangles = 0;
  fs_shape_get_points(shape, &points);
  fs_shape_get_triangles(shape, &triangles);
  const fs_vec3 size = minus(info.upper, info.lower);
  if (info.primitive == FS_PRIMITIVE_MESH) {
    std::printf("%s mesh of %zu %s and %zu points", info.has_inside ? "a closed" : "an open", triangles,
                triangles == 1 ? "triangle" : "triangles", points);
  } else {
    std::printf("%s polyline of %zu points", info.closed ? "a closed" : "an open", points);
  }
  std::printf(", %s x %s x %s", metres(size.x).c_str(), metres(size.y).c_str(), metres(size.z).c_str());
  if (info.united) std::printf(", of parts that meet: for profiles they are one body");
  return info;
}

void note_inward_parts(const std::string& name, const fs_shape* shape) {
  const std::vector<double> volumes = volumes_of(shape);
  const auto inward = static_cast<std::size_t>(std::count_if(volumes.begin(), volumes.end(), [](double v) { return v < 0; }));
  if (inward == 0) return;
  std::printf("  note: %s%s", name.c_str(), name.empty() ? "" : ": ");
  if (inward == volumes.size()) {
    std::printf("its triangles face inwards: its front is inside, as that of a room\n");
  } else {
    std::printf(
        "the triangles of %zu of its %zu parts face inwards: such a part is a hollow in another that it lies in or "
        "overlaps, and by itself its front is inside\n",
        inward, volumes.size());
  }
}

// is_sheet: it is solid on both sides and has no profiles, so it needs no inside.
void check_shape(const std::string& name, const fs_shape* shape, bool is_sheet, Findings& findings) {
  fs_shape_info info = fs_shape_info_init();
  forceserver::throw_on_error(fs_shape_get_info(shape, &info));
  std::size_t triangles = 0;
  fs_shape_get_triangles(shape, &triangles);
  auto plural = [](std::uint64_t n, const char* one, const char* many) { return n == 1 ? one : many; };
  using Count = unsigned long long;

  const char* const undecided = "so inside and outside are not decided everywhere: the nearest triangle tells the side";
  const bool is_undecided = !info.has_inside && !is_sheet;
  if (info.open_edges > 0 && is_undecided) {
    findings.add(name, "%llu open %s: the mesh has holes or a border, where front and back meet, %s", Count(info.open_edges),
                 plural(info.open_edges, "edge", "edges"), undecided);
  }
  if (info.odd_edges > 0 && is_undecided) {
    findings.add(name, "%llu odd %s: of three or more triangles, or of two that disagree about the front, %s",
                 Count(info.odd_edges), plural(info.odd_edges, "edge", "edges"), undecided);
  }
  if (info.has_inside) note_inward_parts(name, shape);
  if (info.degenerate > 0) {
    findings.add(name, "%llu %s without area", Count(info.degenerate), plural(info.degenerate, "triangle", "triangles"));
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
    findings.add(name,
                 "it lies %s from its origin but is only %s across: single precision, as in most files, rounds "
                 "its points by %s",
                 metres(far).c_str(), metres(across).c_str(), metres(rounded).c_str());
  }
}

int check_mesh(const CheckOptions& options) {
  const Shape shape = Shape::load(options.file, options.scale);
  std::printf("%s: ", options.file.c_str());
  const fs_shape_info info = describe(shape.get());
  std::printf("\n");
  Findings findings;
  check_shape("", shape.get(), false, findings);
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

const char* const millimetres = "; are its numbers millimetres? Lengths are in metres";

// A hand on the wrong side of a surface that encloses all the other one is led back from wherever it is.
void note_pull(const fs_object& object) {
  fs_shape_info info = fs_shape_info_init();
  if (object.shape) forceserver::throw_on_error(fs_shape_get_info(object.shape, &info));
  if (!info.has_inside || object.contact.keep != (volume_of(object.shape) < 0 ? FS_KEEP_FRONT : FS_KEEP_BACK)) return;
  std::printf("  note: %s: it keeps the hand inside: from outside it is pulled in with up to %g N, from wherever it is\n",
              object.name, object.contact.limit);
}

void describe_contact(const fs_contact& contact) {
  if (contact.keep == FS_KEEP_NONE) return;
  std::printf("; solid, ");
  if (contact.stiffness > 0) std::printf("%g N/m, ", contact.stiffness);
  std::printf("at most %g N", contact.limit);
  if (contact.damping > 0) std::printf(", damping %g N s/m", contact.damping);
  if (contact.friction > 0) std::printf(", friction %g", contact.friction);
}

// Numbers that nobody means, as of other units.
void check_units(const fs_object& object, Findings& findings) {
  const fs_contact& contact = object.contact;
  const double speed = length(object.twist.linear);
  if (speed > 10) findings.add(object.name, "its twist is %.4g m/s%s", speed, millimetres);
  if (contact.keep == FS_KEEP_NONE) return;
  if (contact.limit < faint) findings.add(object.name, "as a solid it has a limit of %g N, which nobody feels", contact.limit);
  if (contact.stiffness > 0 && contact.stiffness < 10) {
    findings.add(object.name, "its stiffness of %g N/m holds the hand with %g N after a centimetre; is it in N/mm?",
                 contact.stiffness, std::min(contact.limit, 0.01 * contact.stiffness));
  }
}

void check_size(const std::string& name, const fs_shape* shape, double radius, Findings& findings) {
  fs_shape_info info = fs_shape_info_init();
  forceserver::throw_on_error(fs_shape_get_info(shape, &info));
  const double across = length(minus(info.upper, info.lower));
  if (across <= 5 * far_away * radius) return;
  findings.add(name, "it is %s across, and the device's workspace %s%s", metres(across).c_str(), metres(2 * radius).c_str(),
               millimetres);
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
    findings.add(object.name,
                 "its slope of %.4g N/m at the device would shake it when nobody holds it: a servo at %g Hz with "
                 "a local damping of %.3g N s/m renders %.4g N/m, shared by all that overlap, and reduces it to %.4g N/m",
                 slope, rate, rendered.damping, most, report.stiffness_applied);
  } else if (report.stiffness_applied < 0.99 * slope) {
    std::printf(
        "  note: %s: its steepest slope is %.4g N/m at the device; a servo reduces it to %.4g N/m, because what is "
        "felt at one place shares %.4g N/m\n",
        object.name, slope, report.stiffness_applied, most);
  }
}

void check_object(const fs_object& object, const Surroundings& around, Findings& findings) {
  const std::string name = object.name;
  if (!object.enabled) findings.add(name, "it is disabled, so it is not felt");
  const bool solid = object.contact.keep != FS_KEEP_NONE;
  const bool profiles = object.front.kind != FS_PROFILE_NONE || object.back.kind != FS_PROFILE_NONE;
  if (object.shape) check_shape(name, object.shape, object.contact.keep == FS_KEEP_EITHER && !profiles, findings);
  const Sides distances = distances_of(object, around.workspace);
  const bool front_first = distances.front.least <= distances.front.most;
  const double away = (front_first ? distances.front : distances.back).least;
  const bool is_far = away > far_away * around.workspace.radius;
  // A plane with one force on both sides is a force that is the same everywhere, such as gravity, wherever it lies.
  const bool is_constant =
      object.primitive == FS_PRIMITIVE_PLANE && std::max(object.front.kind, object.back.kind) <= FS_PROFILE_CONSTANT;
  if (object.shape) check_size(name, object.shape, around.workspace.radius, findings);
  if (!solid && !profiles) {
    findings.add(name, "it has no profile and is not solid, so it is not felt");
  } else if (profiles) {
    const double most_force = std::max(most(object.front, distances.front), most(object.back, distances.back));
    const bool damps = object.damping > 0 && most_force > 0;  // even if the force itself is too faint to feel
    const bool is_felt = most_force >= faint || damps || (solid && away == 0);
    if (!is_felt && away == 0) {
      findings.add(name, "its force is 0 wherever the hand gets");
    } else if (!is_felt) {
      findings.add(name, "the hand cannot get %s: it is at least %s of the scene away from the device's workspace%s",
                   has_sides(object) ? "to the side on which it is felt" : "near enough to feel it", metres(away).c_str(),
                   is_far ? millimetres : "");
    } else if (is_far && !is_constant) {
      findings.add(name, "it is felt although it is at least %s of the scene away from the device's workspace%s",
                   metres(away).c_str(), millimetres);
    }
    check_forces(object, distances, around.device.force_max / around.force_scale, findings);
  } else if (away > 0) {
    findings.add(name, "it lies %s of the scene outside of the device's workspace%s", metres(away).c_str(),
                 is_far ? millimetres : "");
  }
  const double limit = std::max({object.front.limit, object.back.limit, object.contact.limit});
  const double force_max = around.device.force_max;
  if (limit > force_max) findings.add(name, "its limit of %g N is above the device's %g N", limit, force_max);
  const std::uint32_t points = around.tool_points >= 32 ? ~0u : (1u << around.tool_points) - 1;
  if (object.tool_points != 0 && (object.tool_points & points) == 0) {
    findings.add(name, "its tool_points select none of the tool's points, of which there are %zu", around.tool_points);
  } else if (object.tool_points & ~points) {
    findings.add(name, "its tool_points select points that the tool does not have: it has %zu", around.tool_points);
  }
}

int check_scene(const CheckOptions& options) {
  const Scene scene = Scene::create();
  scene.load(options.file);
  const Device device = Device::open(options.device);
  const fs_device_info info = device.get_info();
  const fs_frame frame = scene.get_frame();
  const std::vector<fs_vec3> tool = scene.get_tool();
  double tool_length = 0;  // from the handle to its farthest point, m
  for (const fs_vec3& point : tool) tool_length = std::max(tool_length, length(point));

  // One tick of a servo shows which slopes it renders.
  fs_servo_options servo_options = fs_servo_options_init();
  servo_options.mode = FS_SERVO_VIRTUAL;
  Servo servo = Servo::start(scene, device, &servo_options);
  const fs_status status = fs_servo_step(servo.get(), 1);
  if (status != FS_ERROR_DISCONNECTED) forceserver::throw_on_error(status);  // a device behind a link is not ready at once
  const std::vector<fs_report> reports = scene.get_reports();
  const std::size_t count = reports.size();
  const fs_servo_stats rendered = scene.get_servo_stats();
  servo.reset();  // each reader of an expression has to parse it, which takes longer than anything else here

  std::printf("%s: a scene of %zu %s for a tool of %zu %s; ", options.file.c_str(), count, count == 1 ? "object" : "objects",
              tool.size(), tool.size() == 1 ? "point" : "points");
  if (frame.scale == 1) std::printf("scale 1:1\n");
  else std::printf("a metre of the device is %s of the scene\n", metres(frame.scale).c_str());
  Findings findings;
  if (count == 0) findings.add("", "it is empty");
  if (frame.force_scale == 0) findings.add("", "its force_scale is 0, so nothing is felt");
  const fs_quat& q = frame.pose.orientation;
  const fs_quat to_scene = {q.w, -q.x, -q.y, -q.z};
  const fs_vec3 centre = rotate(to_scene, frame.pose.position);
  const double cylinder_radius = info.workspace_radius * frame.scale, half_height = info.workspace_height / 2 * frame.scale;
  const Workspace workspace = {{-centre.x * frame.scale, -centre.y * frame.scale, -centre.z * frame.scale},
                               rotate(to_scene, {0, 0, 1}),
                               cylinder_radius,
                               half_height,
                               tool_length,
                               std::hypot(cylinder_radius, half_height) + tool_length};
  const Surroundings around = {workspace, info, frame.force_scale, tool.size()};
  for (const fs_report& report : reports) {
    const forceserver::Object object = scene.object_get(report.name);
    std::printf("%s: ", object.name);
    if (object.shape) describe(object.shape);
    else std::printf("%s", object.primitive == FS_PRIMITIVE_PLANE ? "a plane" : "a point");
    describe_profile(has_sides(object) ? "front " : "", object.front);
    describe_profile("back ", object.back);
    if (object.damping > 0) std::printf("; damping %g N s/m", object.damping);
    describe_contact(object.contact);
    if (!std::isfinite(report.stiffness_wanted)) std::printf("; infinitely steep where it jumps");
    else if (report.stiffness_wanted > 0) std::printf("; steepest slope %.4g N/m at the device", report.stiffness_wanted);
    std::printf("\n");
    check_object(object, around, findings);
    check_units(object, findings);
    note_pull(object);
    check_slope(object, report, rendered, info.rate, findings);
  }
  return findings.finish();
}

}  // namespace

int check(const CheckOptions& options) {
  load_driver(options.driver);
  std::string extension = std::filesystem::path(options.file).extension().string();
  for (char& c : extension) c = char(std::tolower(static_cast<unsigned char>(c)));
  if (extension == ".json") return check_scene(options);
  for (const char* mesh : {".obj", ".ply", ".stl", ".off"}) {
    if (extension == mesh) return check_mesh(options);
  }
  throw std::runtime_error(options.file + " is not checked: a scene ends in .json, a mesh in .obj, .ply, .stl or .off");
}
