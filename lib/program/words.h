// Words and tables for people.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include <forceserver/forceserver.h>

std::string format(const char* form, ...) __attribute__((format(printf, 1, 2)));
std::string join(const std::vector<std::string>& words, const char* none);  // "a, b"; of nothing: none
std::string word_of(const char* name);           // of a value: "FS_OBJECT_FELT" is "felt", as a scene file has it
std::string fault_names(std::uint32_t faults);                              // "none", or why there is no force
std::string stop_reason(const fs_event& event);  // why the force stopped, of an event about the device
std::string user_name(std::uint32_t user);       // its number, if it has none
std::string fit(std::string_view text, std::size_t columns);  // at most so many characters (of UTF-8)

// Sends on what was printed. false: whoever read it has gone.
bool write_out();

// Columns under their headings: the first to the left, the others to the right.
class Table {
 public:
  explicit Table(std::vector<std::string> headings) : rows_{std::move(headings)} {}
  void add(std::vector<std::string> cells) { rows_.push_back(std::move(cells)); }
  std::vector<std::string> lines() const;

 private:
  std::vector<std::vector<std::string>> rows_;
};
