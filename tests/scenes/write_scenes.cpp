// write_scenes FOLDER: saves every named scene in the folder, for the test of the schema.
#include <cstdio>
#include <string>

#include "scenes/scenes.h"

int main(int, char** arguments) {
  for (const scenes::Named& named : scenes::all_scenes()) {
    const scenes::Content content = named.build();
    const scenes::Scene scene = scenes::make_scene();
    fill(scene.get(), content);
    const std::string path = std::string(arguments[1]) + "/named_" + named.name + ".json";
    if (fs_scene_save(scene.get(), path.c_str()) != FS_OK) {
      std::fprintf(stderr, "%s: %s\n", named.name, fs_last_error());
      return 1;
    }
  }
}
