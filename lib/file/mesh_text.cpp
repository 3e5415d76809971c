#include "file/mesh_text.h"

#include <charconv>
#include <cmath>

#include "base/text.h"
#include "base/whole_file.h"

namespace fs {
namespace {

bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\v' || c == '\f'; }

// from_chars does not accept a '+'.
std::string_view without_plus(std::string_view word) {
  if (word.size() > 1 && word[0] == '+' && word[1] != '-') word.remove_prefix(1);
  return word;
}

}  // namespace

Text::Text(std::string_view bytes, const std::string& file, Rules rules, size_t first_line)
    : cursor_(bytes.data()), end_(bytes.data() + bytes.size()), file_(file), rules_(rules), line_(first_line) {
  if (bytes.starts_with("\xef\xbb\xbf")) cursor_ += 3;
  const size_t nul = bytes.find('\0');
  if (nul != bytes.npos) fail_at(FS_ERROR_PARSE, file_, "byte %zu is NUL, must be text", nul);
}

bool Text::is_continuation(const char* at) const {
  return rules_.continuation && *at == '\\' && at + 1 != end_ && is_line_end(at + 1);
}

void Text::skip_line_end() {
  const char first = *cursor_++;
  if (first == '\r' && cursor_ != end_ && *cursor_ == '\n') ++cursor_;
  ++line_;
}

std::string_view Text::word() {
  for (;;) {
    if (cursor_ == end_ || is_line_end(cursor_)) return {};
    if (is_continuation(cursor_)) {
      ++cursor_;
      skip_line_end();
    } else if (is_blank(*cursor_)) {
      ++cursor_;
    } else {
      break;
    }
  }
  if (rules_.comments && *cursor_ == '#') {
    while (cursor_ != end_ && !is_line_end(cursor_)) ++cursor_;
    return {};
  }
  const char* begin = cursor_;
  while (cursor_ != end_ && !is_blank(*cursor_) && !is_line_end(cursor_) && !is_continuation(cursor_)) ++cursor_;
  return {begin, static_cast<size_t>(cursor_ - begin)};
}

bool Text::next_line() {
  while (cursor_ != end_ && !is_line_end(cursor_)) ++cursor_;
  if (cursor_ == end_) return false;
  skip_line_end();
  return true;
}

std::string_view Text::word_anywhere() {
  for (;;) {
    const std::string_view found = word();
    if (!found.empty() || cursor_ == end_) return found;
    skip_line_end();
  }
}

void Text::fail_word(std::string_view word, const char* what, const char* must) const {
  if (word.empty()) fail_at(FS_ERROR_PARSE, where(), "%s is missing", what);
  fail_at(FS_ERROR_PARSE, where(), "%s is %s, must be %s", what, in_quotes(word).c_str(), must);
}

double Text::number(std::string_view word, const char* what) const {
  const std::string_view digits = without_plus(word);
  double value = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  if (error == std::errc::invalid_argument || end != digits.data() + digits.size()) fail_word(word, what, "a number");
  if (error == std::errc::result_out_of_range) fail_word(word, what, "within the range of a double");
  if (!std::isfinite(value)) fail_word(word, what, "finite");
  return value;
}

int64_t Text::integer(std::string_view word, const char* what) const {
  const std::string_view digits = without_plus(word);
  int64_t value = 0;
  if (!read_number(digits, value)) fail_word(word, what, "an integer");
  return value;
}

Vec3 Text::point(std::string_view x) { return {number(x, "x"), number(word(), "y"), number(word(), "z")}; }

std::string Text::where() const { return file_ + ", line " + std::to_string(line_); }

}  // namespace fs
