#include "complete.h"

#include <cstdio>
#include <cstring>

#include "device_words.h"
#include "local_servers.h"
#include "program.h"
#include "words.h"

namespace {

constexpr const char* files_word = ":files";

bool takes_value(const CLI::Option& option) { return option.get_items_expected_max() > 0; }

// The option of this name, such as "--device"; null: none.
const CLI::Option* find_option(const CLI::App& command, const std::string& name) {
  for (const CLI::Option* option : command.get_options()) {
    if (option->nonpositional() && option->check_name(name)) return option;
  }
  return nullptr;
}

class Offers {
 public:
  explicit Offers(std::string begun) : begun_(std::move(begun)) {}

  void add(const std::string& word, const std::string& description = "") const {
    if (word.starts_with(begun_)) std::printf("%s%s%s\n", word.c_str(), description.empty() ? "" : "\t", description.c_str());
  }
  void add_files() const { std::puts(files_word); }
  void add_options(const CLI::App& command) const {
    for (const CLI::Option* option : command.get_options()) {
      for (const std::string& name : option->get_lnames()) add("--" + name, option->get_description());
    }
  }
  void add_servers() const {
    for (const LocalServer& server : local_servers()) add(server.name);
  }
  void add_devices() const {
    for (const fs_driver_info& driver : drivers()) {
      if (!*driver.trouble) add(std::string(driver.scheme) + ":");
    }
  }

 private:
  std::string begun_;
};

void add_value(const Offers& offers, const CLI::Option& option) {
  const std::string type = option.get_type_name();
  if (type == "FILE") offers.add_files();
  if (type == "URI") offers.add_devices();
}

void add_positional(const Offers& offers, const std::string& name) {
  if (name == "server") offers.add_servers();
  if (name == "device") offers.add_devices();
  if (name == "scene" || name == "file" || name == "positions") offers.add_files();
}

// words: after the name of the command, without the one that is to be completed.
void add_argument(const Offers& offers, const CLI::App& command, const std::vector<std::string>& words) {
  std::size_t positionals = 0;
  for (std::size_t i = 0; i < words.size(); ++i) {
    const CLI::Option* const option = find_option(command, words[i]);
    const bool has_value = option && takes_value(*option);
    if (has_value && i + 1 == words.size()) return add_value(offers, *option);
    if (!words[i].starts_with("-") || words[i] == "-") ++positionals;
    if (has_value) ++i;
  }
  for (const CLI::Option* option : command.get_options()) {
    if (option->get_positional() && positionals-- == 0) return add_positional(offers, option->get_single_name());
  }
}

}  // namespace

int complete(const CLI::App& app, const std::vector<std::string>& given) {
  std::vector<std::string> words;
  for (const std::string& word : given) {  // "--device=sim:" is "--device" and "sim:"
    const std::size_t at = word.starts_with("--") ? word.find('=') : word.npos;
    words.push_back(word.substr(0, at));
    if (at != word.npos) words.push_back(word.substr(at + 1));
  }
  const Offers offers(words.empty() ? "" : words.back());
  const bool is_option = !words.empty() && words.back().starts_with("-");
  if (words.size() < 2) {
    if (is_option) offers.add_options(app);
    for (const CLI::App* command : app.get_subcommands(nullptr)) offers.add(command->get_name(), command->get_description());
    return exit_fine;
  }
  for (const CLI::App* command : app.get_subcommands(nullptr)) {
    if (!command->check_name(words.front())) continue;
    if (is_option) offers.add_options(*command);
    else add_argument(offers, *command, {words.begin() + 1, words.end() - 1});
  }
  return exit_fine;
}
