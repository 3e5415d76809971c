// Objects of any numbers, and calls in any order, through the C functions, on a scene of this process that is felt by a tool of its
// own and, in half of the cases, by a servo. What is refused says which field is wrong and changes nothing; forces are finite and
// within the limits.
#include <array>
#include <vector>

#include <forceserver/forceserver.hpp>

#include "fuzz/fuzz.h"

using fuzz::Input;
using fuzz::require;

namespace {

constexpr std::array<const char*, 6> names = {"a", "b", "wall", "a longer name", "\xc3\xa9", "c/d"};
constexpr double device_limit = 25;  // N, of the simulator

template <class Enum>
void put(Enum& out, int32_t value) {
  static_assert(sizeof out == sizeof value);
  std::memcpy(&out, &value, sizeof value);
}

// Shapes, curves and surfaces that objects may have.
struct Assets {
  std::vector<forceserver::Shape> shapes;
  std::vector<forceserver::Curve> curves;
  std::vector<forceserver::Surface> surfaces;

  Assets() {
    const std::vector<fs_vec3> corners = {{0, 0, 0}, {0.1, 0, 0}, {0, 0.1, 0}, {0, 0, 0.1}};
    const std::vector<uint32_t> tetrahedron = {0, 2, 1, 0, 1, 3, 1, 2, 3, 0, 3, 2}, sheet = {0, 1, 2, 0, 2, 2};
    fs_shape* shape = nullptr;
    const auto add = [&](fs_status status) {
      require(status == FS_OK, "a shape:", fs_last_error());
      shapes.emplace_back(shape);
    };
    add(fs_shape_create_polyline(corners.data(), corners.size(), false, &shape));
    add(fs_shape_create_polyline(corners.data(), 2, true, &shape));
    add(fs_shape_create_mesh(corners.data(), corners.size(), tetrahedron.data(), 4, &shape));
    add(fs_shape_create_mesh(corners.data(), corners.size(), sheet.data(), 2, &shape));
    curves.push_back(forceserver::Curve::create_expression("3*(1+sin(12*t))*exp(-d/0.01)"));
    curves.push_back(forceserver::Curve::create_expression("1/d"));
    const std::vector<double> table = {0, 3, 1, 8, 0};
    curves.push_back(forceserver::Curve::create_table(table.data(), table.size(), 0.01));
    fs_surface_settings settings = fs_surface_settings_init();
    settings.static_friction = 0.8;
    settings.dynamic_friction = 0.3;
    settings.slip_distance = 1e-3;
    require(fs_surface_set_impact(&settings, FS_IMPACT_HARD) == FS_OK, "an impact");
    surfaces.push_back(forceserver::Surface::create(settings));
    settings.columns = settings.rows = 2;
    settings.column_width = settings.row_width = 2e-3;
    settings.repeats = true;
    const std::vector<double> heights = {0, -1e-3, -1e-3, 0};
    surfaces.push_back(forceserver::Surface::create_texture(settings, heights.data(), heights.size()));
  }
  template <class List>
  static typename List::value_type::pointer pick(Input& input, const List& all) {
    const unsigned i = input.below(2 * static_cast<unsigned>(all.size()));
    return i < all.size() ? all[i].get() : nullptr;
  }
};

fs_vec3 vector(Input& input) {
  const double x = input.coordinate(), y = input.coordinate(), z = input.coordinate();
  return {x, y, z};
}

fs_pose pose(Input& input) {
  fs_pose out{{}, {1, 0, 0, 0}};
  const uint8_t kind = input.byte();
  if (kind & 1) out.position = {0.01 * static_cast<int8_t>(input.byte()), 0, 0.001 * static_cast<int8_t>(input.byte())};
  if (kind & 2) out.orientation = {0.6, 0, 0.8, 0};
  if (kind & 4) out.position = vector(input);
  if (kind & 8) out.orientation = {input.number(), input.number(), input.number(), input.number()};
  return out;
}

fs_twist twist(Input& input) {
  fs_twist out{};
  if (input.coin()) out.linear = vector(input);
  if (input.coin()) out.angular = vector(input);
  return out;
}

double sometimes(Input& input, double usual) { return input.byte() < 208 ? usual : input.number(); }

fs_profile profile(Input& input, const Assets& assets) {
  fs_profile out{};
  const int32_t kind = input.choice(FS_PROFILE_CUSTOM);
  put(out.kind, kind);
  put(out.sense, input.choice(FS_SENSE_REPULSIVE));
  const double sign = kind == FS_PROFILE_LINEAR_DECREASING ? -1 : 1;
  out.gain = kind == FS_PROFILE_NONE ? 0 : sometimes(input, sign * 2 * input.byte());
  const bool has_offset = kind == FS_PROFILE_LINEAR_INCREASING || kind == FS_PROFILE_LINEAR_DECREASING ||
                          kind == FS_PROFILE_QUADRATIC || kind == FS_PROFILE_INVERSE;
  out.offset = has_offset ? sometimes(input, input.below(4)) : sometimes(input, 0);
  out.width = kind == FS_PROFILE_GAUSSIAN ? sometimes(input, 0.01) : sometimes(input, 0);
  out.limit = kind == FS_PROFILE_NONE ? sometimes(input, 0) : sometimes(input, 1 + input.below(8));
  out.reach = sometimes(input, kind != FS_PROFILE_NONE && input.coin() ? 0.05 : 0);
  if (kind == FS_PROFILE_CUSTOM || input.byte() == 1) out.curve = Assets::pick(input, assets.curves);
  if (input.byte() == 1) out.reserved[input.below(4)] = input.number();
  return out;
}

void put_name(Input& input, char (&out)[FS_NAME_SIZE]) {
  const uint8_t kind = input.byte();
  if (kind < 240) {
    std::strcpy(out, names[kind % 5]);
  } else {
    std::memset(out, kind < 248 ? 0 : 'x', sizeof out);  // 'x': it has no end
    input.fill(out, input.byte() % sizeof out);
  }
}

fs_object object(Input& input, const Assets& assets) {
  const int32_t primitive = input.choice(FS_PRIMITIVE_MESH);
  fs_object out = fs_object_init("", FS_PRIMITIVE_POINT);
  put(out.primitive, primitive);
  put_name(input, out.name);
  out.pose = pose(input);
  if (input.byte() >= 192) out.twist = twist(input);
  out.time = sometimes(input, FS_NOW);
  out.start = sometimes(input, 0);
  const bool has_surface = primitive == FS_PRIMITIVE_PLANE || primitive == FS_PRIMITIVE_MESH;
  out.front = profile(input, assets);
  if (has_surface || input.byte() == 1) out.back = profile(input, assets);
  out.damping = sometimes(input, input.below(5));
  if (has_surface ? input.coin() : input.byte() == 1) {
    put(out.contact.keep, input.choice(FS_KEEP_EITHER));
    out.contact.stiffness = sometimes(input, 10 * input.byte());
    out.contact.limit = sometimes(input, 1 + input.below(10));
    out.contact.damping = sometimes(input, input.below(3));
    out.contact.friction = sometimes(input, 0.01 * input.below(100));
    out.contact.reserved_32 = input.byte() == 1;
    if (input.byte() == 1) out.contact.reserved[input.below(8)] = input.number();
    out.surface = Assets::pick(input, assets.surfaces);
    if (out.surface && input.byte() < 240) out.contact.friction = 0;
  }
  const bool has_shape = primitive == FS_PRIMITIVE_POLYLINE || primitive == FS_PRIMITIVE_MESH;
  if (input.byte() == 1) {
    out.shape = Assets::pick(input, assets.shapes);
  } else if (has_shape) {
    out.shape = assets.shapes[(primitive == FS_PRIMITIVE_MESH ? 2 : 0) + input.below(2)].get();
  }
  out.tool_points = input.byte() < 200 ? 0 : input.take<uint32_t>();
  out.enabled = input.byte() < 240;
  if (input.byte() == 1) out.reserved[input.below(3)] = input.byte();
  out.lifetime = sometimes(input, 0);
  if (input.byte() == 1) out.struct_size = input.take<uint32_t>() % (sizeof out + 1);
  return out;
}

// All that can be seen of a scene.
struct Seen {
  std::vector<fs_object> objects;
  std::vector<fs_motion> motions;
  fs_view view{};
  double time = 0;
};

Seen look(fs_scene* scene) {
  Seen out;
  size_t count = 0;
  require(fs_scene_get_motions(scene, nullptr, nullptr, 0, &count) == FS_OK, "motions:", fs_last_error());
  out.motions.resize(count);
  require(fs_scene_get_motions(scene, nullptr, out.motions.data(), count, &count) == FS_OK, "motions:", fs_last_error());
  for (const fs_motion& motion : out.motions) {
    fs_object object = fs_object_init("", FS_PRIMITIVE_POINT);
    require(fs_object_get(scene, motion.name, &object) == FS_OK, "an object that is listed:", fs_last_error());
    out.objects.push_back(object);
    fs_object_release(&object);
    out.objects.back().owner = nullptr;  // only compared from here on
  }
  require(fs_scene_get_view(scene, nullptr, &out.view) == FS_OK, "the view:", fs_last_error());
  require(fs_scene_get_time(scene, &out.time) == FS_OK, "the time:", fs_last_error());
  return out;
}

template <class T>
bool is_same(const std::vector<T>& a, const std::vector<T>& b) {
  return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0);
}

