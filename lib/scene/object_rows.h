// The rows of objects that a scene posts: which versions of a name there are (versions.h), and when a row is free again.
// Every call needs the scene's lock. The newest row of a chain has the name.
#pragma once

#include <algorithm>
#include <vector>

#include "scene/clock.h"
#include "scene/row_space.h"
#include "scene/versions.h"

namespace fs {

// How fast bounds become what is due. What is less than now is entered at once. What is more is entered in steps where the
// hand is near: a hand that leans on a wall would feel all at once as a push.
struct Pace {
  static constexpr double exact = 1 - 1e-9;
  double least = exact;   // bounds of at least this part of what is due stay, so that small changes make no new versions
  double growth = never;  // in one step a bound becomes this many times as much at most, or a hundredth of what is due if that
                          // is more; 0: bounds only become less
};

// An object as an application has set it.
struct Entry {
  Ref<const Object> object;
  Motion motion;
  double start = 0;             // s, t = 0 of f(d, t)
  double expiry = never;        // s, scene time: goes out from then on unless set, changed or moved
  uint64_t revision = 0, motion_revision = 0;  // of the last change but moves; of the last change or move
};

class ObjectRows : Versions<ObjectRows> {
 public:
  ObjectRows(const ServoOutput& output, const Clock& clock) : output_(output), clock_(clock) {}

  const Chunks& chunks() const noexcept { return chunks_; }
  const Row& row(uint32_t row) const noexcept { return find_chunk(chunks_, row)->row(row % chunk_size); }
  const Motion& motion(uint32_t row) const noexcept { return find_chunk(chunks_, row)->motion(row % chunk_size); }
  uint64_t motion_revision(uint32_t row) const noexcept { return find_chunk(chunks_, row)->motion_revision(row % chunk_size); }
  Entry entry(uint32_t row) const;

  // What is posted next has this number.
  void set_next_sequence(uint64_t sequence) noexcept { sequence_ = sequence; }

  // The rows of a name, of which the newest is given; it may be another from then on, which is returned. When one of them
  // throws (no memory), what is felt is as before.
  uint32_t add(const Entry& entry);                    // a name that has no row
  uint32_t set(uint32_t newest, const Entry& entry);   // to another version if need be
  void move(uint32_t newest, const Motion& motion, double expiry, uint64_t motion_revision);  // no jump
  uint32_t remove(uint32_t newest);                    // no_row: nothing is left of it
  // Lets go of what has faded out; no_row: of all of it. has_changed: set if something is to be posted.
  uint32_t tidy(uint32_t newest, bool& has_changed);
  // Whether something fades out behind the newest row, or the newest row itself.
  bool is_fading(uint32_t newest) const noexcept { return row(newest).previous != no_row || !row(newest).is_named; }

  // The bounds of objects for which none have been worked out yet; bound() sets those of the others.
  void set_bounds(const Bounds& bounds) noexcept { bounds_ = bounds; }
  // Whether the row is of this object and has these bounds, or less: `least` times as much at least.
  bool is_bound(uint32_t row, const Object& object, const Bounds& bounds, double least) const;
  // Evaluates the object within these bounds. (It may have changed since they were worked out.) Where the hand may be near,
  // the force goes over to the new one within a blend. is_rising: set if more is due. Returns the newest row from then on.
  uint32_t bound(uint32_t newest, const Bounds& bounds, const Pace& pace, bool& is_rising);

  // The error that evaluation may make, N. It is divided among the objects whose force fades out without end: where one
  // of them gives less than its part, it counts as far.
  void set_accuracy(double newtons);
  double omitted() const noexcept { return std::min(accuracy_, tails_ * tail_); }  // N, by all of them at most

  // Whether a servo feels the row so far from where it is to be that it must be set, as another version: it cannot be moved
  // through the hand.
  bool is_jump(uint32_t row, const Motion& to) const noexcept { return is_jump(row, to, clock_.now()); }
  // Where the hand is in the scene. scale: m of the scene for each of the device. arm: m of the scene, how far the tool
  // reaches from it; infinite: it may be anywhere.
  void set_hand(double scale, double arm) noexcept {
    scale_ = scale;
    arm_ = arm;
  }
  // To be called before the rows are posted: what has been moved since the last time is blended from now on.
  void begin_offsets() noexcept;

  // Called for one row after the other before all of them change, so that their chunks lie together in memory: a reader
  // that looks at all of them is faster then.
  void own_chunk(uint32_t row) { chunks_.edit(row / chunk_size, sequence_); }

