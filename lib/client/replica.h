// The replica: a scene in this process with this client's own objects. It checks every change before it is sent, getters look
// at it, and tools in this process evaluate it. OwnObjects has what is known of the same objects at the server.
#pragma once

#include <atomic>

#include "client/own_objects.h"

namespace fs {

struct Replica {
  Replica(SentAssets& sent, const Connection& connection);

  const Ref<LocalScene> scene;
  const uint32_t max_objects;  // as many as the server allows
  const RecordSizes sizes;     // common with the server
  OwnObjects objects;
  // A tool may look at the scene, so moves go there at once, and changes are posted.
  std::atomic<bool> is_evaluated_here{false};

  void post() {
    if (is_evaluated_here) scene->post();
  }
  void catch_up_with_moves() { objects.move_replica(*scene); }
};

}  // namespace fs
