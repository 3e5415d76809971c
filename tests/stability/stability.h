// The parts of the suite. Each prints its checks; `folder`, if not empty, gets the figures as CSV files.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "report.h"

namespace stability {

void run_facts(Report& report);
void run_limits(Report& report);
void run_ways(Report& report, const std::string& folder);
void run_failures(Report& report, const std::string& folder);
void run_random(Report& report, size_t count, uint64_t seed);
void run_known(Report& report);
void run_links(Report& report, size_t count, uint64_t seed);
void run_sweep(Report& report, size_t count, uint64_t seed);
void print_caps(Report& report);  // what the bound of the slope takes away from each kind of profile
// Prints what a random scene has, which of its objects are needed for it to oscillate, and what each of these does then.
// hand: of a simple scene; "link": a scene behind a link; empty: one of the sweep.
void explain(Report& report, uint64_t seed, const std::string& hand);
void write_maps(const std::string& folder);  // what no check needs: the map of stability, and the sensitivity

}  // namespace stability
