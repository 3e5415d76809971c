// A struct of the contract as a program has it that is newer than the library: with one field more.
#pragma once

#include <cstdint>

namespace scenes {

template <class Struct>
struct Longer {
  explicit Longer(const Struct& the_known, uint64_t the_added = 0) : known(the_known), added(the_added) {
    known.struct_size = sizeof *this;
  }
  Struct known;
  uint64_t added;
};

}  // namespace scenes
