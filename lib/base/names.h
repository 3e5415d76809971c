// The names of the contract's enum values: a table for each enum but fs_status (api_base.cpp), in which a value is the index of
// its name. The library and the program take them from here.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>

#include <forceserver/servo.h>

#include "base/enum.h"

namespace fs {

constexpr const char* primitive_names[] = {"FS_PRIMITIVE_POINT", "FS_PRIMITIVE_POLYLINE", "FS_PRIMITIVE_PLANE",
                                           "FS_PRIMITIVE_MESH"};
constexpr const char* profile_kind_names[] = {
    "FS_PROFILE_NONE",     "FS_PROFILE_CONSTANT",  "FS_PROFILE_LINEAR_INCREASING", "FS_PROFILE_LINEAR_DECREASING",
    "FS_PROFILE_GAUSSIAN", "FS_PROFILE_QUADRATIC", "FS_PROFILE_INVERSE",           "FS_PROFILE_CUSTOM"};
constexpr const char* sense_names[] = {"FS_SENSE_ATTRACTIVE", "FS_SENSE_REPULSIVE"};
constexpr const char* keep_names[] = {"FS_KEEP_NONE", "FS_KEEP_FRONT", "FS_KEEP_BACK", "FS_KEEP_EITHER"};
constexpr const char* axis_names[] = {"FS_AXIS_Z", "FS_AXIS_X", "FS_AXIS_Y"};
constexpr const char* object_state_names[] = {"FS_OBJECT_PENDING", "FS_OBJECT_FELT", "FS_OBJECT_FADING", "FS_OBJECT_DISABLED",
                                              "FS_OBJECT_REFUSED"};
constexpr const char* event_kind_names[] = {"FS_EVENT_NONE",     "FS_EVENT_READY",   "FS_EVENT_REFUSED", "FS_EVENT_CAPPED",
                                            "FS_EVENT_EDITED",   "FS_EVENT_EXPIRED", "FS_EVENT_DEVICE",  "FS_EVENT_DISCONNECTED",
                                            "FS_EVENT_OVERFLOW", "FS_EVENT_CLIENT"};
constexpr const char* realtime_names[] = {"FS_REALTIME_NONE", "FS_REALTIME_NICE", "FS_REALTIME_FIFO", "FS_REALTIME_FIFO_LOCKED"};
// For fault bits the index is the number of the bit.
constexpr const char* fault_names[] = {"FS_FAULT_DEVICE", "FS_FAULT_SPEED", "FS_FAULT_NUMBER", "FS_FAULT_LATE"};

// Why a device is not ready; the index is the number of the FS_STATE_ bit, less that of the first.
constexpr const char* state_reasons[] = {
    "it does not answer yet",
    "it must be given its firmware first",
    "it is not homed, so it does not know where its handle is",
    "its handle is in the holder: take it out",
    "its motors are off: the emergency stop, the force switch or the dead man's switch, no power, or they are too warm",
    "it has switched its motors off, because the handle was too fast",
};
constexpr uint32_t state_reason_bits = ((1u << std::size(state_reasons)) - 1) * FS_STATE_CONNECTING;

inline const char* state_reason(uint32_t flags) noexcept {  // "": none
  flags &= state_reason_bits;
  return flags ? state_reasons[std::countr_zero(flags / FS_STATE_CONNECTING)] : "";
}

// [rt] The name of a value, which may be any number; `unknown` when it has no name.
template <size_t count>
const char* name_at(const char* const (&names)[count], size_t index, const char* unknown) noexcept {
  return index < count ? names[index] : unknown;
}
template <class Enum, size_t count>
const char* name_of(const char* const (&names)[count], const Enum& value, const char* unknown) noexcept {
  return name_at(names, static_cast<uint32_t>(raw_value(value)), unknown);
}

// A name without its prefix: "LINEAR_INCREASING".
constexpr const char* without_prefix(const char* name) {
  for (int parts = 0; parts < 2; ++name) parts += *name == '_';
  return name;
}

}  // namespace fs
