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
void run_sweep(Report& report, size_t count, uint64_t seed);
void write_maps(const std::string& folder);  // what no check needs: the map of stability, and the sensitivity

}  // namespace stability
