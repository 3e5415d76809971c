// Topics of ROS 2: the hand of this site, and poses that objects follow.
#pragma once

#include <map>
#include <memory>
#include <string>

#include "room.h"
#include "samples.h"

namespace bridge {

class RosTopics {
 public:
  // follow: "client/object" to a topic of PoseStamped.
  RosTopics(const Participant& participant, const std::string& site, bool writes,
            const std::map<std::string, std::string>& follow);
  ~RosTopics();
  void write(const forceserver_Hand& hand);
  void follow(const forceserver::Scene& scene);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace bridge
