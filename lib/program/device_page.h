// The page that test-device prints: figures under headings, and verdicts, which are counted and repeated at the end.
#pragma once

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
  void title(const std::string& text);
  void heading(const std::string& text);
  void figure(const char* label, const std::string& text);
  // Judges: passed if it holds; otherwise odd or failed.
  void expect(bool holds, Verdict otherwise, const std::string& sentence);
  void note(Verdict verdict, const std::string& sentence);
  void finish() const;
  bool has(Verdict verdict) const;

 private:
  struct Noted {
    Verdict verdict;
    std::string sentence;
  };
  std::vector<Noted> noted_;
};
