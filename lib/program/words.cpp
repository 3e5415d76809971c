#include "words.h"

#include <pwd.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cstdarg>
#include <cstdio>
#include <cstring>
#include <stdexcept>

namespace {

bool begins_character(char byte) { return (byte & 0xc0) != 0x80; }  // of UTF-8

std::size_t characters(std::string_view text) { return std::size_t(std::count_if(text.begin(), text.end(), begins_character)); }

}  // namespace

std::string format(const char* form, ...) {
  char text[1024];
  va_list arguments;
  va_start(arguments, form);
  std::vsnprintf(text, sizeof text, form, arguments);
  va_end(arguments);
  return text;
}

std::string join(const std::vector<std::string>& words, const char* none) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : ", ") + word;
  return text.empty() ? none : text;
}

std::string word_of(const char* name) {
  const std::string_view all = name;
  if (!all.starts_with("FS_")) return name;  // "an unknown fs_event_kind"
  std::string word(all.substr(all.find('_', 3) + 1));
  for (char& c : word) c = char(std::tolower(static_cast<unsigned char>(c)));
  return word;
}

std::string fault_names(std::uint32_t faults) {
  std::vector<std::string> names;
  if (faults & FS_FAULT_DEVICE) names.push_back("the device is not ready");
  if (faults & FS_FAULT_SPEED) names.push_back("the hand was too fast");
  if (faults & FS_FAULT_NUMBER) names.push_back("a pose or force was not finite");
  if (faults & FS_FAULT_LATE) names.push_back("the servo was late too long");
  return join(names, "none");
}

std::string stop_reason(const fs_event& event) {
  const std::string_view text = event.text, prefix = "stopped: ";
  return std::string(text.starts_with(prefix) ? text.substr(prefix.size()) : text);
}

std::string user_name(std::uint32_t user) {
  const passwd* const entry = getpwuid(user);
  return entry ? entry->pw_name : std::to_string(user);
}

std::string fit(std::string_view text, std::size_t columns) {
  std::size_t end = 0;
  for (; end < text.size(); ++end) {
    if (begins_character(text[end]) && columns-- == 0) break;
  }
  return std::string(text.substr(0, end));
}

std::string in_shell(const std::string& word) {
  const auto is_plain = [](char c) { return std::isalnum(static_cast<unsigned char>(c)) || std::strchr("-_.,:/@%+=", c); };
  if (!word.empty() && std::all_of(word.begin(), word.end(), is_plain)) return word;
  std::string quoted = "'";
  for (const char c : word) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return quoted + "'";
}

std::string milliseconds(double seconds) {
  const double value = seconds * 1e3;
  return format(value < 100 ? "%.3g ms" : "%.0f ms", value);
}

bool write_out() {
  if (std::fflush(stdout) == 0 && !std::ferror(stdout)) return true;
  if (errno == EPIPE) return false;
  throw std::runtime_error(std::string("cannot write: ") + std::strerror(errno));
}

std::vector<std::string> Table::lines() const {
  std::vector<std::size_t> widths(rows_.front().size(), 7);  // a minimum, so that columns keep their places
  for (const auto& row : rows_) {
    for (std::size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], characters(row[i]));
  }
  std::vector<std::string> out;
  for (const auto& row : rows_) {
    std::string line;
    for (std::size_t i = 0; i < row.size(); ++i) {
      const std::string space(widths[i] - characters(row[i]), ' ');
      line += i == 0 ? row[i] + space : "  " + space + row[i];
    }
    out.push_back(std::move(line));
  }
  return out;
}
