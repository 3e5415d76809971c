// The parts that the core stands on: texts, table, weights, mailbox, seqlock, track, histogram.
#include <algorithm>
#include <cmath>
#include <map>
#include <thread>
#include <vector>

#include "base/error.h"
#include "base/seqlock.h"
#include "base/text.h"
#include "base/whole_file.h"
#include "field/mailbox.h"
#include "field/motion.h"
#include "field/table.h"
#include "scene/events.h"
#include "scene/object_rows.h"
#include "scene/view_rows.h"
#include "servo/rolling_histogram.h"

#include "scenes/random.h"

#include <check.h>  // last: it has a macro `fail`

using namespace fs;

namespace {

struct Random {  // SplitMix64 (Steele, Lea, Flood 2014)
  uint64_t state = 1;
  uint64_t next() {
    uint64_t z = state += 0x9e3779b97f4a7c15;
    z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9;
    z = (z ^ z >> 27) * 0x94d049bb133111eb;
    return z ^ z >> 31;
  }
  double uniform() { return static_cast<double>(next() >> 11) * 0x1p-53; }
};

struct Item : LocalCounted<Item> {
  explicit Item(int v = 0) : value(v) { ++alive; }
  Item(const Item& other) : LocalCounted<Item>(other), value(other.value) { ++alive; }
  ~Item() { --alive; }
  int value;
  uint64_t sequence = 0;
  static inline int alive = 0;
};
using Items = Table<Item, 5>;

std::map<uint32_t, int> contents(const Items& table) {
  std::map<uint32_t, int> out;
  uint32_t last = 0;
  table.for_each([&](uint32_t i, const Item& item) {
    ck_assert(out.empty() || i > last);
    last = i;
    out[i] = item.value;
  });
  return out;
}

}  // namespace

// However long what it quotes is, a sentence has its end.
START_TEST(sentences_are_whole) {
  const std::string expression(5000, '(');
  try {
    (fs::fail)(FS_ERROR_PARSE, "the expression '%s': %s", expression.c_str(), "it is not closed");
  } catch (const Error& error) {
    ck_assert_int_eq(error.status, FS_ERROR_PARSE);
    ck_assert(error.text == "the expression '" + expression + "': it is not closed");
  }
  try {
    fail_at(FS_ERROR_PARSE, "file, line 1", "'%s' %s", expression.c_str(), "is not closed");
  } catch (const Error& error) {
    ck_assert(error.text == "file, line 1: '" + expression + "' is not closed");
  }
}
END_TEST

// Characters of one to four bytes, cut after any byte.
START_TEST(texts_are_cut_between_characters) {
  const std::string_view text = "a\u00fc\u2192\U0001f600b";
  const size_t ends[] = {0, 1, 1, 3, 3, 3, 6, 6, 6, 6, 10};
  for (size_t most = 0; most < std::size(ends); ++most) ck_assert_uint_eq(beginning_of(text, most).size(), ends[most]);
  ck_assert(beginning_of(text, 11) == text && beginning_of(text, 99) == text);
  char field[8];
  put_text(field, text);
  ck_assert_str_eq(field, "a\u00fc\u2192");
  ck_assert(field[7] == 0);
  const std::string eighty(80, 'x'), shorter(79, 'x');
  ck_assert(shortened(eighty) == eighty);
  ck_assert(shortened(eighty + "y") == eighty + "...");
  ck_assert(shortened(shorter + "\u00fc") == shorter + "...");
}
END_TEST

