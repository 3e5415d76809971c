// JSON: text to a tree and a tree to text. nlohmann-json parses the text. Its own tree is not used, because freeing one
// allocates memory, and ends the process when there is none.
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

  // The value if it has this type, null otherwise.
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

// Defined here because a list of members needs the complete type Member.
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

// Strict: a repeated key in one object and deep nesting are errors too. path is the file's name for error sentences.
// Throws PARSE with line and column.
Json parse_json(std::string_view text, const std::string& path);

// The value on one line.
std::string to_line(const Json& value);

// The value on as many lines as it needs; a list or object that fits on one line stays on one.
std::string to_lines(const Json& value);

bool is_utf8(std::string_view text);

}  // namespace fs
