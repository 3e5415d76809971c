#include "field/memory.h"

#include <cassert>
#include <cmath>

#include "field/lanes.h"
#include "field/proxies.h"

namespace fs {
namespace {

// In four strands, of which none waits for the others.
double least_of(const double (&values)[64]) noexcept {
  double least[4] = {values[0], values[1], values[2], values[3]};
  for (int i = 4; i < 64; i += 4) {
    for (int k = 0; k < 4; ++k) least[k] = std::min(least[k], values[i + k]);
  }
  return std::min(std::min(least[0], least[1]), std::min(least[2], least[3]));
}

}  // namespace

// ------------------------------------------------------------------------------------------------------ for the scene

Memory::~Memory() { delete proxies(); }

void Memory::make_proxies() {
  // All zeros first, so that its pages are there before a tick needs them.
  if (!proxies()) proxies_.store(new Proxies(), std::memory_order_release);
}

void Memory::make_room(uint32_t row) {
  const uint32_t chunk = row / chunk_size, b = chunk / block_size, c = chunk % block_size;
  assert(b < blocks_.size());
  if (!blocks_[b]) {
    auto made = std::make_unique<Block>();
    for (uint32_t v = 0; v < (has_weights_ ? Views::size : 1); ++v) made->sights[v] = std::make_unique<Sight>();
    blocks_[b] = std::move(made);
  }
  if (!blocks_[b]->outlines[c]) blocks_[b]->outlines[c] = std::make_unique<Outline>();
  if (has_weights_ && !blocks_[b]->weights[c]) blocks_[b]->weights[c] = std::make_unique<Weights>();
}

double Memory::weight_at(uint32_t row, uint64_t version, double now) const noexcept {
  const Weights& all = weights(row / chunk_size);
  const uint32_t i = row % chunk_size;
  for (int tries = 0;; ++tries) {
    const double since = all.since.load(std::memory_order_acquire);
    const bool is_moving = all.moving.load(std::memory_order_acquire) & bit_of(i);
    const Course course{(all.going_in.load(std::memory_order_acquire) & bit_of(i)) != 0,
                        (all.handing_over.load(std::memory_order_acquire) & bit_of(i)) != 0, all.rows[i].passing()};
    const bool has_begun = all.rows[i].has_begun(version);
    const double value = all.rows[i].value();
    double coming = all.rows[i].coming();
    if (tries < 100 && all.since.load(std::memory_order_acquire) != since) continue;  // the tick came by
    if (!has_begun) return 0;
    return is_moving && now > since ? course.after(now - since, value, coming, spread) : value;
  }
}

// ----------------------------------------------------------------------------------------------------- for the reader

// The weights of a chunk that can be felt are moved at every tick, those of others when one of them arrives or expires.
void Memory::set_due(uint32_t number) noexcept {
  Block& b = block(number);
  const uint32_t c = number % block_size;
  bool is_near = false;
  for_each_bit(views_used_, [&](uint32_t view) { is_near |= b.sights[view]->near[c] != 0; });
  b.due[c] = is_near && b.weights[c]->moving.load(std::memory_order_relaxed) ? -never : b.event[c];
  b.due_least = std::min(b.due_least, b.due[c]);
}

void Memory::wake(uint32_t number) noexcept {
  Block& b = block(number);
  b.due[number % block_size] = b.event[number % block_size] = b.due_least = -never;
  is_any_woken_ = true;
}

void Memory::forget(uint32_t number) noexcept {
  if (!blocks_[number / block_size]) return;
  Block& b = block(number);
  const uint32_t c = number % block_size;
  b.chunks[c] = nullptr;
  b.felt[c] = 0;
  b.due[c] = b.event[c] = never;
  if (b.weights[c]) b.weights[c]->moving.store(0, std::memory_order_relaxed);
  for_each_bit(views_used_, [&](uint32_t view) { b.sights[view]->forget(c); });
}

void Memory::move_weights(uint32_t number, double now) noexcept {
  Weights& all = weights(number);
  uint64_t moving = all.moving.load(std::memory_order_relaxed);
  if (moving == 0) return all.since.store(now, std::memory_order_release);
  uint64_t& felt = block(number).felt[number % block_size];
  const uint64_t going_in = all.going_in.load(std::memory_order_relaxed);
  const uint64_t handing_over = all.handing_over.load(std::memory_order_relaxed);
  const double elapsed = now - all.since.load(std::memory_order_relaxed);
  for_each_bit(moving, [&](uint32_t i) {
    const Course course{(going_in & bit_of(i)) != 0, (handing_over & bit_of(i)) != 0, all.rows[i].passing()};
    double coming = all.rows[i].coming();
    const double value = course.after(elapsed, all.rows[i].value(), coming, spread);
    all.rows[i].set(value);
    all.rows[i].set_coming(coming);
    if (value == (course.in ? 1.0 : 0.0) && !(coming > 0)) moving &= ~bit_of(i);
    felt = value > 0 ? felt | bit_of(i) : felt & ~bit_of(i);
  });
  all.since.store(now, std::memory_order_release);
  all.moving.store(moving, std::memory_order_release);
}

void Memory::take_wants(const Snapshot& snapshot, uint32_t number, const Chunk& chunk, double now) noexcept {
  Weights& all = weights(number);
  Block& b = block(number);
  uint64_t moving = 0, going_in = 0, handing_over = 0, felt = 0;
  double event = never;
  bool is_own_row_beginning = false;
  for_each_bit(chunk.used, [&](uint32_t i) {
    const Row& row = chunk.row(i);
    Weight& weight = all.rows[i];
    if (!weight.has_begun(row.version)) return;
    Weight* next = nullptr;
    const Want* its = nullptr;
    if (row.next != no_row) {
      next = &this->weight(row.next);
      its = &find_chunk(snapshot.chunks, row.next)->row(row.next % chunk_size);
    }
    bool began = false;
    const Course course = course_of(row, weight, now, next, its, !(spread.fade > 0), began);
    if (began && row.next / chunk_size == number) is_own_row_beginning = true;
    if (began) wake(row.next / chunk_size);
    const double coming = weight.coming();
    if (!(spread.fade > 0) && !course.hands_over && !(coming > 0)) weight.set(course.in);
    const double value = weight.value();
    if (course.in) going_in |= bit_of(i);
    if (course.hands_over) handing_over |= bit_of(i);
    if (value > 0) felt |= bit_of(i);
    if (value != (course.in ? 1.0 : 0.0) || coming > 0) {
      moving |= bit_of(i);
      event = std::min(event, now + course.rest(value, coming, spread));
    }
    if (course.in) event = std::min(event, row.expiry);
  });
  b.felt[number % block_size] = felt;
  b.event[number % block_size] = is_own_row_beginning ? -never : event;
  all.going_in.store(going_in, std::memory_order_release);
  all.handing_over.store(handing_over, std::memory_order_release);
  all.moving.store(moving, std::memory_order_release);
}

void Memory::begin_tick(double now) noexcept {
  if (Proxies* const all = proxies()) all->begin(now, static_cast<uint32_t>(std::popcount(views_used_)));
}

void Memory::absorb(const Snapshot& snapshot, double now) noexcept {
  // What is remembered of a view that is not in use may be out of date: look() begins anew when it is used again.
  if (has_weights_) {
    views_used_ = 0;
    for (uint32_t view = 0; view < Views::size; ++view) {
      if (snapshot.views->rows[view].version != 0) views_used_ |= 1u << view;
    }
  }
  snapshot.chunks.for_each_changed(seen_, [&](uint32_t number, const Chunk* chunk) {
    if (!chunk) return forget(number);
    Block& b = block(number);
    const uint32_t c = number % block_size;
    b.chunks[c] = chunk;
    blocks_used_ = std::max(blocks_used_, number / block_size + 1);
    const bool is_only_moved = chunk->rows_sequence <= seen_;
    if (has_weights_ && !is_only_moved) {
      move_weights(number, now);  // by the old wants, before the new ones are read
      take_wants(snapshot, number, *chunk, now);
      set_due(number);
    } else if (!is_only_moved) {
      b.felt[c] = b.expiring[c] = 0;
      for_each_bit(chunk->used, [&](uint32_t i) {
        const Row& row = chunk->row(i);
        if (row.is_in && row.next == no_row) b.felt[c] |= bit_of(i);
        if (row.expiry < never) b.expiring[c] |= bit_of(i);
      });
    }
    b.is_outlined[c] = false;
    for_each_bit(views_used_, [&](uint32_t view) { b.sights[view]->wake_at[c] = b.sights[view]->wake_least = -never; });
  });
  seen_ = snapshot.sequence;
  omitted_ = snapshot.omitted;
}

void Memory::advance(const Snapshot& snapshot, double now) noexcept {
  views.advance(*snapshot.views, now, spread.fade);
  do {
    is_any_woken_ = false;  // a row that begins may stand in a chunk that was looked at before
    for (uint32_t n = 0; n < blocks_used_; ++n) {
      Block* const b = blocks_[n].get();
      if (!b || b->due_least > now) continue;
      for (uint32_t c = 0; c < block_size; ++c) {
        if (b->due[c] > now) continue;
        const uint32_t number = n * block_size + c;
        move_weights(number, now);
        if (b->event[c] <= now) take_wants(snapshot, number, *b->chunks[c], now);
        set_due(number);
      }
      b->due_least = least_of(b->due);
    }
  } while (is_any_woken_);
}

double Memory::newer_weight(const Row& row, double now) const noexcept {
  double out = 0;
  for (uint32_t number = row.newer; number != no_row;) {
    const Row& its = block(number / chunk_size).chunks[number / chunk_size % block_size]->row(number % chunk_size);
    out += weight_at(number, its.version, now);
    number = its.newer;
  }
  return out;
}

void Memory::look(uint32_t i, uint64_t what, Vec3 centre, double radius, double now) noexcept {
  Way& way = ways_[i];
  way.step = norm(centre - way.centre);
  way.centre = centre;
  // Rounded up, so that no chunk sleeps too long.
  way.travelled += way.step * (1 + 1e-14) + 1e-15 * (way.travelled + largest_coordinate(centre));
  way.travelled += std::max(radius - way.radius, 0.0) * (1 + 1e-14);  // to reach farther is to come nearer
  way.radius = radius;
  if (way.what != what || !std::isfinite(way.travelled)) {
    way.what = what;
    way.travelled = way.step = 0;
    for (uint32_t b = 0; b < blocks_used_; ++b) {
      Sight* const sight = blocks_[b] ? blocks_[b]->sights[i].get() : nullptr;
      if (!sight) continue;
      std::fill_n(sight->wake_at, block_size, -never);
      sight->wake_least = -never;
    }
  }
  for (uint32_t n = 0; n < blocks_used_; ++n) {
    Block* const b = blocks_[n].get();
    if (!b || b->sights[i]->wake_least > way.travelled) continue;
    Sight& sight = *b->sights[i];
    const auto [awake, wakes_next] = find_awake(sight.wake_at, way.travelled);
    sight.wake_least = wakes_next;
    for_each_bit(awake, [&](uint32_t c) {
      if (!b->chunks[c]) return sight.forget(c);
      const uint32_t number = n * block_size + c;
      look_at(number, sight, way, radius);
      sight.wake_least = std::min(sight.wake_least, sight.wake_at[c]);
      const bool is_moving = has_weights_ && b->weights[c]->moving.load(std::memory_order_relaxed) != 0;
      if (is_moving && sight.near[c] && b->due[c] > now) {  // it has slept: its weights are those of some time ago
        move_weights(number, now);
        set_due(number);
      }
    });
  }
}

void Memory::look_at(uint32_t number, Sight& sight, const Way& way, double radius) noexcept {
  Block& b = block(number);
  const uint32_t c = number % block_size;
  if (!b.is_outlined[c]) {  // the chunk has changed: while its whole box is far, the outline is not needed
    const Chunk& chunk = *b.chunks[c];
    const double gap = chunk.planes ? 0 : chunk.box.distance(way.centre) * (1 - 1e-14) - radius;
    if (gap > 4 * way.step) {
      sight.near[c] = 0;
      sight.any &= ~bit_of(c);
      sight.wake_at[c] = way.travelled + gap;
      return;
    }
    b.outlines[c]->take(chunk);
    b.planes[c] = chunk.planes;
    b.is_outlined[c] = true;
  }
  Gaps gaps;
  find_gaps(*b.outlines[c], way.centre, gaps);
  for_each_bit(b.planes[c], [&](uint32_t i) {
    const Chunk& chunk = *b.chunks[c];
    const Motion& plane = chunk.motion(i);
    const Vec3 offset = way.centre - plane.pose.position;
    const double distance = std::fabs(dot(rotate(plane.pose.orientation, {0, 0, 1}), offset)), turn = plane.most_turn();
    const double nearest = distance - turn * norm(offset) - plane.most_offset();  // while it is blended
    const double support = chunk.row(i).object->support(chunk.rows->omitted);
    const double gap = (nearest - support - 1e-14 * norm(offset)) / (1 + turn);
    gaps[i] = static_cast<float>(gap - 1e-7 * std::fabs(gap));
  });
  const auto margin = static_cast<float>(radius * (1 + 2e-7));
  // Rows that the tool reaches within 4 ticks count as near if there are at most 4; otherwise the chunk would wake at almost
  // every tick.
  const auto soon = static_cast<float>(margin + 4 * way.step);
  auto [near, least] = rows_within(gaps, margin);
  if (least <= soon) {
    const auto [near_soon, least_later] = rows_within(gaps, soon);
    if (std::popcount(near_soon ^ near) <= 4) {
      near = near_soon;
      least = least_later;
    }
  }
  double sleeps = static_cast<double>(least) - margin;  // m
  if (near && way.step > 0) sleeps = std::min(sleeps, 64 * way.step);  // to notice that near rows have become far
  sight.near[c] = near;
  sight.any = near ? sight.any | bit_of(c) : sight.any & ~bit_of(c);
  sight.wake_at[c] = way.travelled + sleeps;
}

}  // namespace fs