// Copies do not change; and every change since a copy is found.
START_TEST(table_copies_do_not_change) {
  Random random;
  {
    Items table;
    std::map<uint32_t, int> wanted;
    struct Copy {
      Items table;
      std::map<uint32_t, int> wanted;
      uint64_t sequence;
    };
    std::vector<Copy> copies;
    for (int step = 1; step <= 20000; ++step) {
      const auto sequence = static_cast<uint64_t>(step);
      const auto i = static_cast<uint32_t>(random.next() % (step % 3 ? 100 : Items::capacity));
      if (random.next() % 4 == 0) {
        table.set(i, nullptr, sequence);
        wanted.erase(i);
      } else if (random.next() % 2) {
        table.set(i, make_ref<Item>(step), sequence);
        wanted[i] = step;
      } else {
        table.edit(i, sequence).value = step;
        wanted[i] = step;
      }
      if (step % 1000 == 0) copies.push_back({table, wanted, sequence});
      const Item* item = table.get(i);
      ck_assert_int_eq(item != nullptr, wanted.count(i));
      if (item) ck_assert_int_eq(item->value, wanted[i]);
    }
    ck_assert(contents(table) == wanted);
    for (const Copy& copy : copies) {
      ck_assert(contents(copy.table) == copy.wanted);
      std::map<uint32_t, int> replayed = copy.wanted;
      size_t changes = 0;
      table.for_each_changed(copy.sequence, [&](uint32_t i, const Item* item) {
        changes += item != nullptr;
        if (item) {
          replayed[i] = item->value;
        } else {
          replayed.erase(i);
        }
      });
      ck_assert(replayed == wanted);
      ck_assert_uint_le(changes, 20000 - copy.sequence);
    }
    for (const auto& [i, value] : wanted) table.set(i, nullptr, 30000);
    ck_assert(contents(table).empty());
  }
  ck_assert_int_eq(Item::alive, 0);
}
END_TEST

namespace {

// A scene with one name, and a servo that ticks at any time.
struct OneName {
  explicit OneName(double the_fade, double blend = 0)
      : fade(the_fade), reader(make_ref<Memory>(Spread{.fade = the_fade, .blend = blend})), rows(output, clock) {
    for (const fs_primitive primitive : {FS_PRIMITIVE_POINT, FS_PRIMITIVE_PLANE}) {
      fs_object object = fs_object_init("name", primitive);
      for (uint32_t points : {0u, 1u, 2u}) {
        object.tool_points = points;
        versions.push_back(parse_object(object).object);
      }
    }
    rows.attach(reader);
    rows.start_servo(reader, true, 0);
    post();
    reader.mailbox.prime({snapshot, {}});
  }
  void post() {
    snapshot = make_ref<Snapshot>();
    snapshot->sequence = ++sequence;
    snapshot->chunks = rows.chunks();
    snapshot->views = views;
    rows.set_next_sequence(sequence + 1);
    reader.post(snapshot);
  }
  uint32_t tidy(uint32_t newest) {
    bool has_changed = false;
    const uint32_t rest = rows.tidy(newest, has_changed);
    if (has_changed) post();
    return rest;
  }
  void fetch() { reader.mailbox.fetch(); }
  void advance(double to) {
    now = to;
    const Snapshot& front = *reader.mailbox.front().snapshot;
    reader.memory->absorb(front, now);
    reader.memory->advance(front, now);
  }
  void end() { output.used.store(reader.mailbox.front().snapshot->sequence); }
  void tick(double to) {
    fetch();
    advance(to);
    end();
  }
  // For every version that the tick evaluates.
  std::map<uint64_t, double> weights() {
    std::map<uint64_t, double> out;
    reader.mailbox.front().snapshot->chunks.for_each([&](uint32_t number, const Chunk& chunk) {
      for (uint32_t i = 0; i < chunk_size; ++i) {
        if (!(chunk.used >> i & 1)) continue;
        const uint64_t version = chunk.row(i).version;
        out[version] = reader.memory->weight_at(number * chunk_size + i, version, now);
      }
    });
    return out;
  }

  const double fade;
  double now = 0;
  uint64_t sequence = 0;
  ServoOutput output;
  const Clock clock{output, ClockKind::virtual_time};
  Reader reader;
  ObjectRows rows;
  Ref<Views> views = make_ref<Views>();
  Ref<Snapshot> snapshot;
  std::vector<Ref<const Object>> versions;
};

}  // namespace

