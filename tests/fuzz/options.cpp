// The structs that programs give to a servo, a server and a surface, with sizes, numbers and reserved fields of any kind; and those
// that they have filled.
#include <memory>
#include <vector>

#include <forceserver/forceserver.hpp>

#include "fuzz/fuzz.h"

using fuzz::require;

namespace {

// A growing struct whose struct_size may be wrong. It lies in memory of exactly the size that it tells of itself, or of its real
// one where it tells less, so that the address sanitizer sees who reads or writes beyond it.
template <class Struct>
class Grown {
 public:
  Grown(fuzz::Input& input, Struct fields) {
    fields.struct_size = sizeof(Struct);
    const uint8_t kind = input.byte();
    if (kind >= 192) {
      const uint32_t sizes[] = {0, 4, 8, sizeof(Struct) - 8, sizeof(Struct) + 8, 4096, 4104, input.take<uint32_t>()};
      fields.struct_size = sizes[kind % 8];
    }
    // No version is larger than 4096 bytes, and of a struct that says so only its struct_size is looked at.
    const size_t told = fields.struct_size <= 4096 ? fields.struct_size : 0;
    bytes_.resize(std::max<size_t>(told, sizeof(Struct)));
    std::memcpy(bytes_.data(), &fields, sizeof fields);
    if (told > sizeof(Struct) && input.coin()) bytes_[sizeof(Struct) + input.byte() % (told - sizeof(Struct))] = input.byte();
  }
  Struct* get() noexcept { return reinterpret_cast<Struct*>(bytes_.data()); }