class World {
 public:
  World(Input& input, const Assets& assets, fs_device* device) : input_(input), assets_(assets) {
    require(fs_scene_set_time(scene_.get(), 1) == FS_OK, "the time:", fs_last_error());  // so that it stands still
    const fs_vec3 points[] = {{0, 0, 0}, {0.01, 0, 0}, {0, 0, -0.01}};
    fs_tool* tool = nullptr;
    require(fs_tool_create(scene_.get(), points, 1 + input.below(3), &tool) == FS_OK, "a tool:", fs_last_error());
    tool_ = forceserver::Tool(tool);
    if (!input.coin()) return;
    fs_servo_options options = fs_servo_options_init();
    options.mode = FS_SERVO_VIRTUAL;
    options.ramp = -1;
    options.fade = input.coin() ? -1 : 0.01;
    fs_servo* servo = nullptr;
    require(fs_servo_start(scene_.get(), device, &options, &servo) == FS_OK, "a servo:", fs_last_error());
    servo_ = forceserver::Servo(servo);
  }

  void play() {
    constexpr int most_calls = 100;
    for (int i = 0; i < most_calls && !input_.is_empty(); ++i) call();
    if (is_in_group_ && input_.coin()) refused_or_done(fs_scene_cancel(scene_.get()));
    evaluate();
    step();
  }

