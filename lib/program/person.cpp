#include "person.h"

#include <poll.h>
#include <termios.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>

namespace {

// Whether a line can be written without waiting, as there may be a force: a pipe that nobody reads is full, and Ctrl-S holds up a terminal.
bool is_output_free() {
  pollfd output = {STDOUT_FILENO, POLLOUT, 0};
  return poll(&output, 1, 0) > 0;
}

}  // namespace

void Person::tell(const std::string& text) {
  std::printf("%s\n", text.c_str());
  std::fflush(stdout);
}

std::optional<std::string> Person::ask(const std::string& question, const std::string& help,
                                       const std::function<bool(const std::string&)>& is_answer,
                                       const std::function<bool()>& meanwhile) {
  if (isatty(STDIN_FILENO)) tcflush(STDIN_FILENO, TCIFLUSH);  // what was typed before is no answer to this question
  tell(question + "\n  " + help + "; s skips this step");
  while (meanwhile()) {
    const std::optional<std::string> line = next_line();
    if (!line) continue;
    if (*line == "s") throw Skipped();
    if (is_answer(*line)) return line;
    if (is_output_free()) tell("That is no answer. " + help + "; s skips this step");
  }
  return std::nullopt;
}

std::optional<char> Person::ask_letter(const std::string& question, const std::string& help, const std::string& letters,
                                       const std::function<bool()>& meanwhile) {
  const auto is_letter = [&](const std::string& line) { return line.size() == 1 && letters.find(line[0]) != letters.npos; };
  const std::optional<std::string> line = ask(question, help, is_letter, meanwhile);
  if (!line) return std::nullopt;
  return line->front();
}

// The next line without its spaces, in small letters, if there is a whole one.
std::optional<std::string> Person::next_line() {
  read_more();
  const std::size_t end = typed_.find('\n');
  if (end == typed_.npos) {
    if (is_over_) throw GivenUp();
    return std::nullopt;
  }
  std::string line;
  for (const char c : typed_.substr(0, end)) {
    const bool is_capital = c >= 'A' && c <= 'Z';
    if (c > ' ') line += is_capital ? static_cast<char>(c - 'A' + 'a') : c;
  }
  typed_.erase(0, end + 1);
  return line;
}

void Person::read_more() {
  constexpr std::size_t most = 4096;  // a longer line is dropped
  pollfd input = {STDIN_FILENO, POLLIN, 0};
  if (is_over_ || typed_.find('\n') != typed_.npos || poll(&input, 1, 0) <= 0) return;
  char bytes[256];
  const ssize_t count = read(STDIN_FILENO, bytes, sizeof bytes);
  if (count < 0 && (errno == EINTR || errno == EAGAIN)) return;
  if (count <= 0) is_over_ = true;
  else typed_.append(bytes, static_cast<std::size_t>(count));
  if (typed_.size() > most) typed_.clear();
}
