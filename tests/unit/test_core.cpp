// The parts that the core stands on: table, fade, mailbox, seqlock, track, guard, histogram.
#include <algorithm>
#include <cmath>
#include <map>
#include <thread>
#include <vector>

#include "base/seqlock.h"
#include "scene/fade.h"
#include "scene/mailbox.h"
#include "scene/motion.h"
#include "scene/table.h"
#include "servo/guard.h"
#include "servo/statistics.h"

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
  explicit Item(int v) : value(v) { ++alive; }
  ~Item() { --alive; }
  int value;
  static inline int alive = 0;
};

std::map<uint32_t, int> contents(const Table<Item>& table) {
  std::map<uint32_t, int> out;
  uint32_t last = 0;
  table.for_each([&](uint32_t slot, const Item& item) {
    ck_assert(out.empty() || slot > last);
    last = slot;
    out[slot] = item.value;
  });
  return out;
}

}  // namespace

START_TEST(table_copies_do_not_change) {
  Random random;
  {
    Table<Item> table;
    std::map<uint32_t, int> wanted;
    std::vector<std::pair<Table<Item>, std::map<uint32_t, int>>> copies;
    for (int i = 0; i < 20000; ++i) {
      const auto slot = static_cast<uint32_t>(random.next() % (i % 3 ? 100 : Table<Item>::capacity));
      if (random.next() % 4 == 0) {
        table.set(slot, nullptr);
        wanted.erase(slot);
      } else {
        table.set(slot, make_ref<Item>(i));
        wanted[slot] = i;
      }
      if (i % 1000 == 0) copies.emplace_back(table, wanted);
      const Item* item = table.get(slot);
      ck_assert_int_eq(item != nullptr, wanted.count(slot));
      if (item) ck_assert_int_eq(item->value, wanted[slot]);
    }
    ck_assert(contents(table) == wanted);
    for (const auto& [copy, before] : copies) ck_assert(contents(copy) == before);
    for (const auto& [slot, value] : wanted) table.set(slot, nullptr);
    ck_assert(contents(table).empty());
  }
  ck_assert_int_eq(Item::alive, 0);
}
END_TEST

// However it is turned about, a weight never moves by more than time/duration, and it gets where it is going.
START_TEST(fade_has_no_step) {
  Random random;
  const double duration = 0.5, dt = 0.001;
  for (int run = 0; run < 200; ++run) {
    Fade fade = Fade::steady(random.next() % 2);
    double now = 0, last = fade.weight(now, duration);
    Ref<const Epoch> pending;
    bool in = fade.is_going_in();
    double expiry = never;
    for (int i = 0; i < 2000; ++i) {
      now += dt;
      if (i < 1000 && random.next() % 50 == 0) {  // one change, or several between two ticks
        for (uint64_t k = random.next() % 3 + 1; k; --k) {
          in = random.next() % 2;
          expiry = random.next() % 3 ? never : now + 0.1 * random.uniform();
          if (!pending) pending = make_ref<Epoch>();
          fade = fade.turned(in, expiry, pending, duration);
        }
      }
      if (pending && random.next() % 3) {  // the tick that uses it may come late
        pending->stamp(now);
        pending = nullptr;
      }
      const double weight = fade.weight(now, duration);
      ck_assert_double_ge(weight, 0);
      ck_assert_double_le(weight, 1);
      ck_assert_double_le(std::fabs(weight - last), dt / duration * (1 + 1e-9));
      last = weight;
    }
    ck_assert_double_eq(last, in && expiry == never ? 1 : 0);
  }
}
END_TEST

START_TEST(fade_of_no_duration_is_at_once) {
  const Ref<const Epoch> epoch = make_ref<Epoch>();
  const Fade fade = Fade::steady(false).turned(true, never, epoch, 0);
  ck_assert_double_eq(fade.weight(5, 0), 0);
  epoch->stamp(5);
  ck_assert_double_eq(fade.weight(4.999, 0), 0);
  ck_assert_double_eq(fade.weight(5, 0), 1);
  ck_assert_double_eq(Fade::steady(true, 7).weight(6.9, 0), 1);
  ck_assert_double_eq(Fade::steady(true, 7).weight(7, 0), 0);
}
END_TEST

// What is read was written whole, and never goes back.
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

