#include "arguments.h"

#include <algorithm>
#include <stdexcept>
#include <string_view>
#include <vector>

#include "words.h"

namespace {

// The edit distance of two words: how many letters have to be inserted, removed, replaced, or swapped with the next.
std::size_t edits(std::string_view a, std::string_view b) {
  std::vector<std::vector<std::size_t>> cost(a.size() + 1, std::vector<std::size_t>(b.size() + 1));
  for (std::size_t i = 0; i <= a.size(); ++i) {
    for (std::size_t k = 0; k <= b.size(); ++k) {
      if (i == 0 || k == 0) {
        cost[i][k] = i + k;
        continue;
      }
      cost[i][k] = std::min({cost[i - 1][k] + 1, cost[i][k - 1] + 1, cost[i - 1][k - 1] + (a[i - 1] != b[k - 1])});
      const bool swapped = i > 1 && k > 1 && a[i - 1] == b[k - 2] && a[i - 2] == b[k - 1];
      if (swapped) cost[i][k] = std::min(cost[i][k], cost[i - 2][k - 2] + 1);
    }
  }
  return cost[a.size()][b.size()];
}

// The word that was probably meant, or an empty string when no word is similar enough.
std::string nearest(std::string_view word, const std::vector<std::string>& words) {
  std::string best;
  std::size_t least = (std::min<std::size_t>(word.size(), 100) + 2) / 3 + 1;
  for (const std::string& candidate : words) {
    const std::size_t distance = edits(word.substr(0, 100), candidate);
    if (distance >= least) continue;
    least = distance;
    best = candidate;
  }
  return best;
}

std::string unknown_option(const CLI::App& command, const std::string& option) {
  std::vector<std::string> names;
  for (const CLI::Option* known : command.get_options()) {
    for (const std::string& name : known->get_lnames()) names.push_back(name);
  }
  const bool is_program = command.get_parent() == nullptr;
  const std::string meant = nearest(std::string_view(option).substr(option.find_first_not_of('-')), names);
  return (is_program ? "there is" : command.get_name() + " has") + " no option " + option +
         (meant.empty() ? "; see: forceserver " + (is_program ? "" : command.get_name() + " ") + "--help"
                        : "; did you mean --" + meant + "?");
}

std::string extra_word(const CLI::App& command, const std::string& word) {
  std::string last;
  for (const CLI::Option* option : command.get_options()) {
    if (option->get_positional() && option->count() > 0) last = option->results().back();
  }
  return command.get_name() + " takes no '" + word + "'" + (last.empty() ? "" : " after '" + last + "'");
}

// From CLI11's "--duration: 1 required SECONDS missing": "--duration needs a number of seconds".
std::string missing_value(const std::string& sentence) {
  const std::string before = ": 1 required ", after = " missing";
  const std::size_t at = sentence.find(before), end = sentence.rfind(after);
  if (at == sentence.npos || end == sentence.npos || end < at + before.size()) return sentence;
  const std::string type = sentence.substr(at + before.size(), end - at - before.size());
  const std::pair<const char*, const char*> words[] = {{"SECONDS", "a number of seconds"},
                                                       {"HZ", "a number of hertz"},
                                                       {"M", "a number of metres"},
                                                       {"N", "a number"},
                                                       {"FILE", "a file"},
                                                       {"URI", "the URI of a device"},
                                                       {"NAME", "a name"}};
  for (const auto& [word, meaning] : words) {
    if (type == word) return sentence.substr(0, at) + " needs " + meaning;
  }
  return sentence.substr(0, at) + " needs " + type;
}

}  // namespace

void refuse_options_as_values(CLI::App& app) {
  for (CLI::App* command : app.get_subcommands(nullptr)) {
    std::vector<std::string> names;
    for (const CLI::Option* option : command->get_options()) {
      for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
    }
    const auto check = [names](const std::string& value) {
      const bool is_option = std::find(names.begin(), names.end(), value) != names.end();
      return is_option ? "its value is missing: " + value + " is an option" : std::string();
    };
    for (CLI::Option* option : command->get_options()) {
      if (option->get_items_expected_max() > 0 && !option->get_positional()) option->check(check);
    }
  }
}

void require_command(const CLI::App& app, int argc, char** argv) {
  if (argc >= 2 && argv[1][0] == '-') return;
  std::vector<std::string> names;
  for (const CLI::App* command : app.get_subcommands(nullptr)) {
    if (argc >= 2 && command->check_name(argv[1])) return;
    names.push_back(command->get_name());
  }
  if (argc < 2) throw std::runtime_error("a command is missing; there are: " + join(names, "none") + "; see: forceserver --help");
  const std::string meant = nearest(argv[1], names), all = "here are: " + join(names, "none");
  throw std::runtime_error("there is no command '" + std::string(argv[1]) + "'; " +
                           (meant.empty() ? "t" + all : "did you mean " + meant + "? T" + all));
}

std::string explain(const CLI::App& app, const CLI::ParseError& error) {
  const std::vector<const CLI::App*> commands = [&] {
    std::vector<const CLI::App*> all{&app};
    for (const CLI::App* command : app.get_subcommands()) all.push_back(command);
    return all;
  }();
  for (const CLI::App* command : commands) {
    for (const std::string& word : command->remaining()) {
      const bool is_option = word.size() > 1 && word[0] == '-' && word.find_first_not_of('-') != word.npos;
      if (is_option) return unknown_option(*command, word.substr(0, word.find('=')));
    }
  }
  for (const CLI::App* command : commands) {
    const std::vector<std::string> words = command->remaining();
    if (!words.empty()) return extra_word(*command, words.front());
  }
  if (error.get_name() == "ArgumentMismatch") return missing_value(error.what());
  return error.what();
}
