#include "file/json_text.h"

#include <algorithm>
#include <iterator>
#include <set>
#include <vector>

#include "base/whole_file.h"

namespace fs {
namespace {

using Json = nlohmann::json;

constexpr size_t max_depth = 16;  // braces and brackets within one another; a scene has 5

// Goes over text and leaves behind how far it is, for sentences. nlohmann-json reads no further than the token at hand.
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

// What nlohmann-json says behind "[json.exception.parse_error.101] parse error at line 1, column 2: ".
std::string reason_of(const Json::exception& error) {
  std::string_view text = error.what();
  text.remove_prefix(std::min(text.find("] ") + 2, text.size()));
  if (text.starts_with("parse error at ")) text.remove_prefix(std::min(text.find(": ") + 2, text.size()));
  std::string reason;
  for (const char c : text.substr(0, 200)) reason += c >= 0x20 && c < 0x7f ? c : '?';
  return reason;
}

// Goes over the text first, for what the parser of the tree does not look at: keys that are there twice, and depth.
class Checker : public nlohmann::json_sax<Json> {
 public:
  Checker(std::string_view text, const std::string& path) : text_(text), path_(path), reached_(text.data()) {}

  void check() {
    const char* end = text_.data() + text_.size();
    Json::sax_parse(CountingIterator(text_.data(), reached_), CountingIterator(end, reached_), this);
  }

  bool null() override { return true; }
  bool boolean(bool) override { return true; }
  bool number_integer(number_integer_t) override { return true; }
  bool number_unsigned(number_unsigned_t) override { return true; }
  bool number_float(number_float_t, const string_t&) override { return true; }
  bool string(string_t&) override { return true; }
  bool binary(binary_t&) override { return true; }
  bool start_object(size_t) override {
    keys_.emplace_back();
    return enter();
  }
  bool key(string_t& key) override {
    if (!keys_.back().insert(key).second) fail_here("the key " + in_quotes(key) + " is there twice");
    return true;
  }
  bool end_object() override {
    keys_.pop_back();
    return leave();
  }
  bool start_array(size_t) override { return enter(); }
  bool end_array() override { return leave(); }
  bool parse_error(size_t byte, const std::string&, const Json::exception& error) override {
    reached_ = text_.data() + std::min(byte, text_.size());  // behind the token
    fail_here(reason_of(error));
  }

 private:
  bool enter() {
    if (++depth_ > max_depth) fail_here("values lie more than " + std::to_string(max_depth) + " deep in one another");
    return true;
  }
  bool leave() {
    --depth_;
    return true;
  }
  [[noreturn]] void fail_here(const std::string& sentence) const {
    const auto offset = static_cast<size_t>(reached_ - text_.data());
    fail_at(FS_ERROR_PARSE, place_of(text_, offset, path_), "%s", sentence.c_str());
  }

  std::string_view text_;
  const std::string& path_;
  const char* reached_;
  size_t depth_ = 0;
  std::vector<std::set<std::string>> keys_;  // of the objects that are open
};

}  // namespace

Json parse_json(std::string_view text, const std::string& path) {
  Checker(text, path).check();
  return Json::parse(text);
}

}  // namespace fs
