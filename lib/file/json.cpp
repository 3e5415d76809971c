#include "file/json.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <iterator>
#include <set>

#include <nlohmann/json.hpp>

#include "base/text.h"
#include "base/whole_file.h"

namespace fs {
namespace {

constexpr size_t max_depth = 16;  // levels of nested braces and brackets; a scene has 5

// Iterates over text and records its position for error sentences. nlohmann-json never reads beyond the present token.
class CountingIterator {
 public:
  using iterator_category = std::input_iterator_tag;
  using value_type = char;
  using difference_type = std::ptrdiff_t;
  using pointer = const char*;
  using reference = const char&;

  CountingIterator(const char* at, const char*& reached) : at_(at), reached_(&reached) {}
  const char& operator*() const { return *at_; }
  CountingIterator& operator++() {
    *reached_ = ++at_;
    return *this;
  }
  CountingIterator operator++(int) {
    CountingIterator old = *this;
    ++*this;
    return old;
  }
  bool operator==(const CountingIterator& other) const { return at_ == other.at_; }

 private:
  const char* at_;
  const char** reached_;
};

std::string place_of(std::string_view text, size_t offset, const std::string& path) {
  const std::string_view before = text.substr(0, offset);
  const auto line = 1 + std::count(before.begin(), before.end(), '\n');
  const size_t column = before.size() - (before.rfind('\n') + 1);  // bytes; npos + 1 is 0
  return path + ", line " + std::to_string(line) + ", column " + std::to_string(column);
}

// The message of nlohmann-json after "[json.exception.parse_error.101] parse error at line 1, column 2: ".
std::string reason_of(const nlohmann::json::exception& error) {
  std::string_view text = error.what();
  text.remove_prefix(std::min(text.find("] ") + 2, text.size()));
  if (text.starts_with("parse error at ")) text.remove_prefix(std::min(text.find(": ") + 2, text.size()));
  std::string reason;
  for (const char c : text.substr(0, 200)) reason += c >= 0x20 && c < 0x7f ? c : '?';
  return reason;
}

class Builder : public nlohmann::json_sax<nlohmann::json> {
 public:
  Builder(std::string_view text, const std::string& path) : text_(text), path_(path), reached_(text.data()) {}

  Json build() {
    const char* end = text_.data() + text_.size();
    nlohmann::json::sax_parse(CountingIterator(text_.data(), reached_), CountingIterator(end, reached_), this);
    return std::move(root_);
  }

  bool null() override { return add(Json()); }
  bool boolean(bool value) override { return add(Json(value)); }
  bool number_integer(number_integer_t value) override { return add(Json(Json::Number{static_cast<double>(value), true})); }
  bool number_unsigned(number_unsigned_t value) override { return add(Json(Json::Number{static_cast<double>(value), true})); }
  bool number_float(number_float_t value, const string_t&) override { return add(Json(value)); }
  bool string(string_t& value) override { return add(Json(std::move(value))); }
  bool binary(binary_t&) override { return add(Json()); }  // never occurs in text
  bool start_object(size_t) override { return enter(Json(Json::Object())); }
  bool key(string_t& key) override {
    if (!keys_.back().insert(key).second) fail_here("the key " + in_quotes(key) + " is given twice");
    open_.back()->object()->push_back({std::move(key), Json()});
    return true;
  }
  bool end_object() override { return leave(); }
  bool start_array(size_t) override { return enter(Json(Json::List())); }
  bool end_array() override { return leave(); }
  bool parse_error(size_t byte, const std::string&, const nlohmann::json::exception& error) override {
    reached_ = text_.data() + std::min(byte, text_.size());  // the end of the token
    fail_here(reason_of(error));
  }

 private:
  // Adds a value to the innermost open list or object. Pointers to open values stay valid: each is the last child of
  // its parent, which does not grow until the child is closed.
  bool add(Json value) {
    last_ = &root_;
    if (!open_.empty()) {
      if (Json::List* const list = open_.back()->list()) {
        last_ = &list->emplace_back();
      } else {
        last_ = &open_.back()->object()->back().value;
      }
    }
    *last_ = std::move(value);
    return true;
  }
  bool enter(Json value) {
    if (open_.size() == max_depth) {
      fail_here("values are nested more than " + std::to_string(max_depth) + " levels deep");
    }
    add(std::move(value));
    open_.push_back(last_);
    keys_.emplace_back();
    return true;
  }
  bool leave() {
    open_.pop_back();
    keys_.pop_back();
    return true;
  }
  [[noreturn]] void fail_here(const std::string& sentence) const {
    const auto offset = static_cast<size_t>(reached_ - text_.data());
    fail_at(FS_ERROR_PARSE, place_of(text_, offset, path_), "%s", sentence.c_str());
  }

