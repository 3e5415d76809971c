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
  set_raw_value(out.kind, static_cast<int32_t>(from.kind));
  set_raw_value(out.sense, static_cast<int32_t>(from.sense));
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
  set_raw_value(out.keep, static_cast<int32_t>(from.keep));
  out.reserved_32 = static_cast<uint32_t>(from.reserved_32);
  out.stiffness = from.stiffness;
  out.limit = from.limit;
  out.damping = from.damping;
  out.friction = from.friction;
  std::memcpy(out.reserved, from.reserved, sizeof out.reserved);
  return out;
}

struct Object {
  uint64_t known;  // bytes of the record of which its sender knows the meaning; the rest is 0
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
  uint64_t surface;
};
static_assert(sizeof(Object) == 616);

// How much of the record is known to who knows so much of the struct, and the other way round: whole fields.
struct KnownEnd {
  uint32_t of_struct, of_record;
};
inline constexpr KnownEnd known_ends[] = {
    {8, 16},  // primitive
    {136, 144},  // name
    {192, 200},  // pose
    {240, 248},  // twist
    {248, 256},  // time
    {256, 264},  // start
    {344, 360},  // front
    {432, 456},  // back
    {440, 464},  // damping
    {544, 576},  // contact
    {552, 584},  // shape
    {564, 592},  // tool_points
    {565, 600},  // enabled
    {576, 608},  // lifetime
    {584, 616},  // surface
};
static_assert(known_ends[14].of_record == sizeof(Object));

inline uint32_t record_bytes(uint64_t struct_bytes) {
  uint32_t out = 0;
  for (const KnownEnd& end : known_ends) {
    if (end.of_struct <= struct_bytes) out = end.of_record;
  }
  return out;
}

inline uint32_t struct_bytes(uint64_t record_bytes) {
  uint32_t out = 0;
  for (const KnownEnd& end : known_ends) {
    if (end.of_record <= record_bytes) out = end.of_struct;
  }
  return out;
}

inline Object to_record(const fs_object& from) {
  Object out{};
  out.known = record_bytes(from.struct_size);
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
  out.struct_size = struct_bytes(from.known);
  set_raw_value(out.primitive, static_cast<int32_t>(from.primitive));
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

// The structs that are sent as they are.
static_assert(sizeof(fs_frame) == 104);
static_assert(sizeof(fs_state) == 152);
static_assert(sizeof(fs_response) == 216);
static_assert(sizeof(fs_event) == 320);
static_assert(sizeof(fs_report) == 392);
static_assert(sizeof(fs_view) == 968);
static_assert(sizeof(fs_motion) == 304);
static_assert(sizeof(fs_client) == 280);
static_assert(sizeof(fs_client_view) == 1096);
static_assert(sizeof(fs_servo_stats) == 184);
static_assert(sizeof(fs_device_info) == 264);
static_assert(sizeof(fs_tick) == 440);
static_assert(sizeof(fs_recorded_tick) == 448);

}  // namespace fs::wire
