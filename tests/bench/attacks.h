// What one client can do to a server, permitted or not. Each attack is a process that does nothing else.
#pragma once

#include <cstddef>

#include "client.h"

namespace bench {

struct Attack {
  const char* name;
  void (*run)(Page& page);  // until the process is killed; adds one to page.ready when it has begun
};
extern const Attack attacks[];
extern const size_t attack_count;

inline constexpr const char* victim = "honest/victim";  // an object of the honest client's that others may change

}  // namespace bench
