// "scheme:address?key=value&key=value": the parts of a device's URI.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace fs {

struct Uri {
  std::string scheme;   // empty when the text has none
  std::string address;  // between ':' and '?'
  std::vector<std::pair<std::string, std::string>> options;
};

// Throws INVALID for an option without '=' or a key given twice.
Uri parse_uri(const std::string& text);
// The same for what stands behind the scheme: what a driver's open is given.
Uri parse_address(const std::string& text);

// A finite number within [low, high]. Throws INVALID with key, value and bounds.
double parse_number(const std::string& key, const std::string& value, double low, double high);

}  // namespace fs
