// Reads words and numbers from a mesh file in text form and counts its lines. Numbers do not depend on the locale.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include <forceserver/base.h>

#include "math/vec3.h"

namespace fs {

// A cursor over text. Lines end with \n, \r\n or \r; words are separated by blanks.
class Text {
 public:
  struct Rules {
    bool comments = false;      // a word that begins with '#' begins a comment up to the end of the line
    bool continuation = false;  // a '\' at the end of a line counts as a blank and joins the next line to it
  };

  // bytes and file (its name) must outlive this. A byte order mark is skipped; a NUL byte is refused, as text has none.
  Text(std::string_view bytes, const std::string& file, Rules rules, size_t first_line = 1);

  std::string_view word();           // the next word of this line; "" at its end
  bool next_line();                  // skips the rest of this line; false at the end of the file
  std::string_view word_anywhere();  // the next word of this or a later line; "" at the file's end

  // Parse a word; `what` names it in the error sentence. An empty word counts as missing.
  double number(std::string_view word, const char* what) const;  // finite
  int64_t integer(std::string_view word, const char* what) const;
  Vec3 point(std::string_view x);  // of this word and the next two of the line

  size_t line() const { return line_; }  // from 1
  size_t remaining() const { return static_cast<size_t>(end_ - cursor_); }  // bytes
  std::string where() const;  // "file, line 7"

 private:
  [[noreturn]] void fail_word(std::string_view word, const char* what, const char* must) const;
  bool is_line_end(const char* at) const { return *at == '\n' || *at == '\r'; }
  bool is_continuation(const char* at) const;
  void skip_line_end();

  const char* cursor_;
  const char* end_;
  const std::string& file_;
  Rules rules_;
  size_t line_;
};

}  // namespace fs
