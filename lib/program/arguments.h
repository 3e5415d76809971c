// What is wrong with a command line, in sentences of our own.
#pragma once

#include <string>

#include <CLI/CLI.hpp>

// The first word is a command; otherwise throws with the commands that there are.
void require_command(const CLI::App& app, int argc, char** argv);

// After app.parse() has failed with `error`. An option or word that nobody knows comes first: what follows it was
// misread with it.
std::string explain(const CLI::App& app, const CLI::ParseError& error);
