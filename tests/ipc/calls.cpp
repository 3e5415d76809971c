#include "ipc/calls.h"

#include <memory>

#include "scenes/scenes.h"

namespace life {

using namespace scenes;

std::vector<Call> all_calls(const std::string& path) {
  static const fs_pose pose = at(0.01, 0, 0);
  const auto object = [](const char* name) {
    fs_object o = fs_object_init(name, FS_PRIMITIVE_POINT);
    o.front = attract(100, 2);
    return o;
  };
  const auto get = [](fs_scene* s, const char* name) {
    fs_object out = fs_object_init("", FS_PRIMITIVE_POINT);
    const fs_status status = fs_object_get(s, name, &out);
    fs_object_release(&out);
    return status;
  };
  const auto change = [=](fs_scene* s, const char* name, uint32_t parts) {
    const fs_object o = object(name);
    return fs_object_change(s, &o, parts);
  };
  return {
      {"fs_object_set", [=](fs_scene* s) { const fs_object o = object("mine"); return fs_object_set(s, &o); }},
      {"fs_object_set", [=](fs_scene* s) { const fs_object o = object("new"); return fs_object_set(s, &o); }},
      {"fs_object_get", [=](fs_scene* s) { return get(s, "mine"); }},
      {"fs_object_get", [=](fs_scene* s) { return get(s, "other/theirs"); }},
      {"fs_object_change", [=](fs_scene* s) { return change(s, "mine", FS_PART_PROFILES); }},
      {"fs_object_change", [=](fs_scene* s) { return change(s, "mine", 0); }},
      {"fs_object_change", [=](fs_scene* s) { return change(s, "other/theirs", FS_PART_PROFILES); }},
      {"fs_object_move", [](fs_scene* s) { return fs_object_move(s, "mine", &pose, nullptr, FS_NOW); }},
      {"fs_object_move", [](fs_scene* s) { return fs_object_move(s, "other/theirs", &pose, nullptr, FS_NOW); }},
      {"fs_object_remove", [](fs_scene* s) { return fs_object_remove(s, "mine"); }},
      {"fs_object_remove", [](fs_scene* s) { return fs_object_remove(s, "other/theirs"); }},
      {"fs_scene_clear", [](fs_scene* s) { return fs_scene_clear(s); }},
      {"fs_scene_begin", [](fs_scene* s) { return fs_scene_begin(s); }},
      {"fs_scene_commit", [](fs_scene* s) { return fs_scene_commit(s); }},
      {"fs_scene_cancel", [](fs_scene* s) { return fs_scene_cancel(s); }},
      {"fs_scene_sync", [](fs_scene* s) { return fs_scene_sync(s, 0); }},
      {"fs_scene_sync", [](fs_scene* s) { return fs_scene_sync(s, 30); }},
      {"fs_scene_save", [=](fs_scene* s) { return fs_scene_save(s, (path + ".saved").c_str()); }},
      {"fs_scene_load", [=](fs_scene* s) { return fs_scene_load(s, path.c_str()); }},
      {"fs_scene_set_frame", [](fs_scene* s) { const fs_frame f = fs_frame_init(); return fs_scene_set_frame(s, &f); }},
      {"fs_scene_get_frame", [](fs_scene* s) { fs_frame f; return fs_scene_get_frame(s, nullptr, &f); }},
      {"fs_scene_get_frame", [](fs_scene* s) { fs_frame f; return fs_scene_get_frame(s, "other", &f); }},
      {"fs_scene_set_clutch", [](fs_scene* s) { return fs_scene_set_clutch(s, false); }},
      {"fs_scene_set_tool", [](fs_scene* s) { return fs_scene_set_tool(s, &pose.position, 1); }},
      {"fs_scene_get_tool", [](fs_scene* s) { size_t n; return fs_scene_get_tool(s, nullptr, 0, &n); }},
      {"fs_scene_set_tool_radius", [](fs_scene* s) { return fs_scene_set_tool_radius(s, 0); }},
      {"fs_scene_get_tool_radius", [](fs_scene* s) { double r; return fs_scene_get_tool_radius(s, &r); }},
      {"fs_scene_set_accuracy", [](fs_scene* s) { return fs_scene_set_accuracy(s, 0); }},
      {"fs_scene_set_max_stiffness", [](fs_scene* s) { return fs_scene_set_max_stiffness(s, 0); }},
      {"fs_scene_get_time", [](fs_scene* s) { double t; return fs_scene_get_time(s, &t); }},
      {"fs_scene_set_time", [](fs_scene* s) { return fs_scene_set_time(s, 1); }, FS_ERROR_STATE},
      {"fs_scene_get_reports", [](fs_scene* s) { size_t n; return fs_scene_get_reports(s, nullptr, 0, &n); }},
      {"fs_scene_get_motions", [](fs_scene* s) { size_t n; return fs_scene_get_motions(s, nullptr, nullptr, 0, &n); }},
      {"fs_scene_get_motions", [](fs_scene* s) { size_t n; return fs_scene_get_motions(s, "other", nullptr, 0, &n); }},
      {"fs_scene_get_motions_since", [](fs_scene* s) { size_t n; return fs_scene_get_motions_since(s, nullptr, 0, nullptr, 0, &n); }},
      {"fs_scene_get_motions_since", [](fs_scene* s) { size_t n; return fs_scene_get_motions_since(s, "other", 0, nullptr, 0, &n); }},
      {"fs_scene_get_view", [](fs_scene* s) { fs_view v; return fs_scene_get_view(s, "other", &v); }},
      {"fs_scene_get_report", [](fs_scene* s) { fs_report r; return fs_scene_get_report(s, "mine", &r); }},
      {"fs_scene_get_report", [](fs_scene* s) { fs_report r; return fs_scene_get_report(s, "other/theirs", &r); }},
      {"fs_scene_next_event", [](fs_scene* s) { fs_event e; return fs_scene_next_event(s, 0, &e); }},
      {"fs_scene_next_event", [](fs_scene* s) { fs_event e; return fs_scene_next_event(s, 30, &e); }},
      {"fs_scene_get_hand", [](fs_scene* s) { fs_state h; return fs_scene_get_hand(s, &h, nullptr, nullptr); }},
      {"fs_scene_get_servo_stats", [](fs_scene* s) {
         fs_servo_stats out = fs_servo_stats_init();
         return fs_scene_get_servo_stats(s, &out);
       }},
      {"fs_scene_get_device_info", [](fs_scene* s) {
         fs_device_info out = fs_device_info_init();
         return fs_scene_get_device_info(s, &out);
       }},
      {"fs_scene_stop_force", [](fs_scene* s) { return fs_scene_stop_force(s); }},
      {"fs_scene_resume_force", [](fs_scene* s) { return fs_scene_resume_force(s); }},
      {"fs_scene_get_clients", [](fs_scene* s) { size_t n; return fs_scene_get_clients(s, nullptr, 0, &n); }},
      {"fs_scene_get_views", [](fs_scene* s) { size_t n; return fs_scene_get_views(s, nullptr, 0, &n); }},
      {"fs_scene_get_record", [](fs_scene* s) { size_t n; return fs_scene_get_record(s, 0, nullptr, 0, &n); }},
      {"fs_tool_create", [](fs_scene* s) {
         fs_tool* tool = nullptr;
         const fs_status status = fs_tool_create(s, nullptr, 0, &tool);
         fs_tool_destroy(tool);
         return status;
       }},
      {"fs_evaluate_field", [](fs_scene* s) {
         fs_vec3 force;
         return fs_evaluate_field(s, "mine", FS_NOW, &pose.position, 1, &force);
       }},
      {"fs_servo_start", [](fs_scene* s) {
         const Device device = open_device("sim:");
         fs_servo* servo = nullptr;
         const fs_status status = fs_servo_start(s, device.get(), nullptr, &servo);
         fs_servo_stop(servo);
         return status;
       }, FS_ERROR_UNSUPPORTED},
  };
}

}  // namespace life
