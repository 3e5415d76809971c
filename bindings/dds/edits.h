// Edits of another site's objects, and their answers.
#pragma once

#include <deque>
#include <map>
#include <string>

#include "incoming.h"
#include "outgoing.h"

namespace bridge {

class Edits {
 public:
  Edits(const Room& room, Incoming& incoming, ContentReader& contents, ContentWriter& writer, std::string site, uint64_t session)
      : room_(room), incoming_(incoming), contents_(contents), writer_(writer), site_(std::move(site)), number_(session) {}

  // Asks the owners of other sites' objects that somebody edited at this server.
  void ask(double now);
  // Does what other sites ask for. scene: this bridge's own at the server.
  void take(const forceserver::Scene& scene, double now);
  void take_answer(const forceserver_Answer& answer, double now);

 private:
  struct Asked {
    std::string site, client, object;
    std::vector<std::string> contents;  // that are kept for it
    double until = 0;                   // s: then there is no answer any more
  };
  struct Waiting {  // an edit by another site whose contents have not come
    forceserver_Edit sample;
    double since;
  };
  void ask(const Incoming::LocalEdit& edit, double now);
  bool try_edit(const forceserver::Scene& scene, const forceserver_Edit& edit, double now);  // false: contents are missing
  void answer(const forceserver_Edit& edit, fs_status status, const std::string& text);
  void hold(const Asked& asked, double until);
  void undo(const Asked& asked, const std::string& why, double now);

  const Room& room_;
  Incoming& incoming_;
  ContentReader& contents_;
  ContentWriter& writer_;
  const std::string site_;
  std::map<uint64_t, Asked> asked_;
  std::deque<forceserver_Edit> to_ask_;
  std::deque<forceserver_Answer> to_answer_;
  std::deque<Waiting> waiting_;
  uint64_t number_;  // of the newest edit; those of an earlier session had smaller ones
};

}  // namespace bridge
