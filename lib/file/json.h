// JSON: text to a tree and a tree to text. The text is read by nlohmann-json; its own tree is not used, because letting
// go of one takes memory, and ends the process where there is none.
#pragma once

#include <concepts>
#include <cstddef>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace fs {

class Json {
 public:
  struct Member;
  using List = std::vector<Json>;
  using Object = std::vector<Member>;  // in the order of the text
  struct Number {
    double value;
    bool is_integer;  // written without a point or exponent
  };

  Json() = default;  // null
  explicit Json(std::same_as<bool> auto value) : value_(value) {}
  explicit Json(double value) : value_(Number{value, false}) {}
  explicit Json(Number value) : value_(value) {}
  explicit Json(std::string text) : value_(std::move(text)) {}
  explicit Json(const char* text) : value_(std::string(text)) {}
  Json(List list) : value_(std::move(list)) {}
  Json(Object object) : value_(std::move(object)) {}

  // What it is; null: something else.
  const bool* boolean() const { return std::get_if<bool>(&value_); }
  const Number* number() const { return std::get_if<Number>(&value_); }
  const std::string* text() const { return std::get_if<std::string>(&value_); }
  const List* list() const { return std::get_if<List>(&value_); }
  const Object* object() const { return std::get_if<Object>(&value_); }
  List* list() { return std::get_if<List>(&value_); }
  Object* object() { return std::get_if<Object>(&value_); }

 private:
  std::variant<std::nullptr_t, bool, Number, std::string, List, Object> value_;
};

struct Json::Member {
  std::string key;
  Json value;
};

// Strict: a key that is there twice in one object, and deep nesting, are errors too. path is the name for sentences.
// Throws PARSE with line and column.
Json parse_json(std::string_view text, const std::string& path);

// On one line.
std::string to_line(const Json& value);

// On as many lines as it needs; what fits on a line stands on one.
std::string to_lines(const Json& value);

bool is_utf8(std::string_view text);

}  // namespace fs
