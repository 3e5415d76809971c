#include "servo/measured_link.h"

#include <algorithm>
#include <cmath>

#include "base/text.h"

namespace fs {
namespace {

// Empty: all is well.
std::string why_not(const fs_link& link) {
  const struct {
    const char* name;
    double value, low, high;
    const char* unit;
  } fields[]{{"delay", link.delay, 0, 10, " s"},
             {"delay_p99", link.delay_p99, link.delay_p99 == 0 ? 0 : link.delay, 10, " s"},
             {"rate", link.rate, 0, 1e6, " Hz"},
             {"loss", link.loss, 0, 1, ""}};
  for (const auto& field : fields) {
    if (field.value >= field.low && field.value <= field.high) continue;
    return formatted("its driver measures a %s of %.4g%s, must be within %.4g..%.4g%s: this does not count", field.name,
                     field.value, field.unit, field.low, field.high, field.unit);
  }
  return {};
}

}  // namespace

bool MeasuredLink::look(Device& device, double now) {
  constexpr double rounding = 1e-9;
  if (std::fabs(now - looked_at_) < interval - rounding) return false;
  looked_at_ = now;
  refusal_.clear();
  fs_link link;
  if (device.get_link(link) != FS_OK) return false;
  const std::string why = why_not(link);
  const bool is_told = was_refused_ || std::fabs(now - refused_at_) < 1;
  was_refused_ = !why.empty();
  if (was_refused_) {
    if (is_told) return false;
    refused_at_ = now;
    refusal_ = why;
    return true;
  }
  newest_ = link;
  recent_[looks_++ % recent_.size()] = std::max(link.delay, link.delay_p99);
  const double longest = *std::max_element(recent_.begin(), recent_.end());
  if (longest > delay_ || longest < 0.9 * delay_) delay_ = longest;
  return true;
}

}  // namespace fs
