// The page of forceserver doctor: sections with figures, then what is wrong and what cures it; for people or as JSON.
#pragma once

#include <exception>

#include "json.h"
#include "words.h"

class DoctorPage {
 public:
  explicit DoctorPage(bool as_json);

  // A section is filled by `fill`. If it fails, the page says why, and goes on with the next.
  void section(const char* heading, auto&& fill) {
    begin(heading);
    try {
      fill();
    } catch (const std::exception& error) {
      figure("not known", error.what());
    }
  }

  void figure(const std::string& label, const std::string& text);                    // JSON: the text
  void figure(const std::string& label, const Known& told) { figure(label, told.text); }
  void figure(const std::string& label, const std::string& text, const Json& value);  // JSON: the value

  // Something is wrong, or could be better. cure: the command that cures it, or what to do.
  void wrong(const std::string& sentence, const std::string& cure);
  void better(const std::string& sentence, const std::string& cure);

  int finish();  // prints the rest; returns the program's exit status

 private:
  struct Finding {
    bool is_wrong;
    std::string sentence, cure;
  };

  void begin(const char* heading);
  void add(const Finding& finding);

  bool as_json_;
  Json json_;
  std::string heading_;
  std::vector<Finding> findings_;
};
