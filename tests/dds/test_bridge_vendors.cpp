// Programs with a DDS of another vendor or version take part in a room, and as nodes of ROS 2: Cyclone DDS of PyPI, by the example
// examples/dds/rock.py, and Fast DDS, by fast_dds.cpp. For run_vendors, which sets CYCLONE_PYTHON and FAST_DDS in the environment.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "dds/bridge_rig.h"

using namespace dds;
using namespace scenes;

namespace {

constexpr const char* example = ROOT "/examples/dds/rock.py";

bool says(const Process& process, const std::string& text) { return process.output().find(text) != std::string::npos; }

// The end of what it said: Check takes no long messages.
std::string end_of(const Process& process) {
  const std::string output = process.output();
  return output.substr(output.size() - std::min<size_t>(output.size(), 1000));
}

#define SAYS(process, text) \
  ck_assert_msg(eventually([&] { return says(process, text); }), "never: %s\nit said:\n%s", text, end_of(process).c_str())

double steady_now() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

fs_pose place_of(const Scene& scene, const std::string& name) {
  fs_pose out{};
  for (const fs_motion& motion : scene.get_motions()) {
    if (name == motion.name) forceserver::throw_on_error(fs_motion_at(&motion, scene.get_time(), &out));
  }
  return out;
}

// The last number of the last whole line that begins so.
double last_number(const Process& process, const std::string& beginning) {
  const std::string output = process.output();
  const size_t end = output.rfind('\n'), begin = output.rfind("\n" + beginning, end == std::string::npos || end == 0 ? end : end - 1);
  if (end == std::string::npos || begin == std::string::npos) return 0;
  const std::string line = output.substr(begin + 1, output.find('\n', begin + 1) - begin - 1);
  return std::atof(line.c_str() + line.rfind(' '));
}

bool goes_to_goal(const Scene& app) {
  const fs_vec3 place = app.object_get("spring").pose.position;
  return std::hypot(place.x - 0.05, place.y - 0.01, place.z) < 1e-12;
}

SiteOptions ros_options() {
  SiteOptions options;
  options.bridge = {"--ros", "--follow", "app/spring=/goal"};
  return options;
}

}  // namespace

START_TEST(a_python_program_publishes_a_rock) {
  const RoomName name;
  Site desk(name, "desk");
  const Scene viewer = desk.connect("viewer");
  const Scene app = desk.connect("app");
  app.object_set(spring_at("spring", {0.04, 0, 0}));
  const std::string rock = "rock.py@rock/rock";
  {
    Process program({std::getenv("CYCLONE_PYTHON"), "-B", "-u", example, "--room", name.room, "--domain", name.domain, "--edit", "desk:app/spring"});
    SAYS(program, "site desk is here with FIDEL (simulated), 25.0 N");
    ck_assert_msg(eventually([&] { return weight_of(viewer, rock) == 1; }), "no rock; it said:\n%s", end_of(program).c_str());
    // It has a shape and a curve of its own,
    const forceserver::Object object = viewer.object_get(rock);
    ck_assert_int_eq(object.primitive, FS_PRIMITIVE_MESH);
    fs_shape_info info = fs_shape_info_init();
    ck_assert_int_eq(fs_shape_get_info(object.shape, &info), FS_OK);
    size_t count = 0;
    fs_shape_get_triangles(object.shape, &count);
    ck_assert_uint_eq(count, 8);
    ck_assert_str_eq(fs_curve_get_expression(object.front.curve), "(3 + sin(12*t))*exp(-d/0.01)");
    ck_assert_int_eq(object.contact.keep, FS_KEEP_FRONT);
    // is where it says at each instant, here within 0.1 s, for busy machines,
    EVENTUALLY(([&] {
      const fs_vec3 there = place_of(viewer, rock).position;
      const double angle = steady_now();
      return std::hypot(there.x - 0.03 * std::cos(angle), there.y - 0.03 * std::sin(angle)) < 3e-3;
    }()));
    // pushes the hand, and the program is told so.
    SAYS(program, "the hand of site desk is at ");
    SAYS(program, "the rock pushes there with 0.");
    // It edits an object of the site.
    SAYS(program, "site desk answers the edit: done");
    EXPECT_VECTOR(app.object_get("spring").pose.position, (fs_vec3{0.04, 0.01, 0}), 1e-12);
    ck_assert(says(desk.bridge, "app/spring was edited by rock.py at site rock"));
  }
  // When the program is lost, its rock fades.
  EVENTUALLY(!has_object(viewer, rock));
  ck_assert_int_eq(desk.bridge.end(), 0);
}
END_TEST

