// What forceserver check finds, and the words for it.
#pragma once

#include <string>

class Findings {
 public:
  void add(const std::string& name, const char* format, ...) __attribute__((format(printf, 3, 4)));  // something odd
  int finish() const;  // prints how many there are; returns the program's exit code

 private:
  int count_ = 0;
};

std::string metres(double value);  // a length in a unit that suits its size