// Whatever is called between ticks, and however late they come, no weight changes by more than time/fade; a name has at
// most three rows; and the version that was set last is felt in the end.
START_TEST(weights_have_no_step) {
  Random random;
  const double dt = 0.001;
  for (int run = 0; run < scenes::sanitized_times(24, 100); ++run) {
    OneName scene(0.05);
    uint32_t newest = no_row;
    std::map<uint64_t, double> before;
    bool is_there = false;
    uint64_t wanted = 0;
    for (int step = 0; step < 3000; ++step) {
      if (step < 2500) {
        for (uint64_t k = random.next() % 4; k; --k) {
          if (newest != no_row && random.next() % 3 == 0) {
            if (is_there) newest = scene.rows.remove(newest);
            is_there = false;
          } else if (random.next() % (run % 4 ? 20 : 2) == 0) {
            Entry entry;
            entry.object = scene.versions[random.next() % (run % 3 ? 6 : 2)];
            if (random.next() % 4 == 0) entry.expiry = scene.now + 0.1 * random.uniform();
            newest = newest == no_row ? scene.rows.add(entry) : scene.rows.set(newest, entry);
            is_there = true;
            wanted = entry.expiry < never ? 0 : scene.rows.row(newest).version;
          }
          if (newest != no_row && random.next() % 2) newest = scene.tidy(newest);
          int count = 0;
          for (uint32_t row = newest; row != no_row; row = scene.rows.row(row).previous) ++count;
          ck_assert_int_le(count, 17);
          if (random.next() % 2) scene.post();
        }
      } else if (step == 2500) {
        scene.post();
      }
      if (random.next() % 3 == 0) continue;
      const double passed = dt * static_cast<double>(1 + random.next() % 3);
      scene.tick(scene.now + passed);
      const std::map<uint64_t, double> after = scene.weights();
      for (const auto& [version, weight] : after) {
        const double last = before.count(version) ? before[version] : 0;
        ck_assert_double_le(std::fabs(weight - last), passed / 0.05 * (1 + 1e-9));
      }
      for (const auto& [version, weight] : before) {
        if (!after.count(version)) ck_assert_double_le(weight, passed / 0.05 * (1 + 1e-9));
      }
      before = after;
    }
    double felt = 0;
    for (const auto& [version, weight] : before) felt += weight;
    if (is_there && wanted) {
      ck_assert_double_eq(before[wanted], 1);
      ck_assert_double_eq(felt, 1);
    } else {
      ck_assert_double_eq(felt, 0);
    }
    if (newest != no_row) newest = scene.tidy(newest);
    ck_assert_int_eq(newest != no_row, is_there);
  }
}
END_TEST

// What is to become less does so at once; what is to become more waits where the pace says so.
START_TEST(bounds_fall_at_once_and_rise_at_their_pace) {
  fs_object object = fs_object_init("name", FS_PRIMITIVE_POINT);
  object.front = fs_profile_init(FS_PROFILE_CONSTANT, FS_SENSE_ATTRACTIVE, 1, 0, 0.1);  // it jumps, so it wants all
  Entry entry;
  entry.object = parse_object(object).object;
  OneName scene(0.05, 0.01);
  uint32_t newest = scene.rows.add(entry);
  bool is_rising = false;
  const auto bound = [&](double slope, const Pace& pace) {
    is_rising = false;
    newest = scene.rows.bound(newest, {.slope = slope}, pace, is_rising);
    return scene.rows.row(newest).bounded->bounds.slope;
  };
  const Pace only_less{0.9, 0};
  ck_assert_double_eq(bound(100, only_less), 100);  // it had none
  scene.post();
  scene.tick(1);
  scene.output.tick = 1;  // the hand may be near from now on
  ck_assert_double_eq(bound(50, only_less), 50);
  ck_assert(!is_rising);
  ck_assert_double_eq(bound(80, only_less), 50);
  ck_assert(is_rising);
  ck_assert_double_eq(bound(52, only_less), 50);  // at least 0.9 of what is due
  ck_assert(!is_rising);
  ck_assert_double_eq(bound(80, {0.9, 1.25}), 62.5);
  ck_assert(is_rising);
  ck_assert_double_eq(bound(80, {0.9, never}), 80);
  ck_assert(!is_rising);
}
END_TEST

