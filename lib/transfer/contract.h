// Written by make_contract.py from the description of the public headers: how their structs are sent.
#pragma once

#include <cstring>

#include <forceserver/server.h>

#include "base/enum.h"

namespace fs::wire {

// The record of a struct has its fields without those that mean something in one process only. A handle is a number (wire.h);
// it is 0 in what to_record gives, and null in what from_record gives. Whole numbers have 64 bits, so no record has padding.
// An enum may come as any number: it is checked where it is used.

struct Profile {
  int64_t kind;
  int64_t sense;
  double gain;
  double offset;
  double width;
  double limit;
  double reach;
  uint64_t curve;
  double reserved[4];
};
static_assert(sizeof(Profile) == 96);

inline Profile to_record(const fs_profile& from) {
  Profile out{};
  out.kind = raw_value(from.kind);
  out.sense = raw_value(from.sense);
  out.gain = from.gain;
  out.offset = from.offset;
  out.width = from.width;
  out.limit = from.limit;
  out.reach = from.reach;
  std::memcpy(out.reserved, from.reserved, sizeof out.reserved);
  return out;
}

inline fs_profile from_record(const Profile& from) {
  fs_profile out{};
  out.kind = to_enum<fs_profile_kind>(static_cast<int32_t>(from.kind));
  out.sense = to_enum<fs_sense>(static_cast<int32_t>(from.sense));
  out.gain = from.gain;
  out.offset = from.offset;
  out.width = from.width;
  out.limit = from.limit;
  out.reach = from.reach;
  std::memcpy(out.reserved, from.reserved, sizeof out.reserved);
  return out;
}

struct Contact {
  int64_t keep;
  uint64_t reserved_32;
  double stiffness;
  double limit;
  double damping;
  double friction;
  double reserved[8];
};
static_assert(sizeof(Contact) == 112);

inline Contact to_record(const fs_contact& from) {
  Contact out{};
  out.keep = raw_value(from.keep);
  out.reserved_32 = from.reserved_32;
  out.stiffness = from.stiffness;
  out.limit = from.limit;
  out.damping = from.damping;
  out.friction = from.friction;
  std::memcpy(out.reserved, from.reserved, sizeof out.reserved);
  return out;
}

inline fs_contact from_record(const Contact& from) {
  fs_contact out{};
  out.keep = to_enum<fs_keep>(static_cast<int32_t>(from.keep));
  out.reserved_32 = static_cast<uint32_t>(from.reserved_32);
  out.stiffness = from.stiffness;
  out.limit = from.limit;
  out.damping = from.damping;
  out.friction = from.friction;
  std::memcpy(out.reserved, from.reserved, sizeof out.reserved);
  return out;
}

struct Object {
  int64_t primitive;
  char name[128];
  fs_pose pose;
  fs_twist twist;
  double time;
  double start;
  Profile front;
  Profile back;
  double damping;
  Contact contact;
  uint64_t shape;
  uint64_t tool_points;
  uint64_t enabled;
  double lifetime;
};
static_assert(sizeof(Object) == 600);

inline Object to_record(const fs_object& from) {
  Object out{};
  out.primitive = raw_value(from.primitive);
  std::memcpy(out.name, from.name, sizeof out.name);
  out.pose = from.pose;
  out.twist = from.twist;
  out.time = from.time;
  out.start = from.start;
  out.front = to_record(from.front);
  out.back = to_record(from.back);
  out.damping = from.damping;
  out.contact = to_record(from.contact);
  out.tool_points = from.tool_points;
  out.enabled = from.enabled;
  out.lifetime = from.lifetime;
  return out;
}

inline fs_object from_record(const Object& from) {
  fs_object out{};
  out.struct_size = sizeof out;
  out.primitive = to_enum<fs_primitive>(static_cast<int32_t>(from.primitive));
  std::memcpy(out.name, from.name, sizeof out.name);
  out.pose = from.pose;
  out.twist = from.twist;
  out.time = from.time;
  out.start = from.start;
  out.front = from_record(from.front);
  out.back = from_record(from.back);
  out.damping = from.damping;
  out.contact = from_record(from.contact);
  out.tool_points = static_cast<uint32_t>(from.tool_points);
  out.enabled = from.enabled != 0;
  out.lifetime = from.lifetime;
  return out;
}

// FIELD(record, field) for each field of these records and of the structs that are sent as they are.
#define FORCESERVER_CONTRACT_FIELDS(FIELD) \
  FIELD(Profile, kind) \
  FIELD(Profile, sense) \
  FIELD(Profile, gain) \
  FIELD(Profile, offset) \
  FIELD(Profile, width) \
  FIELD(Profile, limit) \
  FIELD(Profile, reach) \
  FIELD(Profile, curve) \
  FIELD(Profile, reserved) \
  FIELD(Contact, keep) \
  FIELD(Contact, reserved_32) \
  FIELD(Contact, stiffness) \
  FIELD(Contact, limit) \
  FIELD(Contact, damping) \
  FIELD(Contact, friction) \
  FIELD(Contact, reserved) \
  FIELD(Object, primitive) \
  FIELD(Object, name) \
  FIELD(Object, pose) \
  FIELD(Object, twist) \
  FIELD(Object, time) \
  FIELD(Object, start) \
  FIELD(Object, front) \
  FIELD(Object, back) \
  FIELD(Object, damping) \
  FIELD(Object, contact) \
  FIELD(Object, shape) \
  FIELD(Object, tool_points) \
  FIELD(Object, enabled) \
  FIELD(Object, lifetime) \
  FIELD(fs_vec3, x) \
  FIELD(fs_vec3, y) \
  FIELD(fs_vec3, z) \
  FIELD(fs_quat, w) \
  FIELD(fs_quat, x) \
  FIELD(fs_quat, y) \
  FIELD(fs_quat, z) \
  FIELD(fs_pose, position) \
  FIELD(fs_pose, orientation) \
  FIELD(fs_twist, linear) \
  FIELD(fs_twist, angular) \
  FIELD(fs_frame, pose) \
  FIELD(fs_frame, scale) \
  FIELD(fs_frame, force_scale) \
  FIELD(fs_frame, reserved) \
  FIELD(fs_state, pose) \
  FIELD(fs_state, twist) \
  FIELD(fs_state, time) \
  FIELD(fs_state, buttons) \
  FIELD(fs_state, flags) \
  FIELD(fs_state, reserved) \
  FIELD(fs_wrench, force) \
  FIELD(fs_wrench, torque) \
  FIELD(fs_mat3, xx) \
  FIELD(fs_mat3, xy) \
  FIELD(fs_mat3, xz) \
  FIELD(fs_mat3, yx) \
  FIELD(fs_mat3, yy) \
  FIELD(fs_mat3, yz) \
  FIELD(fs_mat3, zx) \
  FIELD(fs_mat3, zy) \
  FIELD(fs_mat3, zz) \
  FIELD(fs_response, wrench) \
  FIELD(fs_response, stiffness) \
  FIELD(fs_response, proxy) \
  FIELD(fs_response, felt_count) \
  FIELD(fs_response, flags) \
  FIELD(fs_response, error_bound) \
  FIELD(fs_response, reserved) \
  FIELD(fs_event, kind) \
  FIELD(fs_event, status) \
  FIELD(fs_event, time) \
  FIELD(fs_event, value) \
  FIELD(fs_event, name) \
  FIELD(fs_event, text) \
  FIELD(fs_report, name) \
  FIELD(fs_report, primitive) \
  FIELD(fs_report, state) \
  FIELD(fs_report, revision) \
  FIELD(fs_report, weight) \
  FIELD(fs_report, stiffness_wanted) \
  FIELD(fs_report, stiffness_applied) \
  FIELD(fs_report, distance) \
  FIELD(fs_report, point) \
  FIELD(fs_report, wrench) \
  FIELD(fs_report, shares_with) \
  FIELD(fs_report, reserved) \
  FIELD(fs_view, frame) \
  FIELD(fs_view, tool) \
  FIELD(fs_view, points) \
  FIELD(fs_view, point_count) \
  FIELD(fs_view, held) \
  FIELD(fs_view, locked) \
  FIELD(fs_view, reserved_8) \
  FIELD(fs_view, reserved) \
  FIELD(fs_motion, name) \
  FIELD(fs_motion, primitive) \
  FIELD(fs_motion, reserved_32) \
  FIELD(fs_motion, revision) \
  FIELD(fs_motion, motion_revision) \
  FIELD(fs_motion, pose) \
  FIELD(fs_motion, twist) \
  FIELD(fs_motion, time) \
  FIELD(fs_motion, horizon) \
  FIELD(fs_motion, reserved) \
  FIELD(fs_client, name) \
  FIELD(fs_client, process) \
  FIELD(fs_client, user) \
  FIELD(fs_client, objects) \
  FIELD(fs_client, reserved_32) \
  FIELD(fs_client, connected) \
  FIELD(fs_client, force_limit) \
  FIELD(fs_client, wrench) \
  FIELD(fs_client, moves) \
  FIELD(fs_client, changes) \
  FIELD(fs_client, refused) \
  FIELD(fs_client, limited) \
  FIELD(fs_client, shape_bytes) \
  FIELD(fs_client, reserved) \
  FIELD(fs_client_view, name) \
  FIELD(fs_client_view, view) \
  FIELD(fs_servo_stats, struct_size) \
  FIELD(fs_servo_stats, realtime) \
  FIELD(fs_servo_stats, faults) \
  FIELD(fs_servo_stats, protections_off) \
  FIELD(fs_servo_stats, rate) \
  FIELD(fs_servo_stats, max_stiffness) \
  FIELD(fs_servo_stats, damping) \
  FIELD(fs_servo_stats, energy) \
  FIELD(fs_servo_stats, ticks) \
  FIELD(fs_servo_stats, misses) \
  FIELD(fs_servo_stats, device_errors) \
  FIELD(fs_servo_stats, guarded) \
  FIELD(fs_servo_stats, approximated) \
  FIELD(fs_servo_stats, late_p50) \
  FIELD(fs_servo_stats, late_p99) \
  FIELD(fs_servo_stats, late_max) \
  FIELD(fs_servo_stats, compute_p50) \
  FIELD(fs_servo_stats, compute_p99) \
  FIELD(fs_servo_stats, compute_max) \
  FIELD(fs_servo_stats, enabled) \
  FIELD(fs_servo_stats, reserved) \
  FIELD(fs_servo_stats, delay) \
  FIELD(fs_servo_stats, link_delay_p50) \
  FIELD(fs_servo_stats, link_delay_p99) \
  FIELD(fs_servo_stats, link_rate) \
  FIELD(fs_servo_stats, link_loss) \
  FIELD(fs_device_info, struct_size) \
  FIELD(fs_device_info, force_axes) \
  FIELD(fs_device_info, torque_axes) \
  FIELD(fs_device_info, reserved) \
  FIELD(fs_device_info, name) \
  FIELD(fs_device_info, serial) \
  FIELD(fs_device_info, workspace_radius) \
  FIELD(fs_device_info, workspace_height) \
  FIELD(fs_device_info, workspace_angle) \
  FIELD(fs_device_info, force_max) \
  FIELD(fs_device_info, torque_max) \
  FIELD(fs_device_info, resolution) \
  FIELD(fs_device_info, rate) \
  FIELD(fs_device_info, delay) \
  FIELD(fs_device_info, damping) \
  FIELD(fs_device_info, mass) \
  FIELD(fs_device_info, link_rate) \
  FIELD(fs_device_info, controller_rate) \
  FIELD(fs_device_info, controller_delay) \
  FIELD(fs_device_info, controller_damping) \
  FIELD(fs_tick, state) \
  FIELD(fs_tick, response) \
  FIELD(fs_tick, sent) \
  FIELD(fs_tick, late) \
  FIELD(fs_tick, compute) \
  FIELD(fs_tick, device) \
  FIELD(fs_tick, faults) \
  FIELD(fs_recorded_tick, number) \
  FIELD(fs_recorded_tick, tick)

}  // namespace fs::wire
