#include "transfer/batch.h"

#include <algorithm>
#include <cstring>

#include "base/error.h"
#include "ipc/blob.h"
#include "ipc/socket.h"

namespace fs {
namespace {

template <size_t n>
std::string_view view_of(const char (&field)[n]) noexcept {
  return {field, strnlen(field, n)};
}

}  // namespace

std::string_view Change::name() const noexcept {
  switch (type) {
    case wire::type_set:
    case wire::type_change: return view_of(as<wire::Set>().object.name);
    case wire::type_place: return view_of(as<wire::Place>().name);
    case wire::type_remove: return view_of(as<wire::Remove>().name);
    case wire::type_bind: return view_of(as<wire::Bind>().name);
    default: return {};
  }
}

// ------------------------------------------------------------------------------------------------------ to be sent

void Batch::add(wire::Type type, std::span<const std::byte> whole) {
  const std::span<const std::byte> record = sent_change(type, whole, common_);
  const wire::Header header{type, 0, 0};
  const size_t begin = std::max(bytes_.size(), sizeof(wire::Group)), at = begin + sizeof header;
  bytes_.resize(at + record.size());
  places_.push_back({type, static_cast<uint32_t>(record.size()), false, at});
  const wire::Group group{bytes_.size() - sizeof(wire::Group)};
  std::memcpy(bytes_.data(), &group, sizeof group);
  std::memcpy(bytes_.data() + begin, &header, sizeof header);
  if (!record.empty()) std::memcpy(bytes_.data() + at, record.data(), record.size());
}

void Batch::put_slot(size_t i, uint32_t slot) noexcept {
  static_assert(offsetof(wire::Set, slot) == 0);
  std::memcpy(bytes_.data() + places_[i].at, &slot, sizeof slot);
}

Batch::Message Batch::message() const {
  const Change first = (*this)[0];
  if (size() == 1 && !first.is_foreign()) return {first.type, first.record, {}};
  const std::span<const std::byte> all = bytes_;
  if (all.size() <= most_message / 2) return {wire::type_group, all, {}};
  return {wire::type_group, all.first(sizeof(wire::Group)), make_blob({all.subspan(sizeof(wire::Group))})};
}

// ------------------------------------------------------------------------------------------------------- that came

void Batch::add_came(wire::Type type, std::span<const std::byte> record) {
  const auto end = growing_end(type);
  if (!end || record.size() == end->whole) {
    places_.push_back({type, static_cast<uint32_t>(record.size()), false, static_cast<size_t>(record.data() - memory_base_)});
    return;
  }
  Filled& filled = *filled_.emplace_back(std::make_unique<Filled>());
  std::memcpy(filled.data(), record.data(), record.size());
  limit_known(*reinterpret_cast<wire::Object*>(filled.data() + end->begin), common_);
  places_.push_back({type, static_cast<uint32_t>(end->whole), true, filled_.size() - 1});
}

Batch Batch::Reader::read(wire::Type type, std::span<const std::byte> record, std::shared_ptr<const void> memory,
                          const RecordSizes& common) {
  Batch out(common);
  out.memory_ = std::move(memory);
  out.memory_base_ = record.data();
  out.add_came(type, record);
  return out;
}

Batch::Reader::Reader(std::span<const std::byte> body, std::shared_ptr<const void> memory, Descriptor&& content, size_t most,
                      const RecordSizes& common)
    : batch_(common), most_(most) {
  wire::Group group;
  std::memcpy(&group, body.data(), sizeof group);
  rest_ = body.subspan(sizeof group);
  batch_.memory_ = std::move(memory);
  if (content) {
    constexpr size_t largest = sizeof(wire::Header) + std::max(sizeof(wire::Set), sizeof(wire::Tool));
    if (!rest_.empty() || group.bytes > most * largest) return;
    try {
      batch_.memory_ = map_blob(content, group.bytes);
    } catch (const Error&) {  // it is no sealed memory of that size, or this process has no room for it
      return;
    }
    batch_.is_mapped_ = true;
    rest_ = {static_cast<const std::byte*>(batch_.memory_.get()), static_cast<size_t>(group.bytes)};
    content.reset();
  }
  batch_.memory_base_ = rest_.data();
  is_good_ = rest_.size() == group.bytes;
}

std::optional<Change> Batch::Reader::next() {
  wire::Header header;
  is_good_ = false;
  if (rest_.size() < sizeof header || batch_.size() == most_) return {};
  std::memcpy(&header, rest_.data(), sizeof header);
  rest_ = rest_.subspan(sizeof header);
  const std::optional<size_t> size = record_size(header.type, batch_.common_);
  if (!size || rest_.size() < *size) return {};
  const auto type = static_cast<wire::Type>(header.type);
  batch_.add_came(type, rest_.first(*size));
  rest_ = rest_.subspan(*size);
  is_good_ = true;
  return batch_[batch_.size() - 1];
}

}  // namespace fs
