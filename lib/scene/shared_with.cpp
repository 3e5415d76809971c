#include "scene/shared_with.h"

namespace fs {

std::string SharedWith::text(size_t room) const {
  std::string list, out;
  for (size_t shown = 0; shown <= names.size(); ++shown) {
    if (shown > 0) list += (shown > 1 ? ", " : "") + names[shown - 1];
    const size_t more = count - shown;
    std::string whole = list;
    if (more > 0) whole = shown > 0 ? list + " and " + std::to_string(more) + " more" : std::to_string(more) + " others";
    if (more == 1 && shown == 0) whole = "another";
    if (has_clients) whole += whole.empty() ? "other clients" : "; other clients";
    if (whole.size() <= room) out = whole;
  }
  return out;
}

}  // namespace fs
