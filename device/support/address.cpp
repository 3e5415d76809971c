#include "device/support/address.h"

#include <charconv>
#include <cmath>

#include "device/support/refusal.h"

namespace fs {
namespace {

std::string joined(std::initializer_list<const char*> words) {
  std::string text;
  for (const char* word : words) text += (text.empty() ? "" : ", ") + std::string(word);
  return text;
}

// The whole text as a number, independent of the locale; NaN when it is not a number.
double number_of(std::string_view text) {
  double number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  return error == std::errc() && end == text.data() + text.size() ? number : NAN;
}

}  // namespace

Address::Address(std::string_view text, std::initializer_list<const char*> known_keys) {
  const size_t question = text.find('?');
  place_ = text.substr(0, question);
  if (question == std::string_view::npos || question + 1 == text.size()) return;
  std::string_view rest = text.substr(question + 1);
  for (;;) {
    const size_t end = rest.find('&');
    add(rest.substr(0, end));
    if (end == std::string_view::npos) break;
    rest.remove_prefix(end + 1);
  }
  for (const auto& [key, value] : options_) {
    bool is_known = false;
    for (const char* name : known_keys) is_known = is_known || key == name;
    if (is_known) continue;
    if (known_keys.size() == 0) refuse(FS_ERROR_INVALID, "option '%s' is unknown; there are no options", shortened(key).c_str());
    refuse(FS_ERROR_INVALID, "option '%s' is unknown; the options are %s", shortened(key).c_str(), joined(known_keys).c_str());
  }
}

void Address::add(std::string_view option) {
  const size_t equals = option.find('=');
  if (equals == std::string_view::npos || equals == 0) {
    refuse(FS_ERROR_INVALID, "option '%s' must be key=value", shortened(option).c_str());
  }
  const std::string key(option.substr(0, equals));
  if (has(key)) refuse(FS_ERROR_INVALID, "option '%s' is given twice", shortened(key).c_str());
  options_.emplace_back(key, option.substr(equals + 1));
}

const std::string* Address::find(std::string_view key) const noexcept {
  for (const auto& [name, value] : options_) {
    if (name == key) return &value;
  }
  return nullptr;
}

std::optional<std::string> Address::text(std::string_view key) const {
  const std::string* const value = find(key);
  if (value && value->empty()) refuse(FS_ERROR_INVALID, "option '%s' is empty", std::string(key).c_str());
  return value ? std::optional(*value) : std::nullopt;
}

std::optional<double> Address::number(std::string_view key, double low, double high) const {
  const std::string* const value = find(key);
  if (!value) return std::nullopt;
  const double number = number_of(*value);
  if (!(number >= low && number <= high)) {
    refuse(FS_ERROR_INVALID, "%s is '%s', must be a number within %.9g..%.9g", std::string(key).c_str(),
           shortened(*value).c_str(), low, high);
  }
  return number;
}

std::optional<size_t> Address::whole(std::string_view key, size_t low, size_t high) const {
  const std::string* const value = find(key);
  if (!value) return std::nullopt;
  size_t number = 0;
  const auto [end, error] = std::from_chars(value->data(), value->data() + value->size(), number);
  if (error != std::errc() || end != value->data() + value->size() || number < low || number > high) {
    refuse(FS_ERROR_INVALID, "%s is '%s', must be a whole number within %zu..%zu", std::string(key).c_str(),
           shortened(*value).c_str(), low, high);
  }
  return number;
}

std::optional<std::array<double, 3>> Address::vector(std::string_view key, double low, double high) const {
  const std::string* const value = find(key);
  if (!value) return std::nullopt;
  std::array<double, 3> parts{NAN, NAN, NAN};
  std::string_view rest = *value;
  for (size_t i = 0; i < parts.size(); ++i) {
    const bool is_last = i + 1 == parts.size();
    const size_t comma = is_last ? std::string_view::npos : rest.find(',');
    if (!is_last && comma == std::string_view::npos) break;
    parts[i] = number_of(rest.substr(0, comma));
    if (!is_last) rest.remove_prefix(comma + 1);
  }
  for (const double part : parts) {
    if (!(part >= low && part <= high)) {
      refuse(FS_ERROR_INVALID, "%s is '%s', must be three numbers X,Y,Z, each within %.9g..%.9g", std::string(key).c_str(),
             shortened(*value).c_str(), low, high);
    }
  }
  return parts;
}

std::optional<size_t> Address::choice(std::string_view key, std::initializer_list<const char*> choices) const {
  const std::string* const value = find(key);
  if (!value) return std::nullopt;
  size_t i = 0;
  for (const char* choice : choices) {
    if (*value == choice) return i;
    ++i;
  }
  refuse(FS_ERROR_INVALID, "%s is '%s', must be one of %s", std::string(key).c_str(), shortened(*value).c_str(),
         joined(choices).c_str());
}

}  // namespace fs
