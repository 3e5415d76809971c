// The layout of all that client and server exchange, as a text: "record field offset size", a line each. Who changes it has to
// give the wire another version.
#pragma once

#include <cstddef>
#include <string>

#include "transfer/shared_memory.h"

namespace fs::test {

inline std::string wire_layout() {
  using namespace wire;
  std::string text;
#define FIELD(record, field)                                                                                          \
  text += #record " " #field " " + std::to_string(offsetof(record, field)) + ' ' + std::to_string(sizeof(record::field)) + '\n'
#define F1(r, a) FIELD(r, a)
#define F2(r, a, ...) FIELD(r, a), F1(r, __VA_ARGS__)
#define F3(r, a, ...) FIELD(r, a), F2(r, __VA_ARGS__)
#define F4(r, a, ...) FIELD(r, a), F3(r, __VA_ARGS__)
#define F5(r, a, ...) FIELD(r, a), F4(r, __VA_ARGS__)
#define F6(r, a, ...) FIELD(r, a), F5(r, __VA_ARGS__)
#define F7(r, a, ...) FIELD(r, a), F6(r, __VA_ARGS__)
#define F8(r, a, ...) FIELD(r, a), F7(r, __VA_ARGS__)
#define PICK(_1, _2, _3, _4, _5, _6, _7, _8, name, ...) name
#define RECORD(r, ...) PICK(__VA_ARGS__, F8, F7, F6, F5, F4, F3, F2, F1)(r, __VA_ARGS__)
  RECORD(Hello, magic, wire, reserved, client, version, sizes);
  RECORD(HelloAnswer, magic, wire, status, version, text);
  RECORD(wire::Sizes, object, stats, device, later);
  RECORD(Header, type, reserved, serial);
  RECORD(wire::Group, bytes);
  RECORD(Welcome, inbox_bytes, outbox_bytes, max_objects, is_virtual, is_locked, rate, sizes);
  RECORD(Reply, status, reason, text);
  RECORD(wire::Profile, kind, sense, gain, offset, width, limit, reach, curve);
  RECORD(wire::Profile, reserved);
  RECORD(wire::Contact, keep, reserved_32, stiffness, limit, damping, friction, reserved);
  RECORD(wire::Object, known, primitive, name, pose, twist, time, start);  // its first version
  RECORD(wire::Object, front, back, damping, contact, shape, tool_points, enabled, lifetime);
  RECORD(Set, slot, parts);
  RECORD(wire::Motion, pose, twist, time, horizon);
  RECORD(wire::Place, name, motion);
  RECORD(Remove, name);
  RECORD(Bind, slot, reserved, name);
  RECORD(wire::Frame, frame);
  RECORD(Clutch, is_held);
  RECORD(Accuracy, newtons);
  RECORD(MaxStiffness, stiffness);
  RECORD(wire::Tool, count, points);
  RECORD(wire::ToolRadius, radius);
  RECORD(wire::Shape, id, primitive, is_closed, point_count, triangle_count);
  RECORD(wire::Curve, id, count, step, expression);
  RECORD(Forget, id);
  RECORD(Target, name);
  RECORD(Since, client, revision);
  RECORD(Fetch, id);
  RECORD(After, number);
  RECORD(Count, count, stride);
  RECORD(PullAnswer, state, slot, news, motion, frame, tool);
  RECORD(wire::Move, after, motion);
  RECORD(HandSample, state, response, sent);
  RECORD(NumberedEvent, number, event);
  RECORD(Outbox, servo, heartbeat, is_closed, is_asleep, news, applied, events_written, events);
  RECORD(ServoOutput, time, tick, used, hand);
  RECORD(InboxHead, batch, has_left, summary);
  text += "types " + std::to_string(type_tool_radius) + ' ' + std::to_string(type_motions_since) + ' ' +
          std::to_string(type_reply) + " inbox " + std::to_string(Inbox::bytes(64)) + '\n';
#undef RECORD
#undef PICK
#undef F8
#undef F7
#undef F6
#undef F5
#undef F4
#undef F3
#undef F2
#undef F1
#undef FIELD
  return text;
}

}  // namespace fs::test