 private:
  std::vector<uint8_t> bytes_;
};

double usual(fuzz::Input& input) { return input.coin() ? 0 : input.number(); }

void require_reason(fs_status status) {
  const bool is_expected = status == FS_ERROR_INVALID || status == FS_ERROR_VERSION;
  require(is_expected && *fs_last_error() && std::strlen(fs_last_error()) < 500, "a refusal:", fs_last_error());
}

fs_servo_options servo_options(fuzz::Input& input) {
  fs_servo_options out = fs_servo_options_init();
  const int32_t mode = input.byte() < 240 ? FS_SERVO_VIRTUAL : input.take<int32_t>();
  // Not a thread of its own: that takes as long as the system needs to start it.
  const int32_t taken = mode == FS_SERVO_THREAD || mode == FS_SERVO_CALLER ? FS_SERVO_VIRTUAL : mode;
  std::memcpy(&out.mode, &taken, sizeof taken);
  for (double* const field : {&out.rate, &out.force_limit, &out.torque_limit, &out.slew_limit, &out.speed_limit, &out.ramp,
                              &out.fade, &out.blend, &out.delay, &out.damping, &out.max_stiffness}) {
    *field = usual(input);
  }
  out.priority = input.coin() ? 0 : input.take<int32_t>();
  out.cpu = input.coin() ? 0 : input.take<int32_t>();
  return out;
}

fs_server_options server_options(fuzz::Input& input) {
  fs_server_options out = fs_server_options_init();
  for (uint32_t* const field : {&out.max_clients, &out.max_objects, &out.max_megabytes}) {
    *field = input.coin() ? 0 : input.take<uint32_t>() >> input.byte() % 32;
  }
  out.lease = usual(input);
  out.force_limit = usual(input);
  out.locked = input.coin();
  out.no_stop = input.coin();
  if (input.byte() == 1) out.reserved[input.below(5)] = input.byte();
  return out;
}

fs_surface_settings surface_settings(fuzz::Input& input) {
  fs_surface_settings out = fs_surface_settings_init();
  out.reserved = input.byte() == 1;
  for (double* const field : {&out.static_friction, &out.dynamic_friction, &out.slip_distance, &out.column_width, &out.row_width,
                              &out.first_column, &out.first_row, &out.impact_gain, &out.impact_frequency, &out.impact_decay}) {
    *field = usual(input);
  }
  out.columns = input.byte() < 200 ? input.below(9) : input.take<uint32_t>();
  out.rows = input.byte() < 200 ? input.below(9) : input.take<uint32_t>();
  const int32_t axis = input.choice(FS_AXIS_Y);
  std::memcpy(&out.axis, &axis, sizeof axis);
  out.repeats = input.coin();
  if (input.byte() == 1) out.reserved_8[input.below(3)] = input.byte();
  return out;
}

void start_servo(fuzz::Input& input, fs_device* device) {
  const forceserver::Scene scene = forceserver::Scene::create();
  Grown<fs_servo_options> options(input, servo_options(input));
  fs_servo* servo = nullptr;
  const fs_status status = fs_servo_start(scene.get(), device, options.get(), &servo);
  if (status != FS_OK) return require_reason(status);
  const forceserver::Servo owned(servo);

  fs_object wall = fs_wall_init("wall", {0, 0, 0.05}, {0, 0, 1}, input.number(), 5);
  static_cast<void>(fs_object_set(scene.get(), &wall));
  require(fs_servo_step(servo, 1 + input.below(8)) == FS_OK, "a step:", fs_last_error());
  fs_wrench sent{};
  require(fs_scene_get_hand(scene.get(), nullptr, nullptr, &sent) == FS_OK, "the hand:", fs_last_error());
  const double force = std::hypot(sent.force.x, sent.force.y, sent.force.z);
  const double limit = options.get()->force_limit > 0 ? options.get()->force_limit : 25;
  require(force <= limit * (1 + 1e-9) + 1e-12, "a force beyond the limit:", std::to_string(force).c_str());

  Grown<fs_servo_stats> stats(input, fs_servo_stats_init());
  if (const fs_status got = fs_scene_get_servo_stats(scene.get(), stats.get()); got != FS_OK) require_reason(got);
  Grown<fs_device_info> info(input, fs_device_info_init());
  if (const fs_status got = fs_scene_get_device_info(scene.get(), info.get()); got != FS_OK) require_reason(got);

  if (input.below(4) != 0) return;  // a server has threads, which take long to start
  Grown<fs_server_options> server(input, server_options(input));
  fs_server* started = nullptr;
  const std::string endpoint = "shm:fuzz-" + std::to_string(getpid());
  const fs_status begun = fs_server_start(servo, endpoint.c_str(), server.get(), &started);
  if (begun != FS_OK) return require_reason(begun);
  fs_server_stop(started);
}

void make_surface(fuzz::Input& input) {
  Grown<fs_surface_settings> settings(input, surface_settings(input));
  if (input.coin()) {
    const auto impact = static_cast<fs_impact>(input.choice(FS_IMPACT_HARD) & FS_IMPACT_FORCE_32);  // others C++ cannot give
    if (const fs_status status = fs_surface_set_impact(settings.get(), impact); status != FS_OK) require_reason(status);
  }
  fs_surface* surface = nullptr;
  fs_status status;
  if (input.coin()) {
    status = fs_surface_create(settings.get(), &surface);
  } else {
    std::vector<double> heights(input.below(82));
    for (double& height : heights) height = input.coin() ? -1e-3 * input.below(100) : input.number();
    status = fs_surface_create_texture(settings.get(), heights.data(), heights.size(), &surface);
  }
  if (status != FS_OK) return require_reason(status);
  const forceserver::Surface owned(surface);
  Grown<fs_surface_settings> out(input, fs_surface_settings_init());
  if (const fs_status got = fs_surface_get_settings(surface, out.get()); got != FS_OK) require_reason(got);

  // It is felt.
  const forceserver::Scene scene = forceserver::Scene::create();
  const fs_vec3 point{0, 0, 0};
  fs_tool* tool = nullptr;
  require(fs_tool_create(scene.get(), &point, 1, &tool) == FS_OK, "a tool:", fs_last_error());
  const forceserver::Tool owned_tool(tool);
  fs_object floor = fs_object_init("floor", FS_PRIMITIVE_PLANE);
  floor.contact.keep = FS_KEEP_FRONT;
  floor.contact.stiffness = 500;
  floor.contact.limit = 8;
  floor.surface = surface;
  require(fs_object_set(scene.get(), &floor) == FS_OK, "a floor:", fs_last_error());
  for (int i = 0; i < 4; ++i) {
    fs_state state{};
    state.pose = {{1e-3 * i, input.coordinate(), 1e-3 - 1e-3 * i}, {1, 0, 0, 0}};
    state.twist.linear = {0, 0, -0.5};
    state.time = 1 + 1e-3 * i;
    fs_response response;
    if (fs_evaluate(tool, &state, &response) != FS_OK) continue;
    const fs_vec3& f = response.wrench.force;
    require(std::hypot(f.x, f.y, f.z) <= 8 * (1 + 1e-9), "a force beyond the limit of its object:",
            (std::to_string(std::hypot(f.x, f.y, f.z)) + " N").c_str());
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static fs_device* const device = [] {
    fs_device* out = nullptr;
    require(fs_device_open("sim:?encoder=ideal", &out) == FS_OK, "the simulator:", fs_last_error());
    return out;
  }();
  fuzz::Input input(data, size);
  if (input.coin()) start_servo(input, device);
  else make_surface(input);
  return 0;
}
