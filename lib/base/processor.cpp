#include "base/processor.h"

namespace fs {
namespace {

bool finds_avx2() noexcept {
#ifdef __x86_64__
  __builtin_cpu_init();
  return __builtin_cpu_supports("avx2");
#else
  return false;
#endif
}

}  // namespace

bool has_avx2 = finds_avx2();

void allow_avx2(bool is_allowed) noexcept { has_avx2 = is_allowed && finds_avx2(); }

}  // namespace fs
