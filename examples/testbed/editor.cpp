// The simple editor: it has a spring to a point, and changes the spring's strength as a user would with a slider. Now
// and then it changes another client's object: the strength of the viewer's western hazard.
#include <cmath>
#include <stdexcept>

#include "client.h"

static const char* const hazard_name = "viewer/hazard west";

// Changes only the strength of the hazard; the viewer may go on changing its place.
static void edit_hazard(Client& client, double newtons) {
  fs_object hazard = fs_object_init("", FS_PRIMITIVE_POINT);
  const fs_status found = fs_object_get(client.scene(), hazard_name, &hazard);
  if (found == FS_ERROR_NOT_FOUND) return client.say("%s is not there", hazard_name);
  check(found);
  hazard.front.gain = hazard.front.limit = newtons;
  const fs_status changed = fs_object_change(client.scene(), &hazard, FS_PART_PROFILES);
  fs_object_release(&hazard);
  check(changed);
  client.say("set %s to %g N", hazard_name, newtons);
}

static void edit(Client& client, const Arguments&) {
  const Terrain terrain = load_terrain(TERRAIN_FILE, exaggeration);
  fs_object spring = fs_object_init("spring", FS_PRIMITIVE_POINT);
  spring.pose.position = {-8000, 10000, terrain.height(-8000, 10000, 0) + 2000};
  spring.front = pull(3, 4000);
  check(fs_object_set(client.scene(), &spring));
  client.say("a spring of %g N", spring.front.gain);
  for (int i = 1; client.wait(0.05); ++i) {
    spring.front.gain = spring.front.limit = 3 - std::cos(i * 0.05);  // the slider: 2..4 N
    check(fs_object_change(client.scene(), &spring, FS_PART_PROFILES));
    if (i % 40 == 0) edit_hazard(client, i % 80 ? 2 : 3);
  }
  fs_curve_destroy(spring.front.curve);
}

int main(int argc, char** argv) { return run_client(argc, argv, "editor", "", 0, edit); }
