// The words of a scene file for the enum values of the contract: words[value] is the value's name in lower case, without
// its prefix.
#pragma once

#include <array>

#include "base/names.h"

namespace fs {

struct Word {
  char text[32];
};

template <size_t count>
constexpr std::array<Word, count> words_of(const char* const (&names)[count]) {
  std::array<Word, count> words{};
  for (size_t i = 0; i < count; ++i) {
    char* out = words[i].text;
    for (const char* c = without_prefix(names[i]); *c; ++c) {
      *out++ = *c >= 'A' && *c <= 'Z' ? static_cast<char>(*c - 'A' + 'a') : *c;
    }
  }
  return words;
}

constexpr auto primitive_words = words_of(primitive_names);
constexpr auto kind_words = words_of(profile_kind_names);
constexpr auto sense_words = words_of(sense_names);
constexpr auto keep_words = words_of(keep_names);
constexpr auto axis_words = words_of(axis_names);

constexpr int scene_version = 1;

}  // namespace fs
