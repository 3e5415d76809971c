// Explains what is wrong with a command line, in clearer sentences than CLI11's.
#pragma once

#include <string>

#include <CLI/CLI.hpp>

// Refuses an option as the value of another one, such as `run --listen --locked`. Called when all commands are there.
void refuse_options_as_values(CLI::App& app);

// Throws when the first word is neither an option nor a command, or there is none; the sentence lists the commands.
void require_command(const CLI::App& app, int argc, char** argv);

// The sentence to print after app.parse() has failed with `error`. An unknown option or word is reported first, since
// it makes the parser misread what follows.
std::string explain(const CLI::App& app, const CLI::ParseError& error);
