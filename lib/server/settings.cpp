#include "server/settings.h"

#include "base/error.h"
#include "ipc/inbox.h"

namespace fs {
namespace {

template <class T>
T parse_bound(T given, T standard, T most, const char* field) {
  if (given > most) fail(FS_ERROR_INVALID, "%s is %.9g, must be at most %.9g", field, double(given), double(most));
  return given ? given : standard;
}

}  // namespace

ServerSettings parse_options(const fs_server_options& options, const ServoSettings& servo) {
  ServerSettings out{};
  out.max_clients = parse_bound<uint32_t>(options.max_clients, 32, 4096, "max_clients");
  out.max_objects = parse_bound<uint32_t>(options.max_objects, 4096, most_slots, "max_objects");
  out.max_bytes = uint64_t{1'000'000} * parse_bound<uint32_t>(options.max_megabytes, 1024, 1'000'000, "max_megabytes");
  if (!(options.lease >= 0 && options.lease <= 1e6)) {
    fail(FS_ERROR_INVALID, "lease is %.9g, must be within 0..1e6 s", options.lease);
  }
  out.lease = options.lease > 0 ? options.lease : 0.2;
  const double most = servo.limits.force;
  if (!(options.force_limit >= 0 && options.force_limit <= most)) {
    fail(FS_ERROR_INVALID, "force_limit is %.9g, must be within 0..%.9g N, the servo's limit", options.force_limit, most);
  }
  out.limits.force = options.force_limit > 0 ? options.force_limit : most;
  // A device without torque ignores the torque that it gets: no reason to lower the force.
  out.limits.torque = servo.limits.torque_axes ? servo.limits.torque * (out.limits.force / most) : never;
  for (const uint8_t byte : options.reserved) {
    if (byte) fail(FS_ERROR_INVALID, "reserved is %u, must be 0", byte);
  }
  out.is_locked = options.locked;
  out.is_for_all_users = options.all_users;
  out.is_force_kept = options.no_stop;
  return out;
}

}  // namespace fs