// Another profile takes over the weight of the one before: each of them changes fast, but what is felt of the name as slowly
// as it fades, whatever comes between.
START_TEST(weights_are_taken_over) {
  Random random;
  const double dt = 0.001, fade = 0.05, blend = 0.01;
  std::vector<Ref<const Object>> profiles;
  for (const double gain : {1.0, 2.0, 3.0}) {
    fs_object object = fs_object_init("name", FS_PRIMITIVE_POINT);
    object.front = fs_profile_init(FS_PROFILE_CONSTANT, FS_SENSE_ATTRACTIVE, gain, 0, 10);
    profiles.push_back(parse_object(object).object);
  }
  for (int run = 0; run < scenes::sanitized_times(24, 100); ++run) {
    OneName scene(run % 5 ? fade : 0, blend);
    const bool expires = run % 2;  // a version that expires before it begins cross-fades as one of another shape
    uint32_t newest = no_row;
    std::map<uint64_t, double> before;
    double felt = 0, most_parts = 0;
    bool is_there = false;
    for (int step = 0; step < 3000; ++step) {
      const bool is_over = step >= 2800;
      if (!is_over) {
        for (uint64_t k = random.next() % 3; k; --k) {
          if (newest != no_row && is_there && random.next() % 60 == 0) {
            newest = scene.rows.remove(newest);
            is_there = false;
          } else if (random.next() % (run % 4 ? 10 : 2) == 0) {
            Entry entry;
            entry.object = profiles[random.next() % 3];
            if (expires && random.next() % 20 == 0) entry.expiry = scene.now + 0.1 * random.uniform();
            newest = newest == no_row ? scene.rows.add(entry) : scene.rows.set(newest, entry);
            is_there = true;
          }
        }
      }
      if (step == 2800) {
        Entry entry;
        entry.object = profiles[random.next() % 3];
        newest = newest == no_row ? scene.rows.add(entry) : scene.rows.set(newest, entry);
      }
      if (newest != no_row) newest = scene.tidy(newest);
      scene.post();
      if (random.next() % 3 == 0) continue;
      const double passed = dt * static_cast<double>(1 + random.next() % 3);
      scene.tick(scene.now + passed);
      const std::map<uint64_t, double> after = scene.weights();
      double sum = 0, parts = 0;
      for (const auto& [version, weight] : after) {
        const double last = before.count(version) ? before[version] : 0;
        if (run % 5) ck_assert_double_le(std::fabs(weight - last), passed * (1 / blend + 1 / fade) * (1 + 1e-9));
        sum += weight;
        parts += weight > 0;
      }
      if (run % 5) ck_assert_double_le(std::fabs(sum - felt), (expires ? 2 : 1) * passed / fade * (1 + 1e-9) + 1e-12);
      ck_assert_double_le(sum, 1 + 1e-9);
      felt = sum;
      most_parts = std::fmax(most_parts, parts);
      before = after;
    }
    ck_assert_double_eq(before[scene.rows.row(newest).version], 1);
    ck_assert_double_eq(felt, 1);
    ck_assert_double_le(most_parts, expires ? 3 : 2);
    ck_assert_double_ge(most_parts, 2);
  }
}
END_TEST

// The views of a scene under a servo of which a tick can be held up between its parts.
struct OneView {
  explicit OneView(double fade) : servo(make_ref<Memory>(Spread{.fade = fade})) {
    views.attach_servo(servo);
    post();
    fetch();
  }
  void post() {
    const Ref<Snapshot> posted = make_ref<Snapshot>();
    posted->sequence = ++sequence;
    posted->views = Ref<const Views>(make_ref<Views>(*views.views()));
    views.set_next_sequence(sequence + 1);
    servo.post(posted);
  }
  void fetch() {
    servo.mailbox.fetch();
    used = servo.mailbox.front().snapshot.get();
  }
  void advance(double time) {
    servo.memory->absorb(*used, time);
    servo.memory->advance(*used, time);
    for (uint32_t i = 0; i < Views::size; ++i) {
      if (used->views->rows[i].version != 0) servo.memory->views.find(*used->views, i, identity_pose());
    }
  }
  void end() { output.used.store(used->sequence); }
  std::map<uint64_t, double> weights() const {
    std::map<uint64_t, double> out;
    for (uint32_t i = 0; i < Views::size; ++i) {
      const uint64_t version = used->views->rows[i].version;
      if (version != 0) out[version] = servo.memory->views.weight_at(i, version);
    }
    return out;
  }

