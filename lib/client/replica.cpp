#include "client/replica.h"

namespace fs {

Replica::Replica(SentAssets& sent, const Connection& connection)
    : scene(make_ref<LocalScene>(std::shared_ptr<ServoOutput>(connection.outbox(), &connection.outbox()->servo),
                                 connection.welcome().is_virtual ? ClockKind::virtual_time : ClockKind::steady)),
      max_objects(connection.welcome().max_objects), sizes(connection.sizes()), objects(sent, max_objects) {
  scene->readers.leave_unbuilt();
  scene->hold();
}

}  // namespace fs