START_TEST(a_node_of_cyclone) {
  const RoomName name;
  Site desk(name, "desk", ros_options());
  const Scene app = desk.connect("app");
  app.object_set(spring_at("spring", {0.04, 0, 0}));
  const Process node({std::getenv("CYCLONE_PYTHON"), "-B", "-u", ROOT "/tests/dds/ros_node.py", name.domain});
  SAYS(node, "wrench forceserver/desk ");
  ck_assert_msg(eventually([&] { return goes_to_goal(app); }), "the spring stays; the bridge said:\n%s", end_of(desk.bridge).c_str());
  EVENTUALLY(last_number(node, "wrench forceserver/desk") > 1);
}
END_TEST

START_TEST(fast_dds) {
  const RoomName name;
  Site desk(name, "desk", ros_options());
  const Scene viewer = desk.connect("viewer");
  const Scene app = desk.connect("app");
  app.object_set(spring_at("spring", {0.04, 0, 0}));
  setenv("FASTRTPS_DEFAULT_PROFILES_FILE", ROOT "/examples/dds/fast_dds.xml", 1);
  {
    const Process program({std::getenv("FAST_DDS"), name.domain, name.room});
    // The topics of ROS.
    SAYS(program, "pose forceserver/desk 1.0 1\n");
    SAYS(program, "twist forceserver/desk ");
    SAYS(program, "buttons forceserver/desk 0 8 0\n");
    ck_assert_msg(eventually([&] { return goes_to_goal(app); }), "the spring stays; the bridge said:\n%s", end_of(desk.bridge).c_str());
    // It reads what a room tells,
    SAYS(program, "status desk FIDEL (simulated) 25.0\n");
    SAYS(program, "hand desk ");
    // and publishes objects.
    const std::string rock = "cpp@fast/rock", mast = "cpp@fast/mast";
    ck_assert_msg(eventually([&] { return weight_of(viewer, rock) == 1 && weight_of(viewer, mast) == 1; }), "no objects; it said:\n%s\n%s",
                  end_of(program).c_str(), end_of(desk.bridge).c_str());
    SAYS(program, "holds fast 2\n");
    EVENTUALLY(std::fabs(place_of(viewer, rock).position.y - 0.02) < 1e-12);
    const forceserver::Object object = viewer.object_get(mast);
    ck_assert_int_eq(object.primitive, FS_PRIMITIVE_POLYLINE);
    size_t count = 0;
    double step = 0;
    const double* const table = fs_curve_get_table(object.front.curve, &count, &step);
    ck_assert_uint_eq(count, 3);
    ck_assert_double_eq(table[1], 2);
    // It is told what is felt: the hand gives way, so the forces are not those at its first place.
    for (const char* const felt : {"felt app/spring", "felt cpp@fast/rock", "felt cpp@fast/mast"}) EVENTUALLY(last_number(program, felt) > 0.2);
    EVENTUALLY(std::fabs(last_number(program, "wrench forceserver/desk") - last_number(program, "hand desk")) < 0.01 &&
               last_number(program, "hand desk") > 1);
  }
  EVENTUALLY(!has_object(viewer, "cpp@fast/rock"));
  ck_assert_int_eq(desk.bridge.end(), 0);
}
END_TEST

int main() {
  Suite* const suite = suite_create("other vendors");
  if (std::getenv("CYCLONE_PYTHON")) add_case(suite, "cyclone of PyPI", {a_python_program_publishes_a_rock, a_node_of_cyclone});
  if (std::getenv("FAST_DDS")) add_case(suite, "fast", {fast_dds});
  return run_suite(suite);
}
