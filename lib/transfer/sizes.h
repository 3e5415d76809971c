// Records of the wire that grow, because their struct of the contract does. A client and its server may know more or less of
// such a record. When they connect, each tells the other how many bytes of it it knows, and then both send what both know;
// who receives it fills the rest with 0. Such a record stands at the end of its message, so nothing comes after it.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>

#include "transfer/wire.h"

namespace fs {

using RecordSizes = wire::Sizes;  // in bytes

RecordSizes own_sizes() noexcept;
RecordSizes first_sizes() noexcept;  // of the first version; no version has smaller ones
// What both know. Nothing: these are not the sizes of any version.
std::optional<RecordSizes> common_sizes(const RecordSizes& theirs) noexcept;

// The growing record at the end of a message: its entry in Sizes, and how many bytes come before it.
struct GrowingEnd {
  uint32_t wire::Sizes::* size;
  size_t begin, whole;  // whole: of the message as this library knows it
};
std::optional<GrowingEnd> growing_end(uint32_t type) noexcept;  // of a message or change of the client's

template <class Record>
inline constexpr GrowingEnd end_of{nullptr, sizeof(Record), sizeof(Record)};
template <>
inline constexpr GrowingEnd end_of<wire::Object>{&wire::Sizes::object, 0, sizeof(wire::Object)};
template <>
inline constexpr GrowingEnd end_of<wire::Set>{&wire::Sizes::object, offsetof(wire::Set, object), sizeof(wire::Set)};
template <>
inline constexpr GrowingEnd end_of<wire::PullAnswer>{&wire::Sizes::object, offsetof(wire::PullAnswer, object),
                                                     sizeof(wire::PullAnswer)};
template <>
inline constexpr GrowingEnd end_of<fs_servo_stats>{&wire::Sizes::stats, 0, sizeof(fs_servo_stats)};
template <>
inline constexpr GrowingEnd end_of<fs_device_info>{&wire::Sizes::device, 0, sizeof(fs_device_info)};

// The bytes of such a record that are sent to an end with which these sizes are common.
inline size_t sent_size(const GrowingEnd& end, const RecordSizes& common) noexcept {
  return end.size ? end.begin + common.*end.size : end.whole;
}
template <class Record>
std::span<const std::byte> sent_part(const Record& record, const RecordSizes& common) noexcept {
  return std::as_bytes(std::span(&record, 1)).first(sent_size(end_of<Record>, common));
}

// The size of the record of a message or change, as a client sends it with which these sizes are common; nothing: there is no
// such type, or it is a group.
std::optional<size_t> record_size(uint32_t type, const RecordSizes& common) noexcept;

// The part of a client's change that is sent to the server. VERSION: it sets a field that the server does not know.
std::span<const std::byte> sent_change(uint32_t type, std::span<const std::byte> record, const RecordSizes& common);
void require_known(const fs_object& object, const RecordSizes& common);  // VERSION

// A sentence about two ends that speak different versions of the wire; and the versions of their libraries.
std::string wire_difference(uint32_t client, const std::string& client_version, uint32_t server,
                            const std::string& server_version);

// Notes in a record that came with an object, and whose rest was filled with 0, that no more of it is known.
void limit_known(wire::Object& object, const RecordSizes& common) noexcept;

}  // namespace fs