  ServoOutput output{};
  ViewRows views{output};
  Reader servo;
  uint64_t sequence = 0;
  const Snapshot* used = nullptr;
};

// Frames come at any moment of a tick, clutched or not. No weight makes a step; without a fade each tick feels the newest
// view of its snapshot, though another has been set since (else the tick would feel the rest of a group without its
// frame); and a new tool without a frame of its own keeps the frame that a clutch has moved.
START_TEST(views_have_no_step_and_are_not_overtaken) {
  Random random;
  for (int run = 0; run < scenes::sanitized_times(6, 24); ++run) {
    const double fade = run % 2 ? 0.05 : 0;
    OneView scene(fade);
    std::map<uint64_t, double> before = scene.weights();
    double now = 1;
    const auto change_some = [&] {
      for (uint64_t k = random.next() % (run % 3 ? 4 : 40); k; --k) {
        ViewChange change;
        const uint64_t what = random.next();
        if (what & 1) change.frame = fs_frame_init();
        if (what & 2) change.points = std::vector<Vec3>{{random.uniform(), 0, 0}};
        if ((what >> 2 & 15) == 0) change.held = what >> 6 & 1;
        scene.views.change(change);
        if (random.next() % 2) scene.post();
      }
    };
    for (int step = 0; step < 500; ++step) {
      const double passed = 0.001 * static_cast<double>(1 + random.next() % 3);
      change_some();
      scene.fetch();
      change_some();
      now += passed;
      scene.advance(now);
      const View newest = scene.used->views->now();
      const std::map<uint64_t, double> after = scene.weights();
      if (fade == 0) {
        for (const auto& [version, weight] : after) ck_assert_double_eq(weight, version == newest.version && newest.is_in);
      }
      for (const auto& [version, weight] : after) {
        const double last = before.count(version) ? before[version] : 0;
        if (fade > 0) ck_assert_double_le(std::fabs(weight - last), passed / fade * (1 + 1e-9));
      }
      for (const auto& [version, weight] : before) {
        if (fade > 0 && !after.count(version)) ck_assert_double_le(weight, passed / fade * (1 + 1e-9));
      }
      before = after;
      change_some();
      scene.end();
    }
  }
}
END_TEST

// The same of an object: without a fade, each tick feels the newest version of its snapshot.
START_TEST(versions_are_not_overtaken) {
  Random random;
  for (int run = 0; run < scenes::sanitized_times(6, 12); ++run) {
    OneName scene(0);
    Entry entry;
    entry.object = scene.versions[0];
    uint32_t newest = scene.rows.add(entry);
    const auto change_some = [&] {
      for (uint64_t k = random.next() % (run % 3 ? 4 : 60); k; --k) {
        entry.object = scene.versions[random.next() % scene.versions.size()];
        newest = scene.rows.set(newest, entry);
        if (random.next() % 4) scene.post();
      }
    };
    for (int step = 0; step < 300; ++step) {
      change_some();
      if (step == 0) scene.post();
      scene.fetch();
      change_some();
      scene.advance(0.001 * step);
      const Chunks& chunks = scene.reader.mailbox.front().snapshot->chunks;
      chunks.for_each([&](uint32_t, const Chunk& chunk) {
        for (uint32_t i = 0; i < chunk_size; ++i) {
          if (!(chunk.used >> i & 1) || !chunk.row(i).is_named) continue;
          ck_assert_double_eq(scene.weights()[chunk.row(i).version], 1);
        }
      });
      change_some();
      scene.end();
    }
  }
}
END_TEST

