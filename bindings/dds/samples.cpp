#include "samples.h"

#include <algorithm>
#include <cstdio>

#include "hash.h"

namespace bridge {
namespace {

constexpr size_t longest_name = 63;

// Another site may write any number. One that is no value is refused where the object is set.
template <class Enum>
Enum to_enum(int32_t number) {
  return static_cast<Enum>(number & 0x7fffffff);
}

forceserver_Profile to_sample(const fs_profile& profile) {
  forceserver_Profile out{};
  out.kind = profile.kind;
  out.sense = profile.sense;
  out.gain = profile.gain;
  out.shift = profile.offset;
  out.width = profile.width;
  out.limit = profile.limit;
  out.reach = profile.reach;
  return out;
}

fs_profile to_c(const forceserver_Profile& profile) {
  fs_profile out{};
  out.kind = to_enum<fs_profile_kind>(profile.kind);
  out.sense = to_enum<fs_sense>(profile.sense);
  out.gain = profile.gain;
  out.offset = profile.shift;
  out.width = profile.width;
  out.limit = profile.limit;
  out.reach = profile.reach;
  return out;
}

}  // namespace

bool is_site_name(std::string_view name) {
  const auto is_allowed = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '_' || c == '.' || c == '-';
  };
  return !name.empty() && name.size() <= 20 && std::all_of(name.begin(), name.end(), is_allowed);
}

std::string name_at_site(const std::string& client, const std::string& site) {
  const std::string whole = client + "@" + site;
  if (whole.size() <= longest_name) return whole;
  char hash[6];
  std::snprintf(hash, sizeof hash, "~%04x", static_cast<unsigned>(hash_of(client.data(), client.size()) & 0xffff));
  size_t kept = longest_name - site.size() - 1 - 5;
  while (kept > 0 && (static_cast<unsigned char>(client[kept]) & 0xc0) == 0x80) --kept;  // no character of UTF-8 is cut
  return client.substr(0, kept) + hash + "@" + site;
}

bool split_name(std::string_view name, std::string& client, std::string& object) {
  const size_t slash = name.find('/');
  if (slash == std::string_view::npos) return false;
  client = name.substr(0, slash);
  object = name.substr(slash + 1);
  return true;
}

forceserver_Vec3 to_sample(const fs_vec3& v) { return {v.x, v.y, v.z}; }
forceserver_Pose to_sample(const fs_pose& pose) {
  const fs_quat& q = pose.orientation;
  return {to_sample(pose.position), {q.w, q.x, q.y, q.z}};
}
forceserver_Twist to_sample(const fs_twist& twist) { return {to_sample(twist.linear), to_sample(twist.angular)}; }
fs_vec3 to_c(const forceserver_Vec3& v) { return {v.x, v.y, v.z}; }
fs_pose to_c(const forceserver_Pose& pose) {
  const forceserver_Quat& q = pose.orientation;
  return {to_c(pose.position), {q.w, q.x, q.y, q.z}};
}
fs_twist to_c(const forceserver_Twist& twist) { return {to_c(twist.linear), to_c(twist.angular)}; }

void put_object(forceserver_ForceObject& out, const fs_object& object) {
  out.primitive = object.primitive;
  out.place = to_sample(object.pose);
  out.motion = to_sample(object.twist);
  out.time = object.time;
  out.start = object.start;
  out.front = to_sample(object.front);
  out.back = to_sample(object.back);
  out.damping = object.damping;
  out.solid = {object.contact.keep, object.contact.stiffness, object.contact.limit, object.contact.damping,
               object.contact.friction};
  out.tool_points = object.tool_points;
  out.enabled = object.enabled;
}

fs_object to_c(const forceserver_ForceObject& sample, const std::string& name) {
  fs_object out = fs_object_init(name.c_str(), to_enum<fs_primitive>(sample.primitive));
  out.pose = to_c(sample.place);
  if (sample.horizon > 0) out.twist = to_c(sample.motion);
  out.time = sample.time;
  out.start = sample.start;
  out.front = to_c(sample.front);
  out.back = to_c(sample.back);
  out.damping = sample.damping;
  out.contact.keep = to_enum<fs_keep>(sample.solid.keep);
  out.contact.stiffness = sample.solid.stiffness;
  out.contact.limit = sample.solid.limit;
  out.contact.damping = sample.solid.damping;
  out.contact.friction = sample.solid.friction;
  out.tool_points = sample.tool_points;
  out.enabled = sample.enabled;
  return out;
}

forceserver_Moved to_moved(const forceserver_ForceObject& object) {
  forceserver_Moved out{};
  put_text(out.client, object.client);
  put_text(out.name, object.name);
  out.revision = object.revision;
  out.place = object.place;
  out.time = object.time;
  out.horizon = static_cast<float>(object.horizon);
  const forceserver_Vec3 &v = object.motion.linear, &w = object.motion.angular;
  const double twist[] = {v.x, v.y, v.z, w.x, w.y, w.z};
  std::copy(std::begin(twist), std::end(twist), out.twist);
  return out;
}

void put_moved(forceserver_ForceObject& out, const forceserver_Moved& moved) {
  const float* const t = moved.twist;
  out.place = moved.place;
  out.motion = {{t[0], t[1], t[2]}, {t[3], t[4], t[5]}};
  out.time = moved.time;
  out.horizon = moved.horizon;
}

void put_view(forceserver_ClientView& out, const fs_view& view) {
  out.frame = to_sample(view.frame.pose);
  out.scale = view.frame.scale;
  out.force_scale = view.frame.force_scale;
  out.clutch_held = view.held;
  out.tool_radius = view.point_radius;
}

fs_frame frame_of(const forceserver_ClientView& view) {
  fs_frame out = fs_frame_init();
  out.pose = to_c(view.frame);
  out.scale = view.scale;
  out.force_scale = view.force_scale;
  return out;
}

uint64_t digest_of(const std::string& client, const std::string& name, uint64_t revision) {
  const std::string whole = client + "/" + name;
  return hash_of(whole.data(), whole.size()) * (2 * revision + 1);
}

}  // namespace bridge
