// What a shell offers when Tab is pressed after `forceserver ...`.
#pragma once

#include <string>
#include <vector>

#include <CLI/CLI.hpp>

// Prints what can stand in place of the last of these words, which may be begun or empty; they follow the program's name. Each line
// has a word, and where it has one a description after a tabulator; ":files" stands for the names of files.
int complete(const CLI::App& app, const std::vector<std::string>& words);
