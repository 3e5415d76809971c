// A person who answers by keys: a letter or a number, and Enter.
#pragma once

#include <functional>
#include <optional>
#include <string>

// There are no more answers: Ctrl-D.
struct GivenUp {};

// The person skips this step: s.
struct Skipped {};

class Person {
 public:
  static void tell(const std::string& text);

  // Waits for an answer that is_answer takes, and repeats the help after any other, unless the output is held up. Again and again it
  // calls meanwhile, which waits a moment; when that returns false there is no answer.
  std::optional<std::string> ask(const std::string& question, const std::string& help,
                                 const std::function<bool(const std::string&)>& is_answer,
                                 const std::function<bool()>& meanwhile);

  // The same for one of these letters.
  std::optional<char> ask_letter(const std::string& question, const std::string& help, const std::string& letters,
                                 const std::function<bool()>& meanwhile);

 private:
  std::optional<std::string> next_line();
  void read_more();

  std::string typed_;  // not yet a line
  bool is_over_ = false;
};
