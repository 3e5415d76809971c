// Texts and tables for people.
#pragma once

#include <cstdint>
#include <exception>
#include <string>
#include <string_view>
#include <vector>

#include <forceserver/forceserver.h>

std::string format(const char* form, ...) __attribute__((format(printf, 1, 2)));
std::string join(const std::vector<std::string>& words, const char* none);  // "a, b"; of nothing: none
std::string word_of(const char* name);           // the word for a value: "felt" for "FS_OBJECT_FELT", as in scene files
std::string fault_names(std::uint32_t faults);                              // "none", or why there is no force
std::string stop_reason(const fs_event& event);  // why the force stopped; event: about the device
std::string user_name(std::uint32_t user);       // the user's number, if there is no name
std::string fit(std::string_view text, std::size_t columns);  // at most so many characters (of UTF-8)

std::string in_shell(const std::string& word);  // in quotation marks where a shell would take it apart or change it

std::string milliseconds(double seconds);  // "0.022 ms", in at most three digits

// Flushes what was printed. Returns false when the reader of a pipe has gone.
bool write_out();

// What a function returned, or why that is not known.
struct Known {
  std::string text;
  bool is_known;
};
Known known(auto&& f) {
  try {
    return {f(), true};
  } catch (const std::exception& error) {
    return {std::string("not known: ") + error.what(), false};
  }
}

// A table with headings: the first column is aligned left, the others right.
class Table {
 public:
  explicit Table(std::vector<std::string> headings) : rows_{std::move(headings)} {}
  void add(std::vector<std::string> cells) { rows_.push_back(std::move(cells)); }
  std::vector<std::string> lines() const;

 private:
  std::vector<std::vector<std::string>> rows_;
};
