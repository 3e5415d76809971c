// The simple viewer of the landscape. It adds the ground, a mesh that is sent to the server once, and two hazards that
// keep the hand away. It prints what happens to its objects: they are felt, or edited by others.
#include <set>

#include "client.h"

using Names = std::set<std::string>;

// softer: the objects of which it has been said that they are felt softer.
static void show(Client& client, const fs_event& event, Names& softer) {
  switch (event.kind) {
    case FS_EVENT_READY: return client.say("%s is felt", event.name);
    case FS_EVENT_REFUSED: return client.say("the server does not take %s: %s", event.name, event.text);
    case FS_EVENT_DISCONNECTED: throw std::runtime_error("the server has gone");
    case FS_EVENT_DEVICE:
      if (event.status == FS_OK) return client.say("the device %s is ready", event.name);
      return client.say("no force from the device %s: %s", event.name, event.text);
    case FS_EVENT_EDITED: {
      fs_object object = fs_object_init("", FS_PRIMITIVE_POINT);
      if (fs_object_get(client.scene(), event.name, &object) != FS_OK) {
        return client.say("%s was removed by %s", event.name, event.text);
      }
      client.say("%s was edited by %s: now %g N", event.name, event.text, object.front.gain);
      return fs_object_release(&object);
    }
    case FS_EVENT_CAPPED:
      // The event comes again and again, wherever the hand comes to such a place.
      if (!softer.insert(event.name).second) return;
      return client.say("%s is felt softer than it is set, so that the hand stays calm", event.name);
    case FS_EVENT_EXPIRED: return client.say("%s is no longer felt: its lifetime is over", event.name);
    case FS_EVENT_OVERFLOW: return client.say("%g events came too quickly to be told", event.value);
    case FS_EVENT_NONE: return;
    default: return client.say("%s: %s", event.name, event.text);
  }
}

static void view(Client& client, const Arguments&) {
  const Terrain terrain = load_terrain(TERRAIN_FILE, exaggeration);
  check(fs_scene_begin(client.scene()));  // all objects are felt from the same tick on
  add_ground(client.scene(), terrain);
  add_hazard(client.scene(), terrain, "hazard west", -7000, 3000, 2500, 3);
  add_hazard(client.scene(), terrain, "hazard south", -2500, -8500, 2500, 3);
  check(fs_scene_commit(client.scene()));
  client.say("sent the ground, %d triangles, and two hazards", 2 * (terrain.columns - 1) * (terrain.rows - 1));
  Names softer;
  while (client.wait(0.02)) {
    fs_event event;
    do {
      check(fs_scene_next_event(client.scene(), 0, &event));
      show(client, event, softer);
    } while (event.kind != FS_EVENT_NONE);
  }
}

int main(int argc, char** argv) { return run_client(argc, argv, "viewer", "", 0, view); }
