// The parts of the suite. Each prints its checks; `folder`, if not empty, gets the figures as CSV files.
#pragma once

#include <cstdint>
#include <string>

#include "report.h"

namespace stability {

void run_facts(Report& report);
void run_ways(Report& report, const std::string& folder);
void run_failures(Report& report, const std::string& folder);

}  // namespace stability
