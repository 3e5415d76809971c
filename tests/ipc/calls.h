// Every call on a connected scene, to test what it returns when the connection is lost.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include <forceserver/forceserver.h>

namespace life {

struct Call {
  const char* name;  // of the function
  std::function<fs_status(fs_scene*)> run;
  fs_status when_lost = FS_ERROR_DISCONNECTED;
};

// With an own object "mine", another client's "other/theirs" and a file of a scene. fs_scene_next_event gives
// DISCONNECTED here when its events are at an end.
std::vector<Call> all_calls(const std::string& path);

}  // namespace life