  std::string_view text_;
  const std::string& path_;
  const char* reached_;
  Json root_;
  Json* last_ = nullptr;                     // the value added last
  std::vector<Json*> open_;                  // lists and objects that have not ended
  std::vector<std::set<std::string>> keys_;  // the keys of each open value
};

// ---- tree to text

constexpr size_t line_width = 110;  // columns

void print_number(std::string& out, Json::Number number) {
  char digits[40];
  const double size = std::fabs(number.value);
  const bool is_plain = size == 0 || (size >= 1e-5 && size < 1e15);
  const auto format = is_plain ? std::chars_format::fixed : std::chars_format::scientific;
  out.append(digits, std::to_chars(digits, digits + sizeof digits, number.value, format).ptr);
  const bool is_round = is_plain && number.value == std::trunc(number.value);
  if (is_round && !number.is_integer) out += ".0";
}

void print_text(std::string& out, std::string_view text) {
  out += '"';
  for (const char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    if (static_cast<unsigned char>(c) >= 0x20) {
      out += c;
    } else {
      char escaped[8];
      std::snprintf(escaped, sizeof escaped, "\\u%04x", static_cast<unsigned>(c));
      out += escaped;
    }
  }
  out += '"';
}

bool is_structured(const Json& value) { return value.list() || value.object(); }

// Calls f(key, value) for each child of a list (key: null) or object.
template <class F>
void for_each(const Json& value, F f) {
  if (const Json::List* const list = value.list()) {
    for (const Json& child : *list) f(nullptr, child);
  } else {
    for (const auto& [key, child] : *value.object()) f(&key, child);
  }
}

void print_key(std::string& out, const std::string* key) {
  if (!key) return;
  print_text(out, *key);
  out += ": ";
}

void print_on_one_line(std::string& out, const Json& value) {
  if (const bool* const boolean = value.boolean()) {
    out += *boolean ? "true" : "false";
  } else if (const Json::Number* const number = value.number()) {
    print_number(out, *number);
  } else if (const std::string* const text = value.text()) {
    print_text(out, *text);
  } else if (!is_structured(value)) {
    out += "null";
  } else {
    out += value.list() ? '[' : '{';
    const char* separator = "";
    for_each(value, [&](const std::string* key, const Json& child) {
      out += separator;
      print_key(out, key);
      print_on_one_line(out, child);
      separator = ", ";
    });
    out += value.list() ? ']' : '}';
  }
}

// Appends value; its first line begins at `column`, the following ones at `indent`.
void print(std::string& out, const Json& value, size_t indent, size_t column) {
  std::string line;
  print_on_one_line(line, value);
  if (!is_structured(value) || column + line.size() <= line_width) {
    out += line;
    return;
  }
  line = {};
  const std::string margin(indent + 2, ' ');
  const bool has_scalars = value.list() && !value.list()->empty() && !is_structured(value.list()->front());
  out += value.list() ? '[' : '{';
  size_t used = line_width;  // columns of the present line
  const char* separator = "";
  for_each(value, [&](const std::string* key, const Json& child) {
    out += separator;
    separator = ",";
    if (has_scalars) {  // put as many on a line as fit
      const std::string text = to_line(child);
      if (used + text.size() + 3 > line_width) {
        out += "\n" + margin;
        used = margin.size();
      } else {
        out += ' ';
        ++used;
      }
      out += text;
      used += text.size() + 1;
      return;
    }
    std::string head = margin;
    print_key(head, key);
    out += "\n" + head;
    print(out, child, indent + 2, head.size());
  });
  out += "\n" + std::string(indent, ' ') + (value.list() ? ']' : '}');
}

}  // namespace

Json parse_json(std::string_view text, const std::string& path) { return Builder(text, path).build(); }

std::string to_line(const Json& value) {
  std::string out;
  print_on_one_line(out, value);
  return out;
}

std::string to_lines(const Json& value) {
  std::string out;
  print(out, value, 0, line_width);  // a full line as start column: the outermost braces get lines of their own
  return out;
}

bool is_utf8(std::string_view text) {
  for (size_t i = 0; i < text.size();) {
    const auto byte = [&](size_t k) { return i + k < text.size() ? static_cast<unsigned char>(text[i + k]) : 0u; };
    const unsigned first = byte(0);
    const size_t length = first < 0x80 ? 1 : first < 0xe0 ? 2 : first < 0xf0 ? 3 : 4;
    uint32_t code = length == 1 ? first : first & (0x7fu >> length);
    for (size_t k = 1; k < length; ++k) {
      if ((byte(k) & 0xc0) != 0x80) return false;
      code = code << 6 | (byte(k) & 0x3f);
    }
    constexpr uint32_t least[] = {0, 0x80, 0x800, 0x10000};
    const bool is_lead = length == 1 || first >= 0xc0;
    if (!is_lead || first > 0xf4 || code < least[length - 1] || code > 0x10ffff) return false;
    if (code >= 0xd800 && code < 0xe000) return false;  // UTF-16 surrogates
    i += length;
  }
  return true;
}

}  // namespace fs
