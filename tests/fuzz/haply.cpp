// The messages of the Haply Inverse Service.
#include "device/haply/dialect.h"
#include "fuzz/fuzz.h"

using fuzz::require;

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  namespace haply = fs::haply;
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  const auto is_finite = [](const std::optional<fs_vec3>& v) { return !v || std::isfinite(v->x + v->y + v->z); };
  haply::Message message;
  const char* const trouble = haply::read_message(text, message);
  require(!trouble || (message.arms.empty() && message.grips.empty() && *trouble), "a message that is none has arms");
  for (const haply::Arm& arm : message.arms) {
    require(!arm.id.empty() && is_finite(arm.position) && is_finite(arm.velocity) && is_finite(arm.force), "an arm");
    require(!arm.damping || std::isfinite(*arm.damping), "a filter");
    std::string command;
    haply::write_force(command, haply::Dialect::vector, arm.id, {1, -2.5, 1e-7});
    haply::Message echo;
    require(!haply::read_message(command, echo) && echo.arms.size() == 1, "a command that is no message:", command.c_str());
    require(!haply::read_message(haply::set_up_message(haply::Dialect::values, arm.id), echo), "a first message that is none");
  }
  for (const haply::Grip& grip : message.grips) {
    require(!grip.id.empty() && grip.buttons < 8, "a grip");
    if (!grip.orientation) continue;
    const fs_quat& q = *grip.orientation;
    require(std::fabs(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z - 1) < 1e-9, "an orientation that is no rotation");
  }
  static_cast<void>(haply::dialect_of_version(haply::version_in(std::string(text))));
  static_cast<void>(haply::dialect_of_version(text));
  return 0;
}
