#include "stability.h"
int main() {
  stability::Report report;
  stability::run_facts(report);
  return report.end() ? 0 : 1;
}