// What was taken back is never seen, what was not is; and the reader always has something whole.
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
  ck_assert_double_eq_tol(second.at(1.06).position.x, 0.03, 1e-12);
  ck_assert_double_eq_tol(second.at(9).position.x, 0.06, 1e-12);   // at most twice 0.04 s
  ck_assert_double_eq_tol(second.at(0.5).position.x, 0.02, 1e-12);  // never back
  const Motion again = track.take(at(0.03), nullptr, 1.0405);       // replaces the one at 1.04
  ck_assert_double_eq_tol(again.twist.linear.x, 0.03 / 0.0405, 1e-12);
  const Motion older = track.take(at(0.04), nullptr, 1.01);
  ck_assert_double_eq(older.horizon, 0);
  ck_assert_double_eq(track.take(at(0.05), nullptr, 1.5).horizon, 0);  // more than 0.2 s since the last
  const Twist given{{1, 0, 0}, {0, 0, 0}};
  ck_assert_double_eq_tol(track.take(at(0.05), &given, 1.6).at(9).position.x, 0.15, 1e-12);
}
END_TEST

START_TEST(guard_limits_ramps_and_latches) {
  Guard guard({10, 1, 2, 0.5, 1e-3, 3, 0});
  fs_state state{};
  state.pose = identity_pose();
  const Wrench wanted{{30, 0, 40}, {1, 0, 0}};
  Wrench sent = guard.apply({state, false, 0}, wanted);
  ck_assert(sent.force == Vec3{});
  ck_assert_uint_eq(guard.faults(), FS_FAULT_DEVICE);
  for (int i = 1; i <= 600; ++i) {
    sent = guard.apply({state, true, 0}, wanted);
    ck_assert_double_eq_tol(norm(sent.force), 10 * std::fmin(1, i / 500.0), 1e-9);
    ck_assert_double_eq_tol(sent.force.z / sent.force.x, 40.0 / 30, 1e-12);
    ck_assert(guard.has_guarded());
    ck_assert(sent.torque == Vec3{});  // it has none
  }
  guard.apply({state, true, 0.025}, wanted);  // one stall: only the ramp
  ck_assert_uint_eq(guard.faults(), 0);
  for (int i = 0; i < 600; ++i) sent = guard.apply({state, true, 0}, {{1, 0, 0}, {}});
  ck_assert_double_eq(sent.force.x, 1);
  ck_assert(!guard.has_guarded());
  for (int i = 0; i < 19; ++i) guard.apply({state, true, 0.002}, wanted);
  ck_assert_uint_eq(guard.faults(), 0);
  guard.apply({state, true, 0.002}, wanted);
  ck_assert_uint_eq(guard.faults(), FS_FAULT_LATE);
  ck_assert(guard.apply({state, true, 0}, wanted).force == Vec3{});
  guard.set_enabled(true);
  ck_assert_double_gt(norm(guard.apply({state, true, 0}, wanted).force), 0);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  ck_assert(guard.apply({state, true, 0}, {{nan, 0, 0}, {}}).force == Vec3{});
  ck_assert_uint_eq(guard.faults(), FS_FAULT_NUMBER);
  guard.set_enabled(true);
  state.twist.linear = {0, 2.5, 0};
  guard.apply({state, true, 0}, wanted);
  ck_assert_uint_eq(guard.faults(), FS_FAULT_SPEED);
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
  tcase_set_timeout(test_case, 60);
  tcase_add_test(test_case, table_copies_do_not_change);
  tcase_add_test(test_case, fade_has_no_step);
  tcase_add_test(test_case, fade_of_no_duration_is_at_once);
  tcase_add_test(test_case, mailbox_and_seqlock_are_never_torn);
  tcase_add_test(test_case, mailbox_takes_back);
  tcase_add_test(test_case, mailbox_frees_what_was_let_go);
  tcase_add_test(test_case, track_works_out_twists);
  tcase_add_test(test_case, guard_limits_ramps_and_latches);
  tcase_add_test(test_case, histogram_agrees_with_sorting);
  Suite* suite = suite_create("core");
  suite_add_tcase(suite, test_case);
  SRunner* runner = srunner_create(suite);
  srunner_run_all(runner, CK_NORMAL);
  const int failed = srunner_ntests_failed(runner);
  srunner_free(runner);
  return failed != 0;
}
