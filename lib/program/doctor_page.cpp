#include "doctor_page.h"

#include <algorithm>
#include <cstdio>

#include "words.h"

namespace {

// As a key of JSON: "Real time" is real_time.
std::string key_of(std::string words) {
  for (char& c : words) c = c == ' ' ? '_' : char(std::tolower(static_cast<unsigned char>(c)));
  return words;
}

// The lines of a text, all but the first indented. Names of others' servers and devices could hold commands for a terminal.
std::string indented(const std::string& text, std::size_t columns) {
  std::string out;
  for (const char c : text) {
    const bool is_control = (static_cast<unsigned char>(c) < 0x20 && c != '\n') || c == 0x7f;
    out += is_control ? '?' : c;
    if (c == '\n') out.append(columns, ' ');
  }
  return out;
}

}  // namespace

DoctorPage::DoctorPage(bool as_json) : as_json_(as_json) {
  if (!as_json_) std::puts("# forceserver doctor");
}

void DoctorPage::begin(const char* heading) {
  heading_ = key_of(heading);
  json_[heading_] = Json::object();
  if (!as_json_) std::printf("\n## %s\n\n", heading);
}

void DoctorPage::figure(const std::string& label, const std::string& text) { figure(label, text, text); }

void DoctorPage::figure(const std::string& label, const std::string& text, const Json& value) {
  json_[heading_][key_of(label)] = value;
  if (as_json_) return;
  std::printf("    %-16s  %s\n", label.c_str(), indented(text, 22).c_str());
  std::fflush(stdout);
}

void DoctorPage::add(const Finding& finding) {
  const bool is_told =
      std::any_of(findings_.begin(), findings_.end(), [&](const Finding& told) { return told.sentence == finding.sentence; });
  if (!is_told) findings_.push_back(finding);
}

void DoctorPage::wrong(const std::string& sentence, const std::string& cure) { add({true, sentence, cure}); }

void DoctorPage::better(const std::string& sentence, const std::string& cure) { add({false, sentence, cure}); }

int DoctorPage::finish() {
  std::stable_sort(findings_.begin(), findings_.end(),
                   [](const Finding& a, const Finding& b) { return a.is_wrong > b.is_wrong; });
  Json wrong = Json::array(), better = Json::array();
  if (!as_json_ && !findings_.empty()) std::printf("\n## What is wrong, and what could be better\n");
  for (const Finding& finding : findings_) {
    (finding.is_wrong ? wrong : better).push_back({{"sentence", finding.sentence}, {"cure", finding.cure}});
    if (as_json_) continue;
    std::printf("\n%s  %s\n  cure  %s\n", finding.is_wrong ? "WRONG " : "better", indented(finding.sentence, 8).c_str(),
                indented(finding.cure, 8).c_str());
  }
  const std::size_t count = wrong.size(), others = better.size();
  const std::string verdict = (count == 0   ? std::string("nothing is wrong")
                               : count == 1 ? std::string("1 thing is wrong")
                                            : format("%zu things are wrong", count)) +
                              (others == 0 ? "" : format("; %zu could be better", others));
  json_["wrong"] = wrong;
  json_["better"] = better;
  json_["verdict"] = verdict;
  if (as_json_) std::puts(dump(json_, 2).c_str());
  else std::printf("\nverdict: %s\n", verdict.c_str());
  write_out();
  return count == 0 ? exit_fine : exit_odd;
}
