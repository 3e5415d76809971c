// What a reader (the servo, a tool) keeps from tick to tick. The snapshot it only reads; in its memory it writes down the
// weight of each row and which rows are near. The scene makes room for a row before it posts the row; from then on only
// the reader writes, except that the scene may replace a row that has not begun by another (Weight::replace_waiting). Weights
// are atomic, because the scene reads them to learn what has faded out.
//
// A chunk of 64 rows *sleeps* as long as none of its rows can be felt and none of its weights arrives or expires. It wakes
// when the tool has travelled as far as the smallest gap between the tool and its rows, or when its time has come. So a
// tick costs what is near the hand, not what exists.
#pragma once

#include <array>
#include <memory>

#include "field/view_memory.h"

namespace fs {

class Proxies;

class Memory : public Counted<Memory> {
 public:
  static constexpr uint32_t row_count = 1u << 22;  // most

  // Of a servo. Rows that are posted later come in from weight 0.
  explicit Memory(const Spread& the_spread) : spread(the_spread), has_weights_(true) {}
  // Of a tool, which feels in full what is there.
  Memory() : has_weights_(false) {}

  const Spread spread;

  ViewMemory views;

  // ---- For the scene, under its lock.

  ~Memory();

  // Makes room for the chunk that the row stands in.
  void make_room(uint32_t row);
  // Makes room for the proxies of solid objects.
  void make_proxies();
  // The row must have room.
  Weight& weight(uint32_t row) noexcept { return weights(row / chunk_size).rows[row % chunk_size]; }
  // The weight of a row at `now`, worked out where the chunk sleeps. Any thread that holds the memory.
  double weight_at(uint32_t row, uint64_t version, double now) const noexcept;

  // ---- [rt] For the reader.

  // Null as long as there has been no solid object.
  Proxies* proxies() const noexcept { return proxies_.load(std::memory_order_acquire); }

  // Takes the newest snapshot, which may be that of the last tick.
  void absorb(const Snapshot& snapshot, double now) noexcept;
  // Moves the weights to `now`. Of a servo, once a tick, after absorb.
  void advance(const Snapshot& snapshot, double now) noexcept;
  // Begins a tick in which all views are evaluated, after absorb. A tick without a hand has none of this: then the solids
  // go on from the tick before.
  void begin_tick(double now) noexcept;

  // What the newer versions of a row's object weigh together, near or not. Of a servo.
  double newer_weight(const Row& row, double now) const noexcept;

  // N, an upper bound of the force that all objects together may have which are left out for the accuracy.
  double omitted() const noexcept { return omitted_; }

  // Looks where the tool is now: in a sphere about `centre` (m, scene frame). what: the version of
  // the view; where it is not that of the last call, all objects are looked at anew.
  void look(uint32_t view, uint64_t what, Vec3 centre, double radius, double now) noexcept;

  // Calls f(chunk number, const Chunk&, rows, weights) for each chunk with rows that may be felt, in order. rows: those that
  // are near and have a weight. weights: of its 64 rows; null: all 1.
  template <class F>
  void for_each_near(uint32_t view, double now, F&& f) const noexcept;

 private:
  static constexpr uint32_t block_size = 64, block_count = row_count / chunk_size / block_size;  // chunks, blocks

  struct Weights {
    std::array<Weight, chunk_size> rows;
    // Written by the tick, also read by whoever asks for a weight.
    std::atomic<uint64_t> moving{0};        // bit i: the weight of row i is moving,
    std::atomic<uint64_t> going_in{0};      // it rises,
    std::atomic<uint64_t> handing_over{0};  // it is handed over to the successor
    std::atomic<double> since{0};                  // s: the weights are those of this time
  };

  // A view's sight of the chunks of a block.
  struct Sight {
    double wake_least = never;             // of wake_at
    double wake_at[block_size];            // m: the chunk sleeps until `travelled` is as large
    uint64_t near[block_size] = {};        // bit i: row i may be felt before the chunk wakes
    uint64_t any = 0;                      // bit c: chunk c has a row that is near
    Sight() {
      for (double& at : wake_at) at = never;
    }
    void forget(uint32_t c) noexcept {     // chunk c is no more
      near[c] = 0;
      any &= ~bit_of(c);
      wake_at[c] = never;
    }
  };

  struct Block {
    double due_least = never;              // of due
    double due[block_size];                // s: when the weights are to be looked at,
    double event[block_size];              // and when one of them arrives or expires
    const Chunk* chunks[block_size] = {};  // of the snapshot absorbed last; null: there is none
    bool is_outlined[block_size] = {};     // outline and planes are those of the chunk as it is now
    uint64_t planes[block_size] = {};      // its planes
    uint64_t felt[block_size] = {};        // bit i: row i has a weight above 0; of a tool: it is there
    uint64_t expiring[block_size] = {};    // of a tool, bit i: row i has an expiry
    std::unique_ptr<Weights> weights[block_size];
    std::unique_ptr<Outline> outlines[block_size];
    std::unique_ptr<Sight> sights[Views::size];
    Block() {
      for (uint32_t c = 0; c < block_size; ++c) due[c] = event[c] = never;
    }
  };

  // The way of the tool in a view.
  struct Way {
    uint64_t what = 0;       // which tool and frame it is
    Vec3 centre{};           // m, when it was looked last
    double travelled = 0;    // m, rounded up
    double step = 0;         // m, the last
    double radius = 0;       // m
  };

  Block& block(uint32_t chunk) const noexcept { return *blocks_[chunk / block_size]; }
  Weights& weights(uint32_t chunk) const noexcept { return *block(chunk).weights[chunk % block_size]; }

  void set_due(uint32_t chunk) noexcept;
  void wake(uint32_t chunk) noexcept;
  void forget(uint32_t chunk) noexcept;
  void move_weights(uint32_t chunk, double now) noexcept;
  void take_wants(const Snapshot& snapshot, uint32_t number, const Chunk& chunk, double now) noexcept;
  void look_at(uint32_t number, Sight& sight, const Way& way, double radius) noexcept;

  const bool has_weights_;
  std::array<std::unique_ptr<Block>, block_count> blocks_;
  uint32_t blocks_used_ = 0;  // of the reader: as far as its snapshots go
  std::atomic<Proxies*> proxies_{nullptr};
  double omitted_ = 0;        // N
  uint64_t seen_ = 0;         // sequence of the snapshot absorbed last
  bool is_any_woken_ = false; // by take_wants
  std::array<Way, Views::size> ways_;
  uint32_t views_used_ = 1;   // bit v: view v is in use; of a tool: the first
};

template <class F>
void Memory::for_each_near(uint32_t view, double now, F&& f) const noexcept {
  for (uint32_t b = 0; b < blocks_used_; ++b) {
    const Block* const block = blocks_[b].get();
    const Sight* const sight = block ? block->sights[view].get() : nullptr;
    if (!sight) continue;
    for_each_bit(sight->any, [&](uint32_t c) {
      uint64_t rows = sight->near[c] & block->felt[c];
      if (rows == 0) return;
      const Chunk& chunk = *block->chunks[c];
      for_each_bit(has_weights_ ? 0 : rows & block->expiring[c], [&](uint32_t i) {
        if (!chunk.row(i).is_felt(now)) rows &= ~bit_of(i);
      });
      f(b * block_size + c, chunk, rows, has_weights_ ? block->weights[c]->rows.data() : nullptr);
    });
  }
}

}  // namespace fs
