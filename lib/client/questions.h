// Tells whether an answer of the server about an own object is out of date: a change that the client made after it asked is
// newer than the answer. Questions are numbered. While one is open, each name that the client changes is noted with the newest
// question, and answers to that question or earlier ones are out of date for this name.
#pragma once

#include <cstdint>
#include <string>

#include "base/name_map.h"
#include "transfer/batch.h"

namespace fs {

class Questions {
 public:
  // Stand for the frame and the tool: no object can have these names.
  static constexpr const char* frame = "/frame";
  static constexpr const char* tool = "/tool";

  uint64_t newest() const noexcept { return newest_; }
  uint64_t open() noexcept {
    ++open_;
    return ++newest_;
  }
  void close() noexcept {
    if (--open_ == 0) changed_.clear();
  }
  // A question that is open as long as this lives.
  class OpenQuestion {
   public:
    explicit OpenQuestion(Questions& questions) : questions_(questions), number(questions.open()) {}
    ~OpenQuestion() { questions_.close(); }
    OpenQuestion(const OpenQuestion&) = delete;
    OpenQuestion& operator=(const OpenQuestion&) = delete;

   private:
    Questions& questions_;

   public:
    const uint64_t number;
  };

  // Notes that the client has made this change.
  void note(const Change& change) {
    if (open_ == 0) return;
    if (change.type == wire::type_clear) all_changed_ = newest_;
    const bool is_frame = change.type == wire::type_frame,
               is_tool = change.type == wire::type_tool || change.type == wire::type_tool_radius;
    changed_[is_frame ? frame : is_tool ? tool : std::string(change.name())] = newest_;
  }
  // Whether it was changed after the question was asked.
  bool is_changed(std::string_view name, uint64_t question) const {
    const auto found = changed_.find(name);
    return found != changed_.end() && found->second >= question;
  }
  bool is_object_changed(std::string_view name, uint64_t question) const {
    return all_changed_ >= question || is_changed(name, question);
  }

 private:
  uint64_t newest_ = 0;
  unsigned open_ = 0;
  NameMap<uint64_t> changed_;  // since the oldest open question; with the newest question at that time
  uint64_t all_changed_ = 0;   // the newest question at the last clear
};

}  // namespace fs
