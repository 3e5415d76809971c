// A batch: changes that belong together, either a group or one change alone. All of them are sent and applied, or none. A
// client puts batches together, and the server takes them apart; only this file knows how they look in a message.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <iterator>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "base/descriptor.h"
#include "transfer/sizes.h"
#include "transfer/wire.h"

namespace fs {

// One change of a batch.
struct Change {
  wire::Type type;
  // Lies in the batch. In a batch that came it is a whole record; in one to be sent, as much of it as the server knows.
  std::span<const std::byte> record;

  template <class Record>
  const Record& as() const noexcept {
    return *reinterpret_cast<const Record*>(record.data());
  }
  // It changes an object of another client.
  bool is_foreign() const noexcept {
    const bool may_be = type == wire::type_change || type == wire::type_place || type == wire::type_remove;
    return may_be && name().find('/') != std::string_view::npos;
  }
  // It cannot be part of a group.
  bool comes_alone() const noexcept {
    return type == wire::type_forget || type == wire::type_clear || type == wire::type_accuracy ||
           type == wire::type_max_stiffness;
  }
  // The name of the object that it is about, "client/object" of a foreign one; empty: it is about none.
  std::string_view name() const noexcept;
};

class Batch {
 public:
  class Iterator {
   public:
    using iterator_category = std::input_iterator_tag;
    using value_type = Change;
    using difference_type = std::ptrdiff_t;
    using pointer = void;
    using reference = Change;
    Iterator(const Batch& batch, size_t i) : batch_(&batch), i_(i) {}
    Change operator*() const noexcept { return (*batch_)[i_]; }
    Iterator& operator++() noexcept { return ++i_, *this; }
    bool operator==(const Iterator& other) const noexcept { return i_ == other.i_; }

   private:
    const Batch* batch_;
    size_t i_;
  };

  Batch() = default;
  explicit Batch(const RecordSizes& common) : common_(common) {}  // that are common with the other end
  Batch(Batch&&) noexcept = default;
  Batch& operator=(Batch&&) noexcept = default;

  size_t size() const noexcept { return places_.size(); }
  bool empty() const noexcept { return places_.empty(); }
  Change operator[](size_t i) const noexcept {
    const Place& place = places_[i];
    return {place.type, {place.is_filled ? filled_[place.at]->data() : base() + place.at, place.size}};
  }
  Iterator begin() const noexcept { return {*this, 0}; }
  Iterator end() const noexcept { return {*this, size()}; }

  // ---- To send a batch.
  void add(wire::Type type, std::span<const std::byte> record);  // VERSION: the server does not know a part of it that is not 0
  template <class Record>
  void add(wire::Type type, const Record& record) {
    add(type, std::as_bytes(std::span(&record, 1)));
  }
  void put_slot(size_t i, uint32_t slot) noexcept;  // of a set or change
  struct Message {
    wire::Type type;
    std::span<const std::byte> body;  // lies in the batch
    Descriptor content;  // may be none
  };
  Message message() const;  // IO, FULL

  // ---- To read a batch.
  class Reader;
  bool is_mapped() const noexcept { return is_mapped_; }  // it lies in a memory file, of which a process can map only so many

 private:
  struct Place {
    wire::Type type;
    uint32_t size;
    bool is_filled;
    size_t at;  // bytes from the base; or the index in filled_
  };
  struct alignas(8) Filled : std::array<std::byte, sizeof(wire::Set)> {};
  const std::byte* base() const noexcept { return memory_ ? memory_base_ : bytes_.data(); }

  void add_came(wire::Type type, std::span<const std::byte> record);

  RecordSizes common_ = own_sizes();
  std::vector<Place> places_;
  std::vector<std::unique_ptr<Filled>> filled_;  // records that came from a client that knows less of them: the rest is 0
  std::vector<std::byte> bytes_;  // to be sent: a wire::Group, then the changes with their headers
  std::shared_ptr<const void> memory_;  // that came
  const std::byte* memory_base_ = nullptr;
  bool is_mapped_ = false;
};

// Takes a group apart, change by change, because a long one takes a while.
class Batch::Reader {
 public:
  // The batch of a message with one change.
  static Batch read(wire::Type type, std::span<const std::byte> record, std::shared_ptr<const void> memory,
                    const RecordSizes& common = own_sizes());

  // body: of the group's message, at least a wire::Group; it lies in memory, which nobody can change any more. content: the
  // descriptor that came along; may be none. most: changes.
  Reader(std::span<const std::byte> body, std::shared_ptr<const void> memory, Descriptor&& content, size_t most,
         const RecordSizes& common = own_sizes());

  bool is_good() const noexcept { return is_good_; }  // false: the message is malformed
  bool is_done() const noexcept { return !is_good_ || rest_.empty(); }
  std::optional<Change> next();  // nothing: the message is malformed
  Batch take() noexcept { return std::move(batch_); }

 private:
  Batch batch_;
  std::span<const std::byte> rest_;
  size_t most_;
  bool is_good_ = false;
};

}  // namespace fs
