// The memory that a client and its server share: two memory files, made and sealed by the server, so that nobody can
// change their size. In both every word is atomic: whatever is read is copied before it is looked at.
//
//   inbox   client to server: where its objects are, a slot each
//   outbox  server to client, which can only read it: the hand, what the clients must know at once, events
#pragma once

#include <cstddef>
#include <memory>

#include "base/seqlock.h"
#include "base/descriptor.h"
#include "field/servo_output.h"
#include "ipc/wire.h"

namespace fs {

inline constexpr uint64_t event_slots = 1024;
inline constexpr uint32_t most_slots = 65536;  // of an inbox

struct Outbox {
  ServoOutput servo;                                 // written by the tick; the rest by the server's thread
  alignas(64) std::atomic<double> heartbeat{0};      // s, monotonic clock: when the server last came by
  std::atomic<uint32_t> is_closed{0};                // the server has let go of this client
  std::atomic<uint32_t> is_asleep{0};                // it looks at the inbox only when it is woken
  std::atomic<uint64_t> edits{0};                    // grows when there is something that the client may not know
  std::atomic<uint64_t> settled{0};                  // serial: all of the client's messages up to it have been applied
  std::atomic<uint64_t> events_written{0};
  Seqlock<wire::EventSlot> events[event_slots];      // the newest, by number
};

struct InboxHead {
  std::atomic<uint64_t> batch{0};                    // odd while a group of moves is being written
  std::atomic<uint64_t> summary[most_slots / 64 / 64];  // bit i of word w: dirty word 64 w + i is not 0
};

// A view of an inbox: its head, then a dirty bit and a record for each slot.
class Inbox {
 public:
  Inbox() = default;
  Inbox(void* memory, uint32_t slots);
  static size_t bytes(uint32_t slots);

  // ---- The client's. [rt]
  void write(uint32_t slot, const wire::Move& move) noexcept;
  void begin_batch() noexcept;
  void end_batch() noexcept;

  // ---- The server's. Nothing here is trusted, and nothing waits.
  // Calls f(slot) for each that has been written since the last call.
  template <class F>
  void take_dirty(F&& f) noexcept;
  bool has_dirty() const noexcept;
  // Odd: a group is being written; another number than before: one was. Then what was read belongs together only when it
  // is read once more.
  uint64_t batch() const noexcept { return head_->batch.load(std::memory_order_acquire); }
  // False: being written, or never was.
  bool read(uint32_t slot, wire::Move& move) const noexcept { return records_[slot].read(move); }

 private:
  InboxHead* head_ = nullptr;
  std::atomic<uint64_t>* dirty_ = nullptr;
  Seqlock<wire::Move>* records_ = nullptr;
  uint32_t slots_ = 0, words_ = 0;
};

inline void Inbox::write(uint32_t slot, const wire::Move& move) noexcept {
  records_[slot].write(move);
  // Sequentially consistent, as is the server's look at it before it sleeps: one of the two sees the other.
  const uint32_t word = slot / 64;
  const uint64_t before = dirty_[word].fetch_or(uint64_t{1} << (slot % 64));
  if (before == 0) head_->summary[word / 64].fetch_or(uint64_t{1} << (word % 64));
}

inline void Inbox::begin_batch() noexcept { head_->batch.fetch_or(1); }
inline void Inbox::end_batch() noexcept { head_->batch.store((head_->batch.load(std::memory_order_relaxed) | 1) + 1); }

template <class F>
void Inbox::take_dirty(F&& f) noexcept {
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

inline bool Inbox::has_dirty() const noexcept {
  for (uint32_t i = 0; 64 * i < words_; ++i) {
    if (head_->summary[i].load() != 0) return true;
  }
  return false;
}

// A memory file of so many bytes, all 0, that nobody can make longer or shorter. IO, FULL.
Descriptor make_region(const char* label, size_t bytes);
// The seals are final; and only what is mapped already can write to it. IO.
void seal_region(const Descriptor& region, bool against_writing);
// The whole of it in this process, as long as the pointer lives. Its size is checked, and that nobody can
// make it shorter, which would be a SIGBUS. IO, INVALID.
std::shared_ptr<void> map_region(const Descriptor& region, size_t bytes, bool may_write);

}  // namespace fs
