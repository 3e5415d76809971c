#include <forceserver/servo.h>

#include <bit>
#include <set>

#include "api/on_scene.h"
#include "base/grown.h"
#include "base/names.h"
#include "servo/servo.h"

using namespace fs;

namespace {

// The servo handles that applications hold. The set makes it safe to stop a servo twice, or from two threads at once.
// The process's mutex guards it.
std::set<fs_servo*>& handles() {
  static std::set<fs_servo*>& all = *new std::set<fs_servo*>;  // never destroyed: the process may be ending
  return all;
}

const char* const parents = "the servo was started by the parent of this process";

}  // namespace

const char* fs_realtime_name(fs_realtime realtime) { return name_of(realtime_names, realtime, "an unknown fs_realtime"); }

const char* fs_fault_name(uint32_t faults) {
  if (faults == 0) return "no fault";
  return name_at(fault_names, static_cast<size_t>(std::countr_zero(faults)), "an unknown fs_fault");
}

fs_status fs_servo_start(fs_scene* scene, fs_device* device, const fs_servo_options* options, fs_servo** out) {
  return guarded([&] {
    require_pointer(scene, "scene");
    require_pointer(device, "device");
    require_pointer(out, "out");
    const fs_servo_options given = options ? read_grown(options) : fs_servo_options_init();
    const ServoSettings settings = parse_options(given, device->info());
    if (scene->is_remote()) {
      fail(FS_ERROR_UNSUPPORTED, "the scene is at a server, whose servo runs it; use a scene made by fs_scene_create");
    }
    Ref<Servo> servo = make_ref<Servo>(Ref<LocalScene>::retain(&scene->local()), Ref<Device>::retain(device), settings);
    const std::lock_guard lock(process_mutex());
    handles().insert(servo.get());
    *out = servo.detach();
  });
}

fs_status fs_servo_step(fs_servo* servo, uint64_t ticks) {
  if (!servo) return null_argument("servo is null");
  if (!servo->is_of_this_process()) return set_last_error_literal(FS_ERROR_STATE, parents);
  return servo->step(ticks);
}

fs_status fs_servo_set_enabled(fs_servo* servo, bool enabled) {
  if (!servo) return null_argument("servo is null");
  if (!servo->is_of_this_process()) return set_last_error_literal(FS_ERROR_STATE, parents);
  servo->set_enabled(enabled);
  return FS_OK;
}

void fs_servo_stop(fs_servo* servo) {
  Ref<Servo> kept;
  {
    const std::lock_guard lock(process_mutex());
    if (!handles().contains(servo) || !servo->is_of_this_process()) return;
    kept = Ref<Servo>::retain(servo);
  }
  kept->stop();
  const std::lock_guard lock(process_mutex());
  if (handles().erase(servo)) servo->release();
}

fs_status fs_servo_get_record(fs_servo* servo, fs_tick* out, size_t capacity, size_t* count) {
  return guarded([&] {
    require_pointer(servo, "servo");
    require_pointer(count, "count");
    if (capacity) require_pointer(out, "out");
    if (!servo->is_of_this_process()) fail(FS_ERROR_STATE, "%s", parents);
    *count = servo->record().read(out, capacity);
  });
}

fs_status fs_scene_get_record(fs_scene* scene, uint64_t after, fs_recorded_tick* out, size_t capacity, size_t* count) {
  return on_scene(scene, [&] { copy_list(scene->record(after), out, capacity, count); });
}

fs_status fs_scene_get_hand(const fs_scene* scene, fs_state* state, fs_response* response, fs_wrench* sent) {
  if (!scene) return null_argument("scene is null");
  return scene->get_hand(state, response, sent);
}

fs_status fs_scene_stop_force(fs_scene* scene) {
  return on_scene(scene, [&] { scene->stop_force(); });
}

fs_status fs_scene_resume_force(fs_scene* scene) {
  return on_scene(scene, [&] { scene->resume_force(); });
}

fs_status fs_scene_get_servo_stats(fs_scene* scene, fs_servo_stats* out) {
  return on_scene(scene, [&] {
    require_pointer(out, "out");
    check_grown(out);
    fs_servo_stats stats = fs_servo_stats_init();
    scene->get_servo_stats(stats);
    write_grown(stats, out);
  });
}

fs_status fs_scene_get_device_info(fs_scene* scene, fs_device_info* out) {
  return on_scene(scene, [&] {
    require_pointer(out, "out");
    check_grown(out);
    fs_device_info info = fs_device_info_init();
    scene->get_device_info(info);
    write_grown(info, out);
  });
}
