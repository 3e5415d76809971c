// The address of a device, "place?key=value&key=value": what follows the scheme and its ':' in a URI, as a driver's open gets
// it. Keys and values are taken literally (without %-decoding), so a value cannot contain '&'. What is wrong is thrown as an
// INVALID Refusal, with key, value and bounds.
#pragma once

#include <array>
#include <cstddef>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace fs {

class Address {
 public:
  // Throws for an option without key or '=', for a key given twice, and for one that is not among the known.
  Address(std::string_view text, std::initializer_list<const char*> known_keys);

  const std::string& place() const noexcept { return place_; }  // before the '?'
  bool has(std::string_view key) const noexcept { return find(key) != nullptr; }

  // The value of an option; nothing where it is not given.
  std::optional<std::string> text(std::string_view key) const;
  std::optional<double> number(std::string_view key, double low, double high) const;                 // within [low, high]
  std::optional<size_t> whole(std::string_view key, size_t low, size_t high) const;                  // a whole one
  std::optional<std::array<double, 3>> vector(std::string_view key, double low, double high) const;  // "X,Y,Z"
  std::optional<size_t> choice(std::string_view key, std::initializer_list<const char*> choices) const;  // its index

 private:
  using Option = std::pair<std::string, std::string>;
  const std::string* find(std::string_view key) const noexcept;
  void add(std::string_view option);

  std::string place_;
  std::vector<Option> options_;
};

}  // namespace fs
