#include <forceserver/scene.h>

#include "api/on_scene.h"
#include "base/grown.h"
#include "base/names.h"
#include "client/remote_scene.h"
#include "field/frame.h"
#include "field/motion.h"
#include "file/scene_file.h"

using namespace fs;

const char* fs_object_state_name(fs_object_state state) {
  return name_of(object_state_names, state, "an unknown fs_object_state");
}

const char* fs_event_kind_name(fs_event_kind kind) { return name_of(event_kind_names, kind, "an unknown fs_event_kind"); }

namespace {

double time_of(const fs_scene& scene) {
  double time = 0;
  if (const fs_status status = scene.get_time(time); status != FS_OK) fail(status, "%s", last_error());
  return time;
}

}  // namespace

fs_status fs_scene_create(fs_scene** out) {
  return guarded([&] {
    require_pointer(out, "out");
    *out = make_ref<LocalScene>().detach();
  });
}

fs_status fs_scene_connect(const char* endpoint, const char* client_name, fs_scene** out) {
  return guarded([&] {
    require_pointer(endpoint, "endpoint");
    require_pointer(client_name, "client_name");
    require_pointer(out, "out");
    const std::string name = parse_name(client_name, "client_name");
    if (name == "server") fail(FS_ERROR_INVALID, "client_name is 'server', which is the name of the server's own scene");
    *out = make_ref<RemoteScene>(parse_endpoint(endpoint, false), name).detach();
  });
}

void fs_scene_destroy(fs_scene* scene) {
  if (!scene) return;
  scene->close();
  scene->release();
}

fs_status fs_object_set(fs_scene* scene, const fs_object* object) {
  return on_scene(scene, [&] {
    require_pointer(object, "object");
    scene->set(read_grown(object));
  });
}

fs_status fs_object_get(fs_scene* scene, const char* name, fs_object* out) {
  return on_scene(scene, [&] {
    require_pointer(name, "name");
    require_pointer(out, "out");
    check_grown(out);
    fs_object object;
    Ref<const Object> owner = scene->get(name, object);
    object.owner = const_cast<Object*>(owner.detach());
    write_grown(object, out);
  });
}

fs_status fs_object_change(fs_scene* scene, const fs_object* object, uint32_t parts) {
  return on_scene(scene, [&] {
    require_pointer(object, "object");
    scene->change(read_grown(object), parts);
  });
}

fs_status fs_object_move(fs_scene* scene, const char* name, const fs_pose* pose, const fs_twist* twist, double time) {
  return on_scene(scene, [&] {
    require_pointer(name, "name");
    require_pointer(pose, "pose");
    scene->move(name, *pose, twist, time);
  });
}

fs_status fs_object_remove(fs_scene* scene, const char* name) {
  return on_scene(scene, [&] {
    require_pointer(name, "name");
    scene->remove(name);
  });
}

fs_status fs_scene_clear(fs_scene* scene) {
  return on_scene(scene, [&] { scene->clear(); });
}

fs_status fs_scene_begin(fs_scene* scene) {
  return on_scene(scene, [&] { scene->begin(); });
}

fs_status fs_scene_commit(fs_scene* scene) {
  return on_scene(scene, [&] { scene->commit(); });
}

fs_status fs_scene_cancel(fs_scene* scene) {
  return on_scene(scene, [&] { scene->cancel(); });
}

fs_status fs_scene_sync(fs_scene* scene, double timeout) {
  return on_scene(scene, [&] { scene->sync(timeout); });
}

fs_status fs_scene_save(fs_scene* scene, const char* path) {
  return on_scene(scene, [&] {
    require_pointer(path, "path");
    const Scene::Contents contents = scene->contents();
    SceneDescription description;
    description.objects = contents.objects;
    description.frame = contents.frame;
    description.tool = contents.tool;
    description.tool_radius = contents.tool_radius;
    write_scene_file(path, description, time_of(*scene));
  });
}

fs_status fs_scene_load(fs_scene* scene, const char* path) {
  return on_scene(scene, [&] {
    require_pointer(path, "path");
    const SceneDescription description = read_scene_file(path, time_of(*scene));
    try {
      scene->set_contents(description.objects, description.frame, description.tool, description.tool_radius);
    } catch (Error& error) {
      error.text = std::string(path) + ": " + error.text;
      throw;
    }
  });
}

