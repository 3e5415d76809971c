// The immutable form of a scene that a reader (the servo, a tool) evaluates. Everything in it is data.
#pragma once

#include <array>
#include <vector>

#include <forceserver/evaluate.h>

#include "base/counted.h"
#include "base/seqlock.h"
#include "scene/fade.h"
#include "scene/mailbox.h"
#include "scene/motion.h"
#include "scene/object.h"
#include "scene/table.h"

namespace fs {

// What a servo last made of an object: written by its tick, read by reports.
struct FeltSample {
  uint64_t tick = 0;
  double distance = 0;  // m
  Vec3 point{};         // p, scene frame
  Wrench wrench{};      // its share, scene frame, before the guard
};
struct Felt : Counted<Felt> {
  mutable Latest<FeltSample> sample;
};

// One force-object in the table: what it is, where it is, how far it has faded.
struct Entry : LocalCounted<Entry> {
  Ref<const Object> object;
  Motion motion;
  double start = 0;           // s, t = 0 of f(d, t)
  Track track;                // for the next worked-out twist
  Fade fade = Fade::steady(true);
  Ref<const Entry> previous;  // the version felt before, fading out where it was
  Ref<Felt> felt;
  uint64_t revision = 0, motion_revision = 0;  // of the last change but moves; of the last change or move
  double expiry = never;        // s, scene time: goes out from then on unless set, changed or moved
  double tidy_at = never;       // s: when what has been fading out may be gone
  bool start_is_given = false;  // by the caller; else it is when the name was first set
  bool is_removed = false;      // nameless, until its weight is 0

  // Without a servo nothing fades: what is there is felt in full.
  bool is_present(double now) const noexcept { return fade.is_going_in() && !is_removed && now < expiry; }
};

// Where the tool stands: the frame between scene and device, and the points of the tool.
struct View : Counted<View> {
  enum class Kind : uint8_t {
    free,    // the frame as given
    held,    // clutched: the tool stays where the servo finds it at first use
    rebased  // let go: the frame is moved, at first use, so that the tool stands where `anchor` held it
  };
  Kind kind = Kind::free;
  fs_frame frame = fs_frame_init();
  std::vector<Vec3> points{{0, 0, 0}};  // m, scene; frame of the handle
  Ref<const View> anchor;               // rebased: the view that held the tool

  // Found by the servo at first use. held: the pose of the tool in the scene; rebased: the pose of the frame.
  mutable Seqlock<Pose> found;

  // [rt] The frame with what was found; false: rebased, and not used yet.
  bool get_frame(fs_frame& out) const noexcept {
    out = frame;
    return kind != Kind::rebased || found.read(out.pose);
  }
};

struct ViewFade {
  Ref<const View> view, previous;  // previous may be null
  Fade fade = Fade::steady(true), previous_fade = Fade::steady(false);
};

enum class ClockKind : uint8_t { caller, steady, virtual_time };  // caller: steady until told

struct Snapshot : LocalCounted<Snapshot> {
  uint64_t sequence = 0;
  Table<Entry> objects;
  ViewFade views;
  ClockKind clock = ClockKind::caller;
  Ref<const Epoch> epoch;  // to be stamped by the servo when it first uses this; may be null
};

// A thread that evaluates, as the scene knows it.
struct Reader {
  const unsigned id;  // of the thread: a ReaderId that its owner holds
  Mailbox<Ref<const Snapshot>> mailbox;
};

}  // namespace fs
