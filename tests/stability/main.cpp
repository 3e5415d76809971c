// The suite, as a command. See README.md.
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <set>
#include <string>

#include "stability.h"

using namespace stability;

namespace {

int usage() {
  std::fprintf(stderr,
               "usage: stability [PART...] [--all] [--count N] [--seed N] [--csv FOLDER]\n"
               "  PART: facts, limits, ways, failures, random, sweep, links; all if none is given; caps (a table), maps (CSV only), explain\n"
               "  --all: 500 random scenes and a longer sweep, instead of some\n"
               "  --count N, --seed N: so many random scenes, steps of the sweep or links, from this number on\n"
               "  explain --seed N [--hand light|..|link]: what number N of the sweep, of random with this hand, or of links\n"
               "    consists of, and which objects make it oscillate\n"
               "  --csv FOLDER: writes the figures of ways, failures and maps there\n");
  return 2;
}

}  // namespace

int main(int argc, char** argv) {
  std::set<std::string> parts;
  bool is_all = false;
  size_t count = 0;
  uint64_t seed = 1;
  std::string folder, hand;
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    const bool has_value = i + 1 < argc;
    if (argument == "--all") is_all = true;
    else if (argument == "--count" && has_value) count = std::strtoull(argv[++i], nullptr, 10);
    else if (argument == "--seed" && has_value) seed = std::strtoull(argv[++i], nullptr, 10);
    else if (argument == "--hand" && has_value) hand = argv[++i];
    else if (argument == "--csv" && has_value) folder = argv[++i];
    else if (std::set<std::string>{"facts", "limits", "ways", "failures", "random", "sweep", "links", "caps", "explain", "maps"}.count(argument)) parts.insert(argument);
    else return usage();
  }
  const auto runs = [&](const char* part) { return parts.empty() || parts.count(part); };
  Report report;
  if (runs("facts")) run_facts(report);
  if (runs("limits")) run_limits(report);
  if (runs("ways")) run_ways(report, folder);
  if (runs("failures")) run_failures(report, folder);
  if (runs("random")) run_random(report, count ? count : is_all ? 500 : 20, seed);
  if (runs("random")) run_known(report);
  if (runs("sweep")) run_sweep(report, count ? count : is_all ? 600 : 16, seed);
  if (runs("links")) run_links(report, count ? count : is_all ? 600 : 16, seed);
  if (parts.count("caps")) print_caps(report);
  if (parts.count("explain")) explain(report, seed, hand);
  if (parts.count("maps") && !folder.empty()) write_maps(folder);
  return report.end() ? 0 : 1;
}
