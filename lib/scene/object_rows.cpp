#include "scene/object_rows.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <functional>

#include "base/error.h"
#include "base/serial.h"

namespace fs {

static Motion unblended(Motion motion) noexcept {
  motion.offset = {};
  return motion;
}

Entry ObjectRows::entry(uint32_t number) const {
  const Row& from = row(number);
  Entry out{nullptr, motion(number), from.start, from.expiry, from.revision, motion_revision(number)};
  out.object = from.object;  // last, because counting a reference waits until all reads before it are done
  return out;
}

// ------------------------------------------------------------------------------------------------------- what may throw

Chunk& ObjectRows::own(uint32_t row, const Object* bounded) {
  Chunk& its = chunks_.edit(row / chunk_size, sequence_);
  its.own(row % chunk_size);
  if (bounded) its.own_caps();
  return its;
}

// known: the bounds that an object has; where it has none, those of an object alone.
static Bounds joined(const Bounds& known, const Bounds& alone) noexcept {
  const auto one = [](double has, double else_has) { return has < no_bound ? has : else_has; };
  return {one(known.slope, alone.slope), one(known.stiffness, alone.stiffness), one(known.damping, alone.damping),
          one(known.contact_damping, alone.contact_damping)};
}

Ref<const Object> ObjectRows::bounded_for(const Entry& entry, const Row* before) const {
  if (!servo_) return nullptr;
  return fs::bounded(*entry.object, before && before->bounded ? joined(before->bounded->bounds, bounds_) : bounds_);
}

// Whether bounds can stay: they are at least this part of what is wanted, and no more.
static bool serve_as(const Bounds& present, const Bounds& wanted, double least) noexcept {
  const auto serves = [least](double has, double wants) {
    return has == wants || (has <= wants * (1 + 1e-9) && has >= least * wants);
  };
  return serves(present.slope, wanted.slope) && serves(present.stiffness, wanted.stiffness) &&
         serves(present.damping, wanted.damping) && serves(present.contact_damping, wanted.contact_damping);
}

bool ObjectRows::is_bound(uint32_t number, const Object& object, const Bounds& bounds, double least) const {
  const Chunk* const its = find_chunk(chunks_, number);
  if (!its || !(its->used & bit_of(number % chunk_size))) return false;
  const Row& now = its->row(number % chunk_size);
  if (now.object.get() != &object || !now.is_named) return false;
  return now.bounded ? serve_as(now.bounded->bounds, bounds, least) : !fs::bounded(object, bounds);
}

// The bounds after those of now, on the way to what is due.
static Bounds risen(const Bounds& now, const Bounds& due, double growth) noexcept {
  const auto one = [growth](double has, double is_due) {
    return std::min(is_due, growth == 0 ? has : std::max(growth * has, 0.01 * is_due));
  };
  return {one(now.slope, due.slope), one(now.stiffness, due.stiffness), one(now.damping, due.damping),
          one(now.contact_damping, due.contact_damping)};
}

uint32_t ObjectRows::bound(uint32_t newest, const Bounds& bounds, const Pace& pace, bool& is_rising) {
  assert(pace.least > 0 && pace.least <= 1 && (pace.growth >= 1 || pace.growth == 0));
  const Row& now = row(newest);
  const Object& object = *now.object;
  Bounds wanted = of_use(joined(bounds, bounds_), object);
  if (is_bound(newest, object, wanted, pace.least)) return newest;
  const bool is_near = spread().blend > 0 && may_be_felt(newest);
  if ((is_near || pace.growth == 0) && now.bounded) {
    const Bounds next = of_use(risen(now.bounded->bounds, wanted, pace.growth), object);
    is_rising = !serve_as(next, wanted, pace.least);
    wanted = next;
    if (is_bound(newest, object, wanted, Pace::exact)) return newest;
  }
  return put(newest, entry(newest), is_near ? Change::taken_over : Change::adjusted, fs::bounded(object, wanted));
}

void ObjectRows::own_motion(uint32_t row) { chunks_.edit(row / chunk_size, sequence_).own_motion(row % chunk_size); }

void ObjectRows::own_offsets(size_t count) {
  if (moved_.capacity() < moved_.size() + count) moved_.reserve(2 * moved_.size() + count);
}

// Finds a row that no tick can use, but does not reserve it: fill does. Two calls give the same row.
uint32_t ObjectRows::allocate(const Entry& entry) {
  return space_.find(entry.motion.pose.position, entry.object->radius + entry.object->support(), servo_ ? used() : sequence_);
}

// Makes room for a row in the memory of each reader, and what its object needs there.
ObjectRows::New ObjectRows::make_new(uint32_t row, const Object& object, const Object* before) {
  const bool keeps_scratch = before && before->law.front.curve == object.law.front.curve &&
                             before->law.back.curve == object.law.back.curve && before->shape == object.shape &&
                             before->primitive == object.primitive;
  New out;
  for (Reader* const reader : readers_) {
    reader->memory->make_room(row);
    if (object.is_solid()) reader->memory->make_proxies();
    if (keeps_scratch) continue;
    Ref<Scratch> scratch = Scratch::of(object);
    if (scratch || reader->scratches.get(row)) reader->scratches.own(row, sequence_);
    out.push_back(std::move(scratch));
  }
  return out;
}

void ObjectRows::set_accuracy(double newtons) {
  const double before = std::exchange(accuracy_, newtons);
  try {
    divide_accuracy(std::max(tails_, 8u));
  } catch (...) {
    accuracy_ = before;
    throw;
  }
}

void ObjectRows::make_room_for_tail(const Object& object) {
  if (object.has_tail() && (tails_ + 1) * tail_ > accuracy_) divide_accuracy(2 * (tails_ + 1));
}

// Divides the accuracy among so many objects.
void ObjectRows::divide_accuracy(uint32_t tails) {
  const double tail = accuracy_ / tails;
  if (tail == tail_) return;
  Chunks all = chunks_;
  chunks_.for_each([&](uint32_t number, const Chunk& chunk) {
    Chunk& copy = all.edit(number, sequence_);
    for_each_bit(chunk.used, [&](uint32_t i) { copy.own(i); });
    copy.omit(tail);
  });
  chunks_ = std::move(all);
  tail_ = tail;
}

// ---------------------------------------------------------------------------------------------------- what cannot throw

void ObjectRows::fill(Chunk& its, uint32_t number, const Entry& entry, const Ref<const Object>& bounded, const Motion& motion,
                      uint64_t version, uint32_t previous) noexcept {
  space_.take(number);
  if (const Object* const before = its.row(number % chunk_size).object.get()) tails_ -= before->has_tail();
  tails_ += entry.object->has_tail();
  if (its.rows->omitted != tail_) its.omit(tail_);
  Row& row = its.set(number % chunk_size, entry.object, bounded, motion, entry.motion_revision);
  if (row.version != version) row.created = sequence_;
  row.version = version;
  row.sequence = sequence_;
  row.expiry = entry.expiry;
  row.next = row.newer = no_row;
  row.previous = previous;
  row.is_in = entry.object->is_enabled;
  row.is_named = true;
  row.start = entry.start;
  row.revision = entry.revision;
}

void ObjectRows::install(uint32_t row, New& made) noexcept {
  for (size_t i = 0; i < made.size(); ++i) readers_[i]->scratches.set(row, std::move(made[i]), sequence_);
}

void ObjectRows::drop(uint32_t number) noexcept {
  Chunk& its = chunk(number);
  tails_ -= its.row(number % chunk_size).object->has_tail();
  its.drop(number % chunk_size);
  if (its.used == 0) chunks_.set(number / chunk_size, nullptr, sequence_);
  space_.release(number, sequence_);
  for (Reader* const reader : readers_) {
    try {
      reader->scratches.set(number, nullptr, sequence_);
    } catch (...) {  // no memory: it goes when the row is used again
    }
  }
}

// ------------------------------------------------------------------------------------------------- what is felt of a change

bool ObjectRows::is_jump(uint32_t number, const Motion& to, double now) const noexcept {
  const Spread by = spread();
  const Motion& felt = motion(number);
  if (!(by.blend > 0) || to.says_the_same(felt)) return false;
  // A turn moves what is far from the origin: as far as the object, or the hand if that is nearer.
  double lever = row(number).object->radius;
  HandSample hand;
  if (lever > 0 && output_.hand.read(hand)) {
    lever = std::min(lever, norm(hand.state.pose.position - felt.position_at(now, by.blend)));
  }
  return to.jump_from(felt, now, by.blend, lever) > scale_ * by.jump;
}

bool ObjectRows::may_be_felt(uint32_t number) const noexcept {
  HandSample hand;
  if (output_.tick.load(std::memory_order_acquire) == 0) return false;  // the servo has not ticked yet
  if (!output_.hand.read(hand)) return true;
  const Object& object = *row(number).object;
  const double far = object.radius + object.support() + arm_ + scale_ * 0.1;  // m; the hand takes 50 ms for 0.1 m at 2 m/s
  return !(norm(hand.state.pose.position - motion(number).position_at(clock_.now(), spread().blend)) > far);
}

ObjectRows::Change ObjectRows::change_of(uint32_t number, const Entry& to, double now) const noexcept {
  const Row& felt = row(number);
  if (!felt.object->is_same_version(*to.object) || is_jump(number, to.motion, now)) return Change::replaced;
  const bool is_alike = !(spread().blend > 0) || felt.object->feels_like(*to.object);
  const bool has_same_time = felt.start == to.start || !to.object->law.has_curves() || !(spread().blend > 0);
  return is_alike && has_same_time ? Change::adjusted : Change::taken_over;
}

Motion ObjectRows::going_on(uint32_t number, const Motion& to, double now) const noexcept {
  Motion out = to;
  out.offset = {};
  if (const double blend = spread().blend; blend > 0) out.go_on_from(motion(number), now, blend);
  return out;
}

void ObjectRows::note_offset(uint32_t number) noexcept {
  if (find_chunk(chunks_, number)->blended & bit_of(number % chunk_size)) moved_.push_back(number);
}

void ObjectRows::begin_offsets() noexcept {
  const double now = clock_.now(), blend = spread().blend;
  for (const uint32_t number : moved_) {
    const Chunk* const its = find_chunk(chunks_, number);
    const bool is_there = its && its->sequence == sequence_ && its->used & bit_of(number % chunk_size);
    if (is_there && blend > 0) chunk(number).begin_offset(number % chunk_size, now, blend);
  }
  moved_.clear();
}

// ------------------------------------------------------------------------------------------------------- rows of a name

uint32_t ObjectRows::add(const Entry& entry) {
  make_room_for_tail(*entry.object);
  const uint32_t number = allocate(entry);
  Ref<const Object> bounded = bounded_for(entry, nullptr);
  New made = make_new(number, *entry.object, nullptr);  // first: a reader must have room for what is in the table
  Chunk& its = own(number, bounded.get());
  const uint64_t version = ++last_version_;
  install(number, made);
  if (servo_) servo_->memory->weight(number).set_up(version, false, 0);
  fill(its, number, entry, bounded, unblended(entry.motion), version, no_row);
  return number;
}

uint32_t ObjectRows::set(uint32_t newest, const Entry& entry) {
  make_room_for_tail(*entry.object);
  return put(newest, entry, change_of(newest, entry, clock_.now()), bounded_for(entry, &row(newest)));
}

uint32_t ObjectRows::put(uint32_t newest, const Entry& entry, Change change, const Ref<const Object>& bounded) {
  for (;;) {
    if (servo_) tidy_older(newest);
    own_offsets(1);
    if (!is_replaceable(newest, change)) return append(newest, entry, change, bounded);
    if (replace(newest, entry, change, bounded)) return newest;
  }
}

// Whether the newest row can be changed itself. One that waits can, as long as no tick can know it. One that was posted belongs
// to a group that is felt as a whole, so a new one comes after it, unless it takes over the weight of the one before
// (taken_over replaces such a one even where a tick knows it, as long as it has not begun). When the
// chain becomes long, because many come between two ticks, what was posted is taken back if no tick has it yet.
bool ObjectRows::is_replaceable(uint32_t newest, Change change) noexcept {
  if (change == Change::adjusted || !servo_) return true;
  if (!is_waiting(newest)) return false;
  const uint64_t created = row(newest).created;
  return change == Change::taken_over || created == sequence_ || (length(newest) >= longest_chain && servo_->take_back(created));
}

// False: it was waiting, and has begun meanwhile.
bool ObjectRows::replace(uint32_t newest, const Entry& entry, Change change, const Ref<const Object>& bounded) {
  const double now = clock_.now();
  const uint32_t previous = row(newest).previous;
  New made = make_new(newest, *entry.object, row(newest).object.get());
  for (uint32_t older = newest; is_waiting(older); older = row(older).previous) own(row(older).previous);
  Chunk& its = own(newest, bounded.get());
  uint64_t version = row(newest).version;
  const bool is_same = change == Change::adjusted, is_elsewhere = change == Change::replaced;
  if (!is_same) {
    const uint64_t before = std::exchange(version, ++last_version_);
    if (servo_ && !servo_->memory->weight(newest).replace_waiting(before, version)) return false;
  }
  install(newest, made);
  const bool was_in = row(newest).is_in;
  const uint64_t sequence = row(newest).sequence;
  const bool is_moved = !entry.motion.says_the_same(motion(newest));
  fill(its, newest, entry, bounded, is_elsewhere ? unblended(entry.motion) : going_on(newest, entry.motion, now), version,
       previous);
  if (is_moved) note_offset(newest);
  if (is_elsewhere) edit(newest).takes_over = 0;
  if (is_same && was_in == entry.object->is_enabled) edit(newest).sequence = sequence;
  if (is_waiting(newest)) update_older(row(newest).previous, entry);
  return true;
}

// This row and those before it, back to the one that has begun, are felt until the newest begins: they are disabled with it, and
// live as long. All of them are owned.
void ObjectRows::update_older(uint32_t number, const Entry& entry) noexcept {
  for (;; number = row(number).previous) {
    if (!entry.object->is_enabled) want_out(number);
    if (row(number).is_in) edit(number).expiry = entry.expiry;
    if (!is_waiting(number)) return;
  }
}

// Another version of what is felt. A row that is already fading out alone need not be waited for, unless its weight is taken
// over.
uint32_t ObjectRows::append(uint32_t newest, const Entry& entry, Change change, const Ref<const Object>& bounded) {
  const double now = clock_.now();
  const bool takes_over = change == Change::taken_over;
  const bool waits = takes_over || row(newest).is_in || row(newest).previous != no_row;
  const uint32_t number = allocate(entry);
  New made = make_new(number, *entry.object, nullptr);
  Chunk& its = own(number, bounded.get());
  own(newest);
  for (uint32_t older = newest; is_waiting(older); older = row(older).previous) own(row(older).previous);
  const uint64_t version = ++last_version_;
  install(number, made);
  servo_->memory->weight(number).set_up(version, waits, 0);
  fill(its, number, entry, bounded, takes_over ? going_on(newest, entry.motion, now) : unblended(entry.motion), version, newest);
  if (!entry.motion.says_the_same(motion(newest))) note_offset(number);
  if (takes_over) edit(number).takes_over = row(newest).version;
  edit(newest).is_named = false;
  edit(newest).newer = number;
  if (waits) edit(newest).next = number;
  update_older(newest, entry);
  return number;
}

uint32_t ObjectRows::length(uint32_t newest) const noexcept {
  uint32_t count = 0;
  for (uint32_t number = newest; number != no_row; number = row(number).previous) ++count;
  return count;
}

void ObjectRows::move(uint32_t newest, const Motion& to, double expiry, uint64_t motion_revision) {
  const double now = clock_.now();
  const auto own_moved = [&](uint32_t number) {
    if (row(number).expiry == expiry) {
      own_motion(number);
    } else {
      own(number);
    }
  };
  const auto move_one = [&](uint32_t number) {
    // A version before the newest may be elsewhere: it fades where it is.
    if (number == newest || !is_jump(number, to, now)) {
      const bool is_moved = !to.says_the_same(motion(number));
      chunk(number).move(number % chunk_size, going_on(number, to, now), motion_revision);
      if (is_moved) note_offset(number);
    }
    if (row(number).expiry != expiry && (number == newest || row(number).is_in)) edit(number).expiry = expiry;
  };
  // Where the newest waits, the versions before it, back to the one that has begun, are the object still.
  own_offsets(length(newest));
  own_moved(newest);
  for (uint32_t number = newest; is_waiting(number); number = row(number).previous) own_moved(row(number).previous);
  move_one(newest);
  for (uint32_t number = newest; is_waiting(number); number = row(number).previous) move_one(row(number).previous);
}

uint32_t ObjectRows::remove(uint32_t newest) {
  for (uint32_t number = newest; number != no_row; number = row(number).previous) own(number);
  for (uint32_t number = newest; number != no_row; number = row(number).previous) want_out(number);
  edit(newest).is_named = false;
  if (servo_) return newest;
  drop(newest);
  return no_row;
}

uint32_t ObjectRows::tidy(uint32_t newest, bool& has_changed) {
  has_changed |= tidy_older(newest);
  if (row(newest).is_named || row(newest).previous != no_row || !is_gone(newest)) return newest;
  own(newest);
  drop(newest);
  has_changed = true;
  return no_row;
}

// -------------------------------------------------------------------------------------------------------------- readers

void ObjectRows::attach(Reader& reader) {
  readers_.reserve(readers_.size() + 1);
  for (uint32_t chunk = 0; chunk < space_.chunks_end(); ++chunk) reader.memory->make_room(chunk * chunk_size);
  chunks_.for_each([&](uint32_t number, const Chunk& chunk) {
    for_each_bit(chunk.used, [&](uint32_t i) {
      const Object& object = *chunk.row(i).object;
      if (object.is_solid()) reader.memory->make_proxies();
      if (Scratch::is_needed(object)) reader.scratches.set(number * chunk_size + i, Scratch::of(object), sequence_);
    });
  });
  readers_.push_back(&reader);
}

void ObjectRows::start_servo(Reader& reader, bool starts_in, double now) noexcept {
  chunks_.for_each([&](uint32_t number, const Chunk& chunk) {
    for_each_bit(chunk.used, [&](uint32_t i) {
      const Row& row = chunk.row(i);
      reader.memory->weight(number * chunk_size + i).set_up(row.version, false, starts_in && row.is_felt(now) ? 1 : 0);
    });
  });
  servo_ = &reader;
}

void ObjectRows::detach(Reader& reader) noexcept {
  std::erase(readers_, &reader);
  if (servo_ == &reader) {
    servo_ = nullptr;
    bounds_ = {};
  }
  reader.mailbox.clear();
  reader.scratches = {};
}

ObjectRows::TimeShift ObjectRows::shifted(double shift) const {
  TimeShift out{chunks_, {}};
  chunks_.for_each([&](uint32_t number, const Chunk& chunk) {
    for_each_bit(chunk.used, [&](uint32_t i) {
      const Row& before = chunk.row(i);
      if (!before.is_named) out.dropped.push_back(number * chunk_size + i);
      const bool is_blended = chunk.blended & bit_of(i);
      if (before.is_named && shift == 0 && before.previous == no_row && !before.bounded && !is_blended) return;
      Chunk& copy = out.chunks.edit(number, sequence_);
      copy.own(i);
      Row& row = copy.edit_row(i);
      row.previous = row.newer = row.next = no_row;
      row.takes_over = 0;
      row.start += shift;
      row.expiry += shift;
      if (row.bounded) {  // by a servo that is no more
        const Ref<const Object> object = row.object;
        copy.set(i, object, nullptr, chunk.motion(i), chunk.motion_revision(i));
      }
      if (shift == 0 && !is_blended) return;
      Motion motion = unblended(chunk.motion(i));
      motion.time += shift;
      copy.move(i, motion, shift == 0 ? chunk.motion_revision(i) : next_serial());
    });
  });
  return out;
}

void ObjectRows::take(TimeShift& shifted) noexcept {
  std::swap(chunks_, shifted.chunks);
  for (const uint32_t number : shifted.dropped) drop(number);
}

}  // namespace fs
