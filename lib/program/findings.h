// What forceserver check finds, and the words for it.
#pragma once

#include <map>
#include <string>
#include <vector>

class Findings {
 public:
  // Something odd. What is found of many objects is told in full of the first three.
  void add(const std::string& name, const char* format, ...) __attribute__((format(printf, 3, 4)));
  int finish() const;  // prints how many there are; returns the program's exit status

 private:
  int count_ = 0;
  std::map<std::string, std::vector<std::string>> names_;  // of the objects of which each sentence (its format) is true
};

std::string metres(double value);  // a length in a unit that suits its size
