#include "ros.h"

#include <chrono>
#include <cmath>
#include <vector>

#include "ros_messages.h"
#include "say.h"

namespace bridge {
namespace {

using Pose = geometry_msgs_msg_dds__PoseStamped_;
using Twist = geometry_msgs_msg_dds__TwistStamped_;
using Wrench = geometry_msgs_msg_dds__WrenchStamped_;
using Joy = sensor_msgs_msg_dds__Joy_;

// ROS stamps with the time of the day.
builtin_interfaces_msg_dds__Time_ stamp() {
  const auto since = std::chrono::system_clock::now().time_since_epoch();
  const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(since);
  return {static_cast<int32_t>(seconds.count()), static_cast<uint32_t>(std::chrono::nanoseconds(since - seconds).count())};
}

geometry_msgs_msg_dds__Vector3_ to_ros(const forceserver_Vec3& v) { return {v.x, v.y, v.z}; }

// Nodes of ROS know types by their names: how their fields are described differs between the versions of ROS. Where no
// description is sent, none is compared.
dds_topic_descriptor_t by_name(const dds_topic_descriptor_t& type) {
  const uint32_t flags = type.m_flagset & ~static_cast<uint32_t>(DDS_TOPIC_XTYPES_METADATA);
  return {type.m_size,     type.m_align, flags,       type.m_nkeys,
          type.m_typename, type.m_keys,  type.m_nops, type.m_ops,
          type.m_meta,     {},           {},          type.restrict_data_representation};
}

// Topics of ROS are in the default partition.
Entity make_writer(const Participant& participant, const std::string& topic, const dds_topic_descriptor_t& type) {
  return participant.make_writer("rt" + topic, by_name(type), Service::ros, false);
}
// Who publishes may do so with any service: a BEST_EFFORT reader takes all.
Entity make_reader(const Participant& participant, const std::string& topic, const dds_topic_descriptor_t& type) {
  return participant.make_reader("rt" + topic, by_name(type), Service::stream, false);
}

}  // namespace

struct RosTopics::Impl {
  struct Followed {
    std::string object;  // "client/object"
    Entity reader;
    bool is_missing_told = false;
  };
  std::string frame;  // header.frame_id
  bool writes = false;
  Entity pose, twist, wrench, joy;
  std::vector<Followed> followed;
};

RosTopics::RosTopics(const Participant& participant, const std::string& site, bool writes,
                     const std::map<std::string, std::string>& follow)
    : impl_(std::make_unique<Impl>()) {
  impl_->frame = "forceserver/" + site;
  impl_->writes = writes;
  if (writes) {
    // A name of ROS has letters, digits and '_' only, and no digit at first.
    std::string name = site[0] >= '0' && site[0] <= '9' ? "site" + site : site;
    for (char& c : name) c = c == '.' || c == '-' ? '_' : c;
    const std::string prefix = "/forceserver/" + name + "/";
    impl_->pose = make_writer(participant, prefix + "pose", geometry_msgs_msg_dds__PoseStamped__desc);
    impl_->twist = make_writer(participant, prefix + "twist", geometry_msgs_msg_dds__TwistStamped__desc);
    impl_->wrench = make_writer(participant, prefix + "wrench", geometry_msgs_msg_dds__WrenchStamped__desc);
    impl_->joy = make_writer(participant, prefix + "buttons", sensor_msgs_msg_dds__Joy__desc);
  }
  for (const auto& [object, topic] : follow) {
    impl_->followed.push_back({object, make_reader(participant, topic, geometry_msgs_msg_dds__PoseStamped__desc)});
  }
}

RosTopics::~RosTopics() = default;

void RosTopics::write(const forceserver_Hand& hand) {
  if (!impl_->writes) return;
  const std_msgs_msg_dds__Header_ header = {stamp(), impl_->frame.data()};
  const auto& [position, q] = hand.place;
  const Pose pose = {header, {{position.x, position.y, position.z}, {q.x, q.y, q.z, q.w}}};
  const Twist twist = {header, {to_ros(hand.motion.linear), to_ros(hand.motion.angular)}};
  const Wrench wrench = {header, {to_ros(hand.force), to_ros(hand.torque)}};
  std::vector<int32_t> buttons(8);
  for (size_t i = 0; i < buttons.size(); ++i) buttons[i] = (hand.buttons >> i) & 1;
  Joy joy{};
  joy.header = header;
  lend(joy.buttons, buttons);
  dds_write(impl_->pose.get(), &pose);
  dds_write(impl_->twist.get(), &twist);
  dds_write(impl_->wrench.get(), &wrench);
  dds_write(impl_->joy.get(), &joy);
}

void RosTopics::follow(const forceserver::Scene& scene) {
  for (Impl::Followed& followed : impl_->followed) {
    void* sample = nullptr;
    dds_sample_info_t info;
    while (dds_take(followed.reader.get(), &sample, &info, 1, 1) > 0) {
      const Pose& message = *static_cast<const Pose*>(sample);
      const auto& [p, q] = message.pose;
      const fs_pose pose = {{p.x, p.y, p.z}, {q.w, q.x, q.y, q.z}};
      // The clocks of ROS and of the scene differ, so it counts from its arrival.
      const fs_status status =
          info.valid_data ? fs_object_move(scene.get(), followed.object.c_str(), &pose, nullptr, FS_NOW) : FS_OK;
      dds_return_loan(followed.reader.get(), &sample, 1);
      sample = nullptr;
      if (status == FS_ERROR_DISCONNECTED) throw forceserver::Error(status);
      if (status < 0 && !followed.is_missing_told) {
        complain("--follow " + followed.object + ": " + fs_last_error());
      }
      followed.is_missing_told = status < 0;
    }
  }
}

}  // namespace bridge