START_TEST(a_fade_of_no_duration_is_at_once) {
  OneName scene(0);
  Entry entry;
  entry.object = scene.versions[0];
  uint32_t newest = scene.rows.add(entry);
  scene.post();
  scene.tick(5);
  ck_assert_double_eq(scene.weights()[scene.rows.row(newest).version], 1);
  const uint64_t first = scene.rows.row(newest).version;
  entry.object = scene.versions[1];
  entry.expiry = 7;
  newest = scene.rows.set(newest, entry);
  scene.post();
  scene.tick(5.001);
  ck_assert_double_eq(scene.weights()[first], 0);
  ck_assert_double_eq(scene.weights()[scene.rows.row(newest).version], 1);
  scene.tick(6.999);
  ck_assert_double_eq(scene.weights()[scene.rows.row(newest).version], 1);
  scene.tick(7);
  ck_assert_double_eq(scene.weights()[scene.rows.row(newest).version], 0);
}
END_TEST

// A value that is read was written as a whole, and never is an older one than before.
// Events of several sources are given in the order of their times, those of one time as they came.
START_TEST(events_are_in_order) {
  Events events;
  for (const double time : {3.0, 1.0, 2.0, 1.0}) {
    events.push(FS_EVENT_EXPIRED, time, "object " + std::to_string(static_cast<int>(time)));
  }
  events.push(FS_EVENT_EDITED, 1.0, "last of three");
  std::string order;
  for (fs_event event; events.take(5, event);) order += std::string(event.name) + ", ";
  ck_assert_str_eq(order.c_str(), "object 1, object 1, last of three, object 2, object 3, ");
}
END_TEST

START_TEST(mailbox_and_seqlock_are_never_torn) {
  struct Value {
    uint64_t a = 0, b = ~0ull;
  };
  Mailbox<Value> mailbox;
  Seqlock<Value> seqlock;
  Latest<Value> latest;
  std::atomic<bool> is_done{false};
  const uint64_t count = 300000;
  std::thread writer([&] {
    for (uint64_t i = 1; i <= count; ++i) {
      mailbox.post({i, ~i});
      seqlock.write({i, ~i});
      latest.write({i, ~i});
    }
    is_done = true;
  });
  uint64_t last_mail = 0, last_read = 0, last_latest = 0, fetched = 0;
  for (bool is_last = false; !is_last;) {
    is_last = is_done;
    if (mailbox.fetch()) {
      ++fetched;
      ck_assert_uint_eq(mailbox.front().a, ~mailbox.front().b);
      ck_assert_uint_gt(mailbox.front().a, last_mail);
      last_mail = mailbox.front().a;
    }
    Value value;
    if (seqlock.read(value)) {
      ck_assert_uint_eq(value.a, ~value.b);
      ck_assert_uint_ge(value.a, last_read);
      last_read = value.a;
    }
    if (latest.read(value)) {
      ck_assert_uint_eq(value.a, ~value.b);
      ck_assert_uint_ge(value.a, last_latest);
      last_latest = value.a;
    }
  }
  writer.join();
  ck_assert_uint_eq(last_mail, count);
  ck_assert_uint_eq(last_read, count);
  ck_assert_uint_eq(last_latest, count);
  ck_assert_uint_gt(fetched, 0);
}
END_TEST

// A value that was taken back is never seen, any other is; and the reader always has a whole value.
START_TEST(mailbox_takes_back) {
  Mailbox<Ref<const Item>> mailbox;
  mailbox.prime(make_ref<Item>(0));
  std::atomic<bool> is_done{false};
  std::atomic<int> newest{0};  // of what was left to be fetched
  int taken = 0;
  std::thread reader([&] {
    int last = 0;
    for (bool is_last = false; !is_last;) {
      is_last = is_done;
      mailbox.fetch();
      ck_assert(mailbox.front());
      const int value = mailbox.front()->value;
      ck_assert_int_ge(value, last);
      last = value;
    }
    ck_assert_int_eq(last, newest);
  });
  for (int i = 1; i <= 200000; ++i) {
    mailbox.post(make_ref<Item>(i));
    if (i % 3 == 0 && mailbox.take_back()) {
      ++taken;
      mailbox.post(make_ref<Item>(i));
    }
    newest = i;
  }
  is_done = true;
  reader.join();
  ck_assert_int_gt(taken, 0);
}
END_TEST