fs_status fs_frame_to_scene(const fs_frame* frame, const fs_pose* pose, fs_pose* out) {
  return guarded([&] {
    require_pointer(frame, "frame");
    require_pointer(pose, "pose");
    require_pointer(out, "out");
    *out = to_scene(parse_frame(*frame), parse_pose(*pose, "pose"));
  });
}

fs_status fs_frame_to_device(const fs_frame* frame, const fs_pose* pose, fs_pose* out) {
  return guarded([&] {
    require_pointer(frame, "frame");
    require_pointer(pose, "pose");
    require_pointer(out, "out");
    *out = to_device(parse_frame(*frame), parse_pose(*pose, "pose"));
  });
}

fs_status fs_scene_set_frame(fs_scene* scene, const fs_frame* frame) {
  return on_scene(scene, [&] {
    require_pointer(frame, "frame");
    scene->set_frame(*frame);
  });
}

fs_status fs_scene_get_frame(fs_scene* scene, const char* client, fs_frame* out) {
  return on_scene(scene, [&] {
    require_pointer(out, "out");
    *out = scene->get_frame(client);
  });
}

fs_status fs_scene_set_clutch(fs_scene* scene, bool held) {
  return on_scene(scene, [&] { scene->set_clutch(held); });
}

fs_status fs_scene_set_tool(fs_scene* scene, const fs_vec3* points, size_t count) {
  return on_scene(scene, [&] {
    require_pointer(points, "points");
    scene->set_tool(points, count);
  });
}

fs_status fs_scene_set_tool_radius(fs_scene* scene, double radius) {
  return on_scene(scene, [&] { scene->set_tool_radius(radius); });
}

fs_status fs_scene_get_tool_radius(fs_scene* scene, double* out) {
  return on_scene(scene, [&] {
    require_pointer(out, "out");
    *out = scene->get_tool_radius();
  });
}

fs_status fs_scene_get_tool(fs_scene* scene, fs_vec3* out, size_t capacity, size_t* count) {
  return on_scene(scene, [&] { copy_list(scene->get_tool(), out, capacity, count); });
}

fs_status fs_scene_get_view(fs_scene* scene, const char* client, fs_view* out) {
  return on_scene(scene, [&] {
    require_pointer(out, "out");
    *out = scene->view(client);
  });
}

fs_status fs_scene_set_accuracy(fs_scene* scene, double newtons) {
  return on_scene(scene, [&] { scene->set_accuracy(newtons); });
}

fs_status fs_scene_set_max_stiffness(fs_scene* scene, double stiffness) {
  return on_scene(scene, [&] { scene->set_max_stiffness(stiffness); });
}

fs_status fs_scene_get_time(const fs_scene* scene, double* out) {
  if (!scene) return null_argument("scene is null");
  if (!out) return null_argument("out is null");
  return scene->get_time(*out);
}

fs_status fs_scene_set_time(fs_scene* scene, double time) {
  if (!scene) return null_argument("scene is null");
  return scene->set_time(time);
}

fs_status fs_scene_get_reports(fs_scene* scene, fs_report* out, size_t capacity, size_t* count) {
  return on_scene(scene, [&] { copy_list(scene->reports(), out, capacity, count); });
}

fs_status fs_scene_get_report(fs_scene* scene, const char* name, fs_report* out) {
  return on_scene(scene, [&] {
    require_pointer(name, "name");
    require_pointer(out, "out");
    *out = scene->report(name);
  });
}

fs_status fs_motion_at(const fs_motion* motion, double time, fs_pose* out) {
  return guarded([&] {
    require_pointer(motion, "motion");
    require_pointer(out, "out");
    const double at = parse_finite(time, "time");
    constexpr double no_blend = 0;  // s: of a tool of one's own
    *out = parse_motion({motion->pose, motion->twist, motion->time, motion->horizon}, "motion.").at(at, no_blend);
  });
}

fs_status fs_scene_get_motions(fs_scene* scene, const char* client, fs_motion* out, size_t capacity, size_t* count) {
  return on_scene(scene, [&] { copy_list(scene->motions(client), out, capacity, count); });
}

fs_status fs_scene_get_motions_since(fs_scene* scene, const char* client, uint64_t since, fs_motion* out, size_t capacity,
                                     size_t* count) {
  return on_scene(scene, [&] { copy_list(scene->motions_since(client, since), out, capacity, count); });
}

fs_status fs_scene_next_event(fs_scene* scene, double timeout, fs_event* out) {
  return on_scene(scene, [&] {
    require_pointer(out, "out");
    *out = scene->next_event(timeout);
  });
}