 private:
  // A call that may be refused: then it says why, and the scene is as it was.
  template <class F>
  void change(F&& f) {
    const Seen before = look(scene_.get());
    const fs_status status = f();
    refused_or_done(status);
    if (status == FS_OK) return;
    const Seen after = look(scene_.get());
    require(is_same(before.motions, after.motions) && is_same(before.objects, after.objects), "a refused call moves or changes",
            fs_last_error());
    require(std::memcmp(&before.view, &after.view, sizeof before.view) == 0, "a refused call changes the view");
  }
  static void refused_or_done(fs_status status) {
    if (status == FS_OK) return;
    const bool is_expected = status == FS_ERROR_INVALID || status == FS_ERROR_NOT_FOUND || status == FS_ERROR_STATE ||
                             status == FS_ERROR_UNSUPPORTED || status == FS_ERROR_VERSION;
    require(is_expected, "a status:", fs_status_name(status));
    require(std::strlen(fs_last_error()) > 10 && std::strlen(fs_last_error()) < 600, "a sentence:", fs_last_error());
  }

  void call() {
    fs_scene* const scene = scene_.get();
    switch (input_.below(20)) {
      default: {
        const fs_object given = object(input_, assets_);
        change([&] { return fs_object_set(scene, &given); });
        break;
      }
      case 6:
      case 7: {
        const fs_object given = object(input_, assets_);
        const uint32_t parts = input_.coin() ? 1u << input_.below(6) : input_.byte();
        change([&] { return fs_object_change(scene, &given, parts); });
        break;
      }
      case 8:
      case 9: {
        const char* const name = names[input_.below(names.size())];
        const fs_pose place = pose(input_);
        const fs_twist motion = twist(input_);
        const bool has_twist = input_.coin();
        const double time = sometimes(input_, FS_NOW);
        change([&] { return fs_object_move(scene, name, &place, has_twist ? &motion : nullptr, time); });
        break;
      }
      case 10: {
        const char* const name = names[input_.below(names.size())];
        change([&] { return fs_object_remove(scene, name); });
        break;
      }
      case 11: group(); break;
      case 12: {
        fs_frame frame = fs_frame_init();
        frame.pose = pose(input_);
        frame.scale = sometimes(input_, 2);
        frame.force_scale = sometimes(input_, 0.5);
        if (input_.byte() == 1) frame.reserved[input_.below(4)] = input_.number();
        change([&] { return fs_scene_set_frame(scene, &frame); });
        break;
      }
      case 13: {
        std::vector<fs_vec3> points(input_.below(40));
        for (fs_vec3& point : points) point = {0.001 * input_.byte(), input_.byte() < 208 ? 0 : input_.coordinate(), 0};
        change([&] { return fs_scene_set_tool(scene, points.data(), points.size()); });
        break;
      }
      case 14: {
        const double radius = sometimes(input_, 0.005);
        change([&] { return fs_scene_set_tool_radius(scene, radius); });
        break;
      }
      case 15: {
        const double value = sometimes(input_, input_.coin() ? 1000 : 0);
        const bool is_accuracy = input_.coin();
        change([&] { return is_accuracy ? fs_scene_set_accuracy(scene, value) : fs_scene_set_max_stiffness(scene, value); });
        break;
      }
      case 16: {
        const bool clears = input_.byte() < 64, holds = input_.coin();
        change([&] { return clears ? fs_scene_clear(scene) : fs_scene_set_clutch(scene, holds); });
        break;
      }
      case 17: evaluate(); break;
      case 18: step(); break;
      case 19: ask(); break;
    }
  }