START_TEST(mailbox_frees_what_was_let_go) {
  {
    Mailbox<Ref<const Item>> mailbox;
    for (int i = 0; i < 10; ++i) {
      mailbox.post(make_ref<Item>(i));
      ck_assert_int_le(Item::alive, 2);
      if (i % 2) ck_assert(mailbox.fetch());
    }
    ck_assert_int_eq(mailbox.front()->value, 9);
  }
  ck_assert_int_eq(Item::alive, 0);
}
END_TEST

START_TEST(track_works_out_twists) {
  Track track;
  const auto at = [](double x) { return Pose{{x, 0, 0}, identity_quat()}; };
  ck_assert_double_eq(track.take(at(0), nullptr, 1.00).horizon, 0);
  const Motion second = track.take(at(0.02), nullptr, 1.04);
  ck_assert_double_eq_tol(second.twist.linear.x, 0.5, 1e-12);
  ck_assert_double_eq_tol(second.horizon, 0.08, 1e-12);
  ck_assert_double_eq_tol(second.at(1.06, 0).position.x, 0.03, 1e-12);
  ck_assert_double_eq_tol(second.at(9, 0).position.x, 0.06, 1e-12);   // at most twice 0.04 s
  ck_assert_double_eq_tol(second.at(0.5, 0).position.x, 0.02, 1e-12);  // it does not extrapolate backwards
  const Motion again = track.take(at(0.03), nullptr, 1.0405);       // this replaces the one at 1.04
  ck_assert_double_eq_tol(again.twist.linear.x, 0.03 / 0.0405, 1e-12);
  const Motion older = track.take(at(0.04), nullptr, 1.01);
  ck_assert_double_eq(older.horizon, 0);
  ck_assert_double_eq(track.take(at(0.05), nullptr, 1.5).horizon, 0);  // more than 0.2 s since the last
  const Twist given{{1, 0, 0}, {0, 0, 0}};
  ck_assert_double_eq_tol(track.take(at(0.05), &given, 1.6).at(9, 0).position.x, 0.15, 1e-12);
}
END_TEST

START_TEST(histogram_agrees_with_sorting) {
  static RollingHistogram histogram;
  Random random;
  std::vector<double> kept;
  for (int i = 0; i < 30000; ++i) {
    const double now = 100 + i * 1e-3, value = 1e-6 * std::exp(8 * random.uniform());
    histogram.add(value, now);
    if (now >= 120) kept.push_back(value);  // the last ten seconds of thirty
  }
  std::sort(kept.begin(), kept.end());
  const auto found = histogram.percentiles();
  ck_assert_uint_eq(found.count, kept.size());
  ck_assert_double_eq(found.max, kept.back());
  ck_assert_double_eq_tol(found.p50 / kept[kept.size() / 2], 1.0, 0.035);
  ck_assert_double_eq_tol(found.p99 / kept[kept.size() * 99 / 100], 1.0, 0.035);
}
END_TEST

int main() {
  TCase* test_case = tcase_create("core");
  tcase_set_timeout(test_case, 500);
  for (const TTest* test : {mailbox_and_seqlock_are_never_torn, mailbox_takes_back}) tcase_add_test(test_case, test);
  for (const TTest* test :
       {sentences_are_whole, texts_are_cut_between_characters, table_copies_do_not_change, weights_have_no_step,
        bounds_fall_at_once_and_rise_at_their_pace, weights_are_taken_over, versions_are_not_overtaken,
        views_have_no_step_and_are_not_overtaken,
        a_fade_of_no_duration_is_at_once, events_are_in_order, mailbox_frees_what_was_let_go, track_works_out_twists,
        histogram_agrees_with_sorting}) {
    if (!scenes::seeks_races) tcase_add_test(test_case, test);
  }
  Suite* suite = suite_create("core");
  suite_add_tcase(suite, test_case);
  SRunner* runner = srunner_create(suite);
  srunner_run_all(runner, CK_NORMAL);
  const int failed = srunner_ntests_failed(runner);
  srunner_free(runner);
  return failed != 0;
}
