// What the processor can do.
#pragma once

namespace fs {

// [rt] Whether the code for AVX2 is used. It gives the same bits as the other.
extern bool has_avx2;

// For tests, which show that it makes no difference: false: AVX2 is not used even where the processor has it.
void allow_avx2(bool is_allowed) noexcept;

}  // namespace fs