  void group() {
    const uint8_t what = input_.byte();
    const fs_status status = what % 4 < 2 ? fs_scene_begin(scene_.get())
                             : what % 4 == 2 ? fs_scene_commit(scene_.get())
                                             : fs_scene_cancel(scene_.get());
    refused_or_done(status);
    if (status == FS_OK) is_in_group_ = what % 4 < 2;
  }

  // N: no object pushes harder than its profiles and its contact together may.
  double most_force() const {
    double sum = 0;
    for (const fs_object& object : look(scene_.get()).objects) {
      sum += std::fmax(object.front.limit, object.back.limit) + (object.contact.keep != FS_KEEP_NONE ? object.contact.limit : 0);
    }
    return sum;
  }

  void evaluate() {
    fs_state state{};
    state.pose = pose(input_);
    if (input_.coin()) state.twist = twist(input_);
    state.time = sometimes(input_, FS_NOW);
    fs_response response{};
    const fs_status status = fs_evaluate(tool_.get(), &state, &response);
    if (status != FS_OK) return refused_or_done(status);
    const fs_vec3 &f = response.wrench.force, &t = response.wrench.torque;
    require(std::isfinite(f.x + f.y + f.z) && std::isfinite(t.x + t.y + t.z), "a force that is not finite");
    const fs_mat3& k = response.stiffness;
    for (const double value : {k.xx, k.xy, k.xz, k.yx, k.yy, k.yz, k.zx, k.zy, k.zz}) {
      require(std::isfinite(value), "a stiffness that is not finite");
    }
    if (is_in_group_) return;  // what the tool feels is not what this thread sees
    require(std::hypot(f.x, f.y, f.z) <= most_force() * (1 + 1e-6) + 1e-6, "a force beyond the limits of the objects");
  }

  void step() {
    if (!servo_) return;
    const fs_status status = fs_servo_step(servo_.get(), 1 + input_.below(20));
    require(status == FS_OK, "a step:", fs_last_error());
    fs_wrench sent{};
    require(fs_scene_get_hand(scene_.get(), nullptr, nullptr, &sent) == FS_OK, "the hand:", fs_last_error());
    const double force = std::hypot(sent.force.x, sent.force.y, sent.force.z);
    require(force <= device_limit * (1 + 1e-9), "a force beyond the limit of the device");
  }

  void ask() {
    size_t count = 0;
    std::vector<fs_report> reports(8);
    require(fs_scene_get_reports(scene_.get(), reports.data(), reports.size(), &count) == FS_OK, "reports:", fs_last_error());
    for (size_t i = 0; i < std::min(count, reports.size()); ++i) {
      const fs_report& report = reports[i];
      require(report.weight >= 0 && report.weight <= 1, "a weight of", report.name);
      require(std::isfinite(report.wrench.force.x) && report.stiffness_applied <= report.stiffness_wanted * (1 + 1e-9) &&
                  report.stiffness_applied >= 0, "a report of", report.name);
    }
    fs_event event{};
    for (int i = 0; i < 8; ++i) {
      require(fs_scene_next_event(scene_.get(), 0, &event) == FS_OK, "an event:", fs_last_error());
      require(strnlen(event.text, sizeof event.text) < sizeof event.text, "an event's text without an end");
    }
    const fs_vec3 places[] = {{0, 0, 0}, {0.01, 0, 0.02}, vector(input_)};
    fs_vec3 forces[3];
    const char* const name = input_.coin() ? nullptr : names[input_.below(names.size())];
    const fs_status status = fs_evaluate_field(scene_.get(), name, sometimes(input_, FS_NOW), places, 3, forces);
    if (status != FS_OK) return refused_or_done(status);
    for (const fs_vec3& force : forces) require(std::isfinite(force.x + force.y + force.z), "a field that is not finite");
  }

  Input& input_;
  const Assets& assets_;
  const forceserver::Scene scene_ = forceserver::Scene::create();
  forceserver::Tool tool_;
  forceserver::Servo servo_;
  bool is_in_group_ = false;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const Assets& assets = *new Assets;
  static fs_device* const device = [] {
    fs_device* out = nullptr;
    require(fs_device_open("sim:", &out) == FS_OK, "the simulator:", fs_last_error());
    return out;
  }();
  Input input(data, size);
  World(input, assets, device).play();
  return 0;
}
