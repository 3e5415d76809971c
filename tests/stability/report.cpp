#include "report.h"

#include "pending.h"

namespace stability {

std::string format(const char* pattern, ...) {
  char text[1024];
  va_list arguments;
  va_start(arguments, pattern);
  std::vsnprintf(text, sizeof text, pattern, arguments);
  va_end(arguments);
  return text;
}

void Report::title(const std::string& text) {
  std::printf("\n%s\n", text.c_str());
  std::fflush(stdout);
}

void Report::note(const std::string& text) { std::printf("         %s\n", text.c_str()); }

void Report::check(const std::string& id, bool is_right, const std::string& text) {
  const char* waits_for = nullptr;
  for (const Pending& pending : pending_checks) {
    if (id == pending.check) waits_for = pending.waits_for;
  }
  if (!waits_for) {
    ++(is_right ? passed_ : failed_);
    std::printf("%s  %s: %s\n", is_right ? "ok     " : "FAILED ", id.c_str(), text.c_str());
  } else if (is_right) {
    ++failed_;
    std::printf("FAILED   %s: %s; it passes, so delete its line in tests/stability/pending.h\n", id.c_str(), text.c_str());
  } else {
    ++pending_;
    std::printf("pending  %s: %s; waits for: %s\n", id.c_str(), text.c_str(), waits_for);
  }
  std::fflush(stdout);
}

bool Report::end() const {
  std::printf("\n%d passed, %d failed, %d pending (not passed: the protection is not there yet)\n", passed_, failed_,
              pending_);
  return failed_ == 0;
}

}  // namespace stability
