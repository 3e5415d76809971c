#include "driver/uri.h"

#include <cmath>
#include <string_view>

#include "base/error.h"
#include "base/text.h"

namespace fs {
namespace {

std::string join(std::initializer_list<const char*> words) {
  std::string text;
  for (const char* word : words) text += (text.empty() ? "" : ", ") + std::string(word);
  return text;
}

void parse_option(std::string_view option, Uri& uri) {
  const size_t equals = option.find('=');
  if (equals == std::string_view::npos || equals == 0) {
    fail(FS_ERROR_INVALID, "option '%s' must be key=value", std::string(option).c_str());
  }
  const std::string key(option.substr(0, equals));
  for (const auto& [other, value] : uri.options) {
    if (other == key) fail(FS_ERROR_INVALID, "option '%s' is given twice", key.c_str());
  }
  uri.options.emplace_back(key, option.substr(equals + 1));
}

// Reads the whole text as a number, independent of the locale; NaN when it is not a number. "inf" gives infinity.
double number_of(std::string_view text) {
  double number = 0;
  return read_number(text, number) ? number : NAN;
}

}  // namespace

Uri parse_address(const std::string& text) {
  Uri uri;
  const size_t question = text.find('?');
  uri.address = text.substr(0, question);
  if (question == std::string::npos || question + 1 == text.size()) return uri;
  std::string_view rest = std::string_view(text).substr(question + 1);
  for (;;) {
    const size_t end = rest.find('&');
    parse_option(rest.substr(0, end), uri);
    if (end == std::string_view::npos) return uri;
    rest.remove_prefix(end + 1);
  }
}

Uri parse_uri(const std::string& text) {
  Uri uri = parse_address(text);
  const size_t colon = uri.address.find(':');
  if (colon != std::string::npos) {
    uri.scheme = uri.address.substr(0, colon);
    uri.address.erase(0, colon + 1);
  }
  return uri;
}

void check_keys(const Uri& uri, std::initializer_list<const char*> known) {
  for (const auto& [key, value] : uri.options) {
    bool found = false;
    for (const char* name : known) found = found || key == name;
    if (!found) fail(FS_ERROR_INVALID, "option '%s' is unknown; the options are %s", key.c_str(), join(known).c_str());
  }
}

double parse_number(const std::string& key, const std::string& value, double low, double high) {
  const double number = number_of(value);
  if (!(number >= low && number <= high)) {
    fail(FS_ERROR_INVALID, "%s is '%s', must be a number within %.9g..%.9g", key.c_str(), value.c_str(), low, high);
  }
  return number;
}

Vec3 parse_vector(const std::string& key, const std::string& value, double low, double high) {
  double parts[3] = {NAN, NAN, NAN};
  std::string_view rest = value;
  for (int i = 0; i < 3; ++i) {
    const size_t comma = i < 2 ? rest.find(',') : std::string_view::npos;
    if (i < 2 && comma == std::string_view::npos) break;
    parts[i] = number_of(rest.substr(0, comma));
    if (i < 2) rest.remove_prefix(comma + 1);
  }
  for (const double part : parts) {
    if (!(part >= low && part <= high)) {
      fail(FS_ERROR_INVALID, "%s is '%s', must be three numbers X,Y,Z, each within %.9g..%.9g", key.c_str(), value.c_str(), low,
           high);
    }
  }
  return {parts[0], parts[1], parts[2]};
}

size_t parse_choice(const std::string& key, const std::string& value, std::initializer_list<const char*> choices) {
  size_t i = 0;
  for (const char* choice : choices) {
    if (value == choice) return i;
    ++i;
  }
  fail(FS_ERROR_INVALID, "%s is '%s', must be one of %s", key.c_str(), value.c_str(), join(choices).c_str());
}

}  // namespace fs
