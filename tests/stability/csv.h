// A table of numbers for the pictures: the first row has the names. Nothing is written where there is no folder.
#pragma once

#include <cstdio>
#include <string>
#include <vector>

namespace stability {

class Csv {
 public:
  Csv(const std::string& folder, const std::string& name, const std::string& header) {
    if (folder.empty()) return;
    file_ = std::fopen((folder + "/" + name + ".csv").c_str(), "w");
    if (!file_) std::perror((folder + "/" + name + ".csv").c_str());
    else std::fprintf(file_, "%s\n", header.c_str());
  }
  ~Csv() {
    if (file_) std::fclose(file_);
  }
  Csv(const Csv&) = delete;
  Csv& operator=(const Csv&) = delete;

  explicit operator bool() const { return file_; }
  void row(const std::vector<double>& values) { row("", values); }
  void row(const std::string& first, const std::vector<double>& values) {
    if (!file_) return;
    const char* comma = "";
    if (!first.empty()) std::fprintf(file_, "%s", first.c_str()), comma = ",";
    for (const double value : values) std::fprintf(file_, "%s%.6g", comma, value), comma = ",";
    std::fprintf(file_, "\n");
  }

 private:
  std::FILE* file_ = nullptr;
};

}  // namespace stability
