#include <forceserver/server.h>

#include "api/on_scene.h"
#include "base/grown.h"
#include "scene/scene.h"
#include "server/server.h"

using namespace fs;

fs_status fs_server_start(fs_servo* servo, const char* endpoint, const fs_server_options* options, fs_server** out) {
  return guarded([&] {
    require_pointer(servo, "servo");
    require_pointer(endpoint, "endpoint");
    require_pointer(out, "out");
    const fs_server_options given = options ? read_grown(options) : fs_server_options_init();
    if (!servo->is_of_this_process()) fail(FS_ERROR_STATE, "servo was started by the parent of this process");
    const Endpoint place = parse_endpoint(endpoint, true);
    const ServerSettings settings = parse_options(given, servo->settings());
    *out = make_ref<fs_server>(Ref<Servo>::retain(servo), place, settings).detach();
  });
}

void fs_server_stop(fs_server* server) {
  if (!server || !server->servo().is_of_this_process()) return;
  server->stop();
  server->release();
}

fs_status fs_scene_get_clients(fs_scene* scene, fs_client* out, size_t capacity, size_t* count) {
  return on_scene(scene, [&] { copy_list(scene->clients(), out, capacity, count); });
}

fs_status fs_scene_get_views(fs_scene* scene, fs_client_view* out, size_t capacity, size_t* count) {
  return on_scene(scene, [&] { copy_list(scene->views(), out, capacity, count); });
}
