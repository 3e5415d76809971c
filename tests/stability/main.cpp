#include "stability.h"
int main(int, char**) {
  stability::Report report;
  stability::run_ways(report, "/tmp/stcsv");
  stability::run_failures(report, "");
  return report.end() ? 0 : 1;
}
