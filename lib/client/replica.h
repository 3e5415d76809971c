// This client's objects in its own process: a scene, the replica, which checks every change before it is sent, which getters
// look at, and which tools of this process evaluate. What is known of the objects at the server goes with it.
#pragma once

#include <atomic>

#include "client/own_objects.h"

namespace fs {

struct Replica {
  Replica(SentAssets& sent, const Connection& connection);

  const Ref<LocalScene> scene;
  OwnObjects objects;
  // A tool may look at the scene, so each move goes there, too, and changes are posted.
  std::atomic<bool> is_evaluated_here{false};

  void post() {
    if (is_evaluated_here) scene->post();
  }
  void catch_up_with_moves() { objects.move_replica(*scene); }
};

}  // namespace fs
