// The layout of an inbox: shared memory in which a client overwrites records, of which the server takes the newest, without a
// message and without waiting. Each record has a slot. A dirty bit for each slot says that it was written since the last
// look, and a summary of these bits makes a look cheap where little was written.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>

#include "base/seqlock.h"

namespace fs {

inline constexpr uint32_t most_slots = 65536;  // of an inbox

struct InboxHead {
  std::atomic<uint64_t> batch{0};                       // odd while a group of records is being written
  std::atomic<uint64_t> has_left{0};                    // 1: the client goes of its own accord
  std::atomic<uint64_t> summary[most_slots / 64 / 64];  // bit i of word w: dirty word 64 w + i is not 0
};

// A view of an inbox: its head, then a dirty bit for each slot, then a record for each slot.
template <class Record>
class InboxOf {
 public:
  InboxOf() = default;
  InboxOf(void* memory, uint32_t slots);
  static size_t bytes(uint32_t slots);

  // ---- The client's. [rt]
  void write(uint32_t slot, const Record& record) noexcept;
  void begin_batch() noexcept;
  void end_batch() noexcept;
  void leave() noexcept { head_->has_left.store(1, std::memory_order_release); }

  // ---- The server's. Nothing here is trusted, and nothing waits.
  // Calls f(slot) for each slot that has been written since the last call.
  template <class F>
  void take_dirty(F&& f) noexcept;
  bool has_dirty() const noexcept;
  bool has_left() const noexcept { return head_->has_left.load(std::memory_order_acquire) == 1; }
  // Odd: a group is being written. Where the number has changed since the slots were read, a group was written meanwhile: all of
  // them are to be read again.
  uint64_t batch() const noexcept { return head_->batch.load(std::memory_order_acquire); }
  // 0: the record is being written, or never was; else the number of the write.
  uint64_t read(uint32_t slot, Record& record) const noexcept { return records_[slot].read(record); }

 private:
  InboxHead* head_ = nullptr;
  std::atomic<uint64_t>* dirty_ = nullptr;
  Seqlock<Record>* records_ = nullptr;
  uint32_t slots_ = 0, words_ = 0;
};

template <class Record>
InboxOf<Record>::InboxOf(void* memory, uint32_t slots) : slots_(slots), words_((slots + 63) / 64) {
  auto* place = static_cast<char*>(memory);
  head_ = reinterpret_cast<InboxHead*>(place);
  dirty_ = reinterpret_cast<std::atomic<uint64_t>*>(place += sizeof(InboxHead));
  records_ = reinterpret_cast<Seqlock<Record>*>(place + 8 * words_);
}

template <class Record>
size_t InboxOf<Record>::bytes(uint32_t slots) {
  return sizeof(InboxHead) + 8 * ((slots + 63) / 64) + slots * sizeof(Seqlock<Record>);
}

template <class Record>
void InboxOf<Record>::write(uint32_t slot, const Record& record) noexcept {
  records_[slot].write(record);
  // Sequentially consistent, as is the server's look at it before it sleeps: one of the two sees the other.
  const uint32_t word = slot / 64;
  const uint64_t before = dirty_[word].fetch_or(uint64_t{1} << (slot % 64));
  if (before == 0) head_->summary[word / 64].fetch_or(uint64_t{1} << (word % 64));
}

template <class Record>
void InboxOf<Record>::begin_batch() noexcept {
  head_->batch.fetch_or(1);
}

template <class Record>
void InboxOf<Record>::end_batch() noexcept {
  head_->batch.store((head_->batch.load(std::memory_order_relaxed) | 1) + 1);
}

template <class Record>
template <class F>
void InboxOf<Record>::take_dirty(F&& f) noexcept {
  for (uint32_t i = 0; 64 * i < words_; ++i) {
    if (head_->summary[i].load(std::memory_order_relaxed) == 0) continue;
    for (uint64_t summary = head_->summary[i].exchange(0); summary != 0; summary &= summary - 1) {
      const uint32_t word = 64 * i + static_cast<uint32_t>(__builtin_ctzll(summary));
      if (word >= words_) break;
      for (uint64_t dirty = dirty_[word].exchange(0); dirty != 0; dirty &= dirty - 1) {
        const uint32_t slot = 64 * word + static_cast<uint32_t>(__builtin_ctzll(dirty));
        if (slot < slots_) f(slot);
      }
    }
  }
}

template <class Record>
bool InboxOf<Record>::has_dirty() const noexcept {
  for (uint32_t i = 0; 64 * i < words_; ++i) {
    if (head_->summary[i].load() != 0) return true;
  }
  return false;
}

}  // namespace fs
