// The bounds of the work that one client causes for others: counted, not timed.
#include <atomic>
#include <string>
#include <thread>
#include <vector>

#include "scene/scene_group.h"
#include "server/allowance.h"
#include "server/names.h"
#include "server/worker.h"
#include "unit/force_fixtures.h"

using namespace fs;
using namespace fs::test;

namespace {

START_TEST(an_allowance_is_kept_on_average) {
  Allowance allowance(100);
  size_t done = 0;
  for (int turn = 0; turn < 1000; ++turn) {
    if (!allowance.begin_turn()) continue;
    allowance.spend(1650);  // as for a client with very many moves
    done += 1650;
  }
  ck_assert_uint_le(done, 100 * 1000 + 1650);
  ck_assert_uint_ge(done, 90 * 1000);
  // A client that stays within its allowance never misses a turn.
  Allowance modest(100);
  for (int turn = 0; turn < 100; ++turn) {
    ck_assert(modest.begin_turn());
    modest.spend(100);
  }
  // An unused allowance is not saved up.
  Allowance idle(100);
  for (int turn = 0; turn < 100; ++turn) ck_assert(idle.begin_turn());
  idle.spend(300);
  ck_assert(!idle.begin_turn());
  ck_assert(!idle.begin_turn());
  ck_assert(idle.begin_turn());
}
END_TEST

// Eight clients with very much work, and one that needs a piece of 1 every 1000: it waits for one piece of another
// client.
START_TEST(who_asks_little_goes_first) {
  constexpr size_t quiet = 8;
  constexpr double piece = 10, turn = 1000;
  std::vector<Usage> all(quiet + 1, Usage(0));
  std::vector<double> done(quiet + 1, 0);
  double clock = 0, next_turn = turn, next_question = 0.5 * turn;
  while (clock < 200 * turn) {
    bool is_asking = clock >= next_question;
    size_t next = 0;
    for (size_t i = 0; i < all.size(); ++i) {
      if ((i != quiet || is_asking) && all[i].lately() < all[next].lately()) next = i;
    }
    const double work = next == quiet ? 1 : piece;
    if (next == quiet) {
      ck_assert_double_le(clock - next_question, piece);
      next_question += turn;
    }
    clock += work;
    done[next] += work;
    all[next].spend(work);
    for (; clock >= next_turn; next_turn += turn) {
      for (Usage& usage : all) usage.fade();
    }
  }
  ck_assert_double_ge(done[quiet], 199);
  // and no client is left out
  for (size_t i = 0; i < quiet; ++i) ck_assert_double_ge(done[i], 0.99 * clock / quiet - 2 * piece);
}
END_TEST

// Work that ends only when it is abandoned.
Worker::Job endless(uint64_t owner, std::atomic<uint64_t>& steps, std::atomic<bool>& is_stopped) {
  return {[&](StopToken& stop) {
            try {
              for (;; ++steps) stop.check();
            } catch (const Stopped&) {
              is_stopped = true;
            }
          },
          [] {}, owner};
}
void wait_for(const std::atomic<bool>& flag) {
  while (!flag) std::this_thread::yield();
}
void wait_for(const std::atomic<uint64_t>& count, uint64_t least) {
  while (count < least) std::this_thread::yield();
}

START_TEST(who_leaves_holds_up_nobody) {
  std::atomic<uint64_t> steps{0};
  std::atomic<bool> is_stopped{false}, is_done{false};
  Worker worker("fs-worker", [] {});
  worker.add(endless(1, steps, is_stopped));
  worker.add(endless(1, steps, is_stopped));
  worker.add({[&](StopToken&) { is_done = true; }, [] {}, 2});
  wait_for(steps, 1);
  worker.forget(1);
  wait_for(is_done);
  ck_assert(is_stopped);
  // The job of another client is not abandoned with it.
  std::atomic<uint64_t> steps_again{0};
  std::atomic<bool> is_abandoned_again{false};
  worker.add(endless(3, steps_again, is_abandoned_again));
  wait_for(steps_again, 1);
  worker.forget(2);
  const uint64_t least = steps_again + 5000;  // by then it would have noticed
  while (steps_again < least && !is_abandoned_again) std::this_thread::yield();
  ck_assert(!is_abandoned_again);
}  // the destructor abandons the work that is under way
END_TEST

START_TEST(a_group_is_committed_by_steps) {
  const Ref<LocalScene> scene = make_ref<LocalScene>();
  scene->hold();
  SceneGroup first(scene);
  for (int i = 0; i < 1000; ++i) {
    fs_object object = fs_object_init(("o" + std::to_string(i)).c_str(), FS_PRIMITIVE_POINT);
    first.set(object);
  }
  int steps = 1;
  while (!first.commit(64)) ++steps;
  ck_assert_int_eq(steps, 1000 / 64 + 1);
  ck_assert_uint_eq(scene->object_count(), 1000);
  // All that can be in one: changed, moved, removed, come and gone.
  SceneGroup second(scene);
  fs_object object = fs_object_init("o1", FS_PRIMITIVE_PLANE);
  second.set(object);
  second.move("o2", {{1, 2, 3}, {1, 0, 0, 0}}, nullptr, 0);
  second.remove("o3");
  object = fs_object_init("new", FS_PRIMITIVE_PLANE);
  second.set(object);
  second.remove("new");
  steps = 1;
  while (!second.commit(1)) ++steps;
  ck_assert_int_eq(steps, 4);
  ck_assert_uint_eq(scene->object_count(), 999);
  fs_object found;
  scene->get("o1", found);
  ck_assert_int_eq(found.primitive, FS_PRIMITIVE_PLANE);
  scene->get("o2", found);
  ck_assert_double_eq(found.pose.position.z, 3);
  refusal(FS_ERROR_NOT_FOUND, [&] { scene->get("o3", found); });
  refusal(FS_ERROR_NOT_FOUND, [&] { scene->get("new", found); });
  scene->set(fs_object_init("new", FS_PRIMITIVE_POINT));
}
END_TEST

// A move finds its object by the id of its name; the name itself is looked up only where the id is not known, or of a name that
// is gone.
START_TEST(a_move_finds_its_object_without_its_name) {
  const Ref<LocalScene> scene = make_ref<LocalScene>();
  const auto at = [&](const char* name) {
    fs_object object;
    scene->get(name, object);
    return object.pose.position.x;
  };
  const auto to = [](double x) { return Motion{{{x, 0, 0}, {1, 0, 0, 0}}, {}, 1, 0}; };
  for (const char* name : {"a", "b"}) scene->set(fs_object_init(name, FS_PRIMITIVE_POINT));
  NameId a, b;
  const std::string name_a = "a", name_b = "b", nobody = "nobody";
  ck_assert_uint_eq(scene->set_motions({{&name_a, &a, to(1)}, {&name_b, &b, to(2)}}), 2);
  ck_assert_uint_eq(scene->set_motions({{&nobody, &a, to(3)}, {&nobody, &b, to(4)}}), 2);
  ck_assert_double_eq(at("a"), 3);
  ck_assert_double_eq(at("b"), 4);
  // Another version of the object has another row, and the same id.
  scene->set(fs_object_init("a", FS_PRIMITIVE_PLANE));
  ck_assert_uint_eq(scene->set_motions({{&nobody, &a, to(5)}}), 1);
  ck_assert_double_eq(at("a"), 5);
  // The ids of names that are gone find nothing, also where new names have come in their places.
  const NameId gone = a;
  scene->remove("a");
  ck_assert_uint_eq(scene->set_motions({{&nobody, &a, to(6)}}), 0);
  scene->set(fs_object_init("c", FS_PRIMITIVE_POINT));
  ck_assert_uint_eq(scene->set_motions({{&nobody, &a, to(6)}}), 0);
  scene->set(fs_object_init("a", FS_PRIMITIVE_POINT));
  a = gone;
  ck_assert_uint_eq(scene->set_motions({{&name_a, &a, to(7)}}), 1);
  ck_assert_double_eq(at("a"), 7);
  ck_assert_double_eq(at("c"), 0);
  ck_assert(a.number != gone.number);
}
END_TEST

START_TEST(a_record_of_a_name_is_put_back) {
  Names names;
  names.open(4);
  const ParkedBatches none;
  for (const char* name : {"a", "b", "c"}) names.add(name);
  ck_assert(names.bind("a", 0, 10));
  ck_assert(names.bind("b", 1, 11));
  names.await("b");
  names.set_untold("b", "editor");
  names.set_absent("refused", {FS_PRIMITIVE_PLANE, FS_OBJECT_REFUSED});
  // A slot is of one object: the later change wins.
  ck_assert(!names.bind("c", 0, 9));
  ck_assert_str_eq(names.moved_by(0)->first.c_str(), "a");
  ck_assert(names.bind("c", 0, 12));
  ck_assert_str_eq(names.moved_by(0)->first.c_str(), "c");
  ck_assert_uint_eq(names.object("a")->slot, wire::no_slot);

  // A group removes b, sets another object that gets its slot, and sets the one that was refused.
  const NameRecord b = names.record_of("b"), refused = names.record_of("refused"), fresh = names.record_of("fresh");
  names.forget("b");
  ck_assert(!names.has_untold() && !names.has_awaited());
  names.add("fresh");
  ck_assert(names.bind("fresh", 1, 13));
  names.add("refused");
  ck_assert_uint_eq(names.absents(), 0);
  ck_assert_uint_eq(names.objects(), 4);
  for (const char* name : {"b", "fresh", "refused"}) names.forget(name);
  ck_assert(!names.put_back("fresh", fresh));
  ck_assert(!names.put_back("refused", refused));
  ck_assert(names.put_back("b", b));
  ck_assert_uint_eq(names.objects(), 3);
  ck_assert_uint_eq(names.absents(), 1);
  ck_assert(!names.find("fresh"));
  ck_assert_str_eq(names.moved_by(1)->first.c_str(), "b");
  ck_assert_uint_eq(names.object("b")->after, 11);
  ck_assert_str_eq(names.next_untold(none)->c_str(), "b");
  int used = 0;
  names.take_used(7, 6, [&](const std::string&) { ++used; });
  ck_assert_int_eq(used, 0);
  names.take_used(8, 7, [&](const std::string&) { ++used; });
  ck_assert_int_eq(used, 1);
  ck_assert(!names.has_awaited());
  // What nobody knows anything of any more has no record.
  names.drop_absent("refused");
  ck_assert(!names.find("refused"));
}
END_TEST

}  // namespace

int main() {
  return run("server", {an_allowance_is_kept_on_average, who_asks_little_goes_first, who_leaves_holds_up_nobody,
                        a_group_is_committed_by_steps, a_move_finds_its_object_without_its_name,
                        a_record_of_a_name_is_put_back});
}
