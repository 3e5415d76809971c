// A number of quadruple precision (IEEE 754), whose mantissa has 113 bits.
#pragma once

#include <limits>

namespace fs {

#ifdef __SIZEOF_FLOAT128__
using Quad = __float128;
#else  // as on aarch64
using Quad = long double;
static_assert(std::numeric_limits<Quad>::digits == 113);
#endif

}  // namespace fs