  // Objects that are added in the order of this number lie together best.
  uint64_t place_of(const Entry& entry) noexcept {
    return space_.place_of(entry.motion.pose.position, entry.object->radius + entry.object->support());
  }

  // Readers. starts_in: a servo's first snapshot is felt in full at once.
  void attach(Reader& reader);
  void start_servo(Reader& reader, bool starts_in, double now) noexcept;  // it is attached; no snapshot was posted since
  void detach(Reader& reader) noexcept;
  const std::vector<Reader*>& readers() const noexcept { return readers_; }
  uint64_t used() const noexcept { return output_.used.load(std::memory_order_acquire); }  // sequence

  // A copy of the table with all times shifted, s, to be swapped in by take. Rows that are wanted out and nameless are
  // left out: of a servo that is no more, nothing fades.
  struct TimeShift {
    Chunks chunks;
    std::vector<uint32_t> dropped;
  };
  TimeShift shifted(double shift) const;
  void take(TimeShift& shifted) noexcept;

 private:
  friend Versions<ObjectRows>;
  uint64_t sequence() const noexcept { return sequence_; }
  Weight* weight(uint32_t row) const noexcept { return servo_ ? &servo_->memory->weight(row) : nullptr; }

  // What may throw comes first: these make the chunk of a row and what is changed in it the table's own.
  Chunk& own(uint32_t row, const Object* bounded = nullptr);  // bounded: what it will be set with
  void own_motion(uint32_t row);
  void own_offsets(size_t count);  // of rows that are going to be moved
  uint32_t allocate(const Entry& entry);
  using New = std::vector<Ref<Scratch>>;  // of each reader; empty: what is there goes on
  New make_new(uint32_t row, const Object& object, const Object* before);

  Chunk& chunk(uint32_t row) noexcept { return chunks_.edit(row / chunk_size, sequence_); }
  Row& edit(uint32_t row) noexcept { return chunk(row).edit_row(row % chunk_size); }
  // As the servo is to evaluate the object; null: as it is. before: the row that it replaces; null: none.
  Ref<const Object> bounded_for(const Entry& entry, const Row* before) const;
  void fill(Chunk& its, uint32_t row, const Entry& entry, const Ref<const Object>& bounded, const Motion& motion,
            uint64_t version, uint32_t previous) noexcept;
  void install(uint32_t row, New& made) noexcept;
  void drop(uint32_t row) noexcept;
  void make_room_for_tail(const Object& object);
  void divide_accuracy(uint32_t tails);
  // What a row needs to be as wanted.
  enum class Change { adjusted, taken_over, replaced };  // the same version; another, by Want::takes_over; another, by a fade
  Change change_of(uint32_t row, const Entry& to, double now) const noexcept;
  bool is_jump(uint32_t row, const Motion& to, double now) const noexcept;
  bool may_be_felt(uint32_t row) const noexcept;  // before the next snapshot is in use
  // The newest row from then on. bounded: null: as it is.
  uint32_t put(uint32_t newest, const Entry& entry, Change change, const Ref<const Object>& bounded);
  bool is_replaceable(uint32_t newest, Change change) noexcept;
  bool replace(uint32_t newest, const Entry& entry, Change change, const Ref<const Object>& bounded);
  void update_older(uint32_t number, const Entry& entry) noexcept;
  uint32_t append(uint32_t newest, const Entry& entry, Change change, const Ref<const Object>& bounded);
  Spread spread() const noexcept { return servo_ ? servo_->memory->spread : Spread{}; }
  // A motion that goes on from where a row is felt.
  Motion going_on(uint32_t row, const Motion& to, double now) const noexcept;
  void note_offset(uint32_t row) noexcept;  // of a row that has just been moved; after own_offsets
  static constexpr uint32_t longest_chain = 16;
  uint32_t length(uint32_t newest) const noexcept;  // of the chain

  const ServoOutput& output_;
  const Clock& clock_;
  Chunks chunks_;
  uint64_t sequence_ = 1, last_version_ = 0;
  RowSpace space_;
  double accuracy_ = 0;  // N
  double tail_ = 0;      // N, the part of one object,
  uint32_t tails_ = 0;   // and how many there are
  std::vector<Reader*> readers_;
  Reader* servo_ = nullptr;
  Bounds bounds_;
  double scale_ = 1, arm_ = never;
  std::vector<uint32_t> moved_;  // rows whose offsets are to begin when they are posted
};

}  // namespace fs
