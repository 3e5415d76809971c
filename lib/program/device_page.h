// The page that test-device and hello-device print: figures under headings, and verdicts, which are counted and repeated at
// the end.
#pragma once

#include <cstdio>
#include <memory>
#include <string>
#include <vector>

enum class Verdict { passed, odd, failed };

// A list of durations in order.
class Durations {
 public:
  void add(double seconds) { all_.push_back(seconds); }
  std::size_t count() const { return all_.size(); }
  double quantile(double part) const;  // s; 0 of an empty list
  double longest() const { return quantile(1); }
  std::string text() const;  // "p50 1.000, p99 1.100, max 2.000 ms"

 private:
  std::vector<double> all_;
};

class DevicePage {
 public:
  void write_report(const std::string& path);  // also writes what follows to a new file
  void title(const std::string& text);
  void heading(const std::string& text);
  void figure(const char* label, const std::string& text);
  // Judges: passed if it holds; otherwise odd or failed.
  void expect(bool holds, Verdict otherwise, const std::string& sentence);
  void note(Verdict verdict, const std::string& sentence);
  void text(const std::string& paragraph);
  void leave_out(const char* label, const std::string& why);  // of a step that is not done
  void finish();
  bool has(Verdict verdict) const;

 private:
  struct Noted {
    Verdict verdict;
    std::string sentence;
  };
  struct Close {
    void operator()(FILE* file) const { std::fclose(file); }
  };
  void print(const std::string& text);

  std::vector<Noted> noted_;
  int left_out_ = 0;  // steps
  std::unique_ptr<FILE, Close> report_;
  std::string path_;  // of the report
};
