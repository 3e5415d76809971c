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

  Json() noexcept;  // null
  Json(const Json&);
  Json(Json&&) noexcept;
  Json& operator=(const Json&);
  Json& operator=(Json&&) noexcept;
  ~Json();
  explicit Json(std::same_as<bool> auto value) : value_(value) {}
  explicit Json(double value);
  explicit Json(Number value);
  explicit Json(std::string text);
  explicit Json(const char* text);
  Json(List list);
  Json(Object object);

  // What it is; null: something else.
  const bool* boolean() const { return std::get_if<bool>(&value_); }
  const Number* number() const { return std::get_if<Number>(&value_); }
  const std::string* text() const { return std::get_if<std::string>(&value_); }
  const List* list() const { return std::get_if<List>(&value_); }
  const Object* object() const { return std::get_if<Object>(&value_); }
  List* list() { return std::get_if<List>(&value_); }
  Object* object() { return std::get_if<Object>(&value_); }

 private:
  using Value = std::variant<std::nullptr_t, bool, Number, std::string, List, Object>;
  explicit Json(Value value);

  Value value_;
};

struct Json::Member {
  std::string key;
  Json value;
};

// Here, as a list of members can be made only of a whole Member.
inline Json::Json() noexcept = default;
inline Json::Json(const Json&) = default;
inline Json::Json(Json&&) noexcept = default;
inline Json& Json::operator=(const Json&) = default;
inline Json& Json::operator=(Json&&) noexcept = default;
inline Json::~Json() = default;
inline Json::Json(Value value) : value_(std::move(value)) {}
inline Json::Json(double value) : value_(Number{value, false}) {}
inline Json::Json(Number value) : value_(value) {}
inline Json::Json(std::string text) : value_(std::move(text)) {}
inline Json::Json(const char* text) : value_(std::string(text)) {}
inline Json::Json(List list) : value_(std::move(list)) {}
inline Json::Json(Object object) : value_(std::move(object)) {}

// Strict: a key that is there twice in one object, and deep nesting, are errors too. path is the name for sentences.
// Throws PARSE with line and column.
Json parse_json(std::string_view text, const std::string& path);

// On one line.
std::string to_line(const Json& value);

// On as many lines as it needs; what fits on a line stands on one.
std::string to_lines(const Json& value);

bool is_utf8(std::string_view text);

}  // namespace fs
