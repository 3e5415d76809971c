// Parses a device's URI, "scheme:address?key=value&key=value", and the values of its options. Keys and values are taken
// literally (without %-decoding), so a value cannot contain '&'.
#pragma once

#include <cstddef>
#include <initializer_list>
#include <string>
#include <utility>
#include <vector>

#include "math/vec3.h"

namespace fs {

struct Uri {
  std::string scheme;   // empty when the text has none
  std::string address;  // between ':' and '?'
  std::vector<std::pair<std::string, std::string>> options;
};

// Throws INVALID for an option without key or '=', or a key given twice.
Uri parse_uri(const std::string& text);
// The same for the text after the scheme and its ':', which a driver's open gets.
Uri parse_address(const std::string& text);

// Throws INVALID for an unknown key; the sentence lists the known ones.
void check_keys(const Uri& uri, std::initializer_list<const char*> known);

// A finite number within [low, high]. Throws INVALID with key, value and bounds.
double parse_number(const std::string& key, const std::string& value, double low, double high);
// "X,Y,Z", each within [low, high]. Throws INVALID.
Vec3 parse_vector(const std::string& key, const std::string& value, double low, double high);
// The index of the value among the choices. Throws INVALID.
size_t parse_choice(const std::string& key, const std::string& value, std::initializer_list<const char*> choices);

}  // namespace fs
