#include "stability.h"
int main(int, char**) {
  stability::Report report;
  stability::run_ways(report, "");
  stability::run_failures(report, "");
  return report.end() ? 0 : 1;
}
