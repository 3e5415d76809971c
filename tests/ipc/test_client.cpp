// What a client keeps in mind of its objects and of the shapes that it has sent, where a call is cut short.
#include <dlfcn.h>
#include <sys/mman.h>
#include <sys/socket.h>

#include <atomic>
#include <cerrno>
#include <functional>
#include <thread>

#include "client/own_objects.h"
#include "client/remote_scene.h"
#include "ipc/rig.h"

using namespace hostile;

// While it is set, this thread can send no descriptors, as when too many of the user's are in transit.
static thread_local bool are_descriptors_stuck = false;

extern "C" ssize_t sendmsg(int socket, const msghdr* message, int flags) {
  using Send = ssize_t (*)(int, const msghdr*, int);
  static const auto send = reinterpret_cast<Send>(dlsym(RTLD_NEXT, "sendmsg"));
  if (are_descriptors_stuck && message->msg_controllen > 0) {
    errno = ETOOMANYREFS;
    return -1;
  }
  return send(socket, message, flags);
}

// Called where this thread makes a memory file, as it does to pack a shape.
static thread_local std::function<void()> at_memory_file;

extern "C" int memfd_create(const char* name, unsigned flags) {
  using Make = int (*)(const char*, unsigned);
  static const auto make = reinterpret_cast<Make>(dlsym(RTLD_NEXT, "memfd_create"));
  if (at_memory_file) at_memory_file();
  return make(name, flags);
}

static fs::Asset line() {
  static const fs::Vec3 points[]{{0, 0, 0}, {0.01, 0, 0}, {0.02, 0.01, 0}};
  return {fs::make_polyline(points, 3, false), nullptr, nullptr};
}

START_TEST(a_refused_shape_is_sent_again_in_two_tries) {
  Rig rig;
  fs::Connection connection(fs::parse_endpoint(rig.endpoint.c_str(), false), "me");
  fs::SentAssets sent(connection);
  const fs::Asset shape = line();
  const uint64_t id = shape.serial();
  ck_assert(sent.send(shape));
  ck_assert(sent.use(id));
  sent.note_refused(id);
  are_descriptors_stuck = true;
  ck_assert(!sent.send(shape));  // the server has forgotten the refused one, and does not get the new one
  are_descriptors_stuck = false;
  ck_assert(sent.send(shape));
  sent.forget_unused(true);
  ck_assert(sent.has(id));  // it is still in use
  sent.stop_using(id);
  ck_assert(eventually([&] {
    sent.forget_unused(true);
    return !sent.has(id);
  }));
  ck_assert(!connection.loss());
}
END_TEST

START_TEST(an_object_is_dropped_ahead_of_the_replica) {
  Rig rig;
  fs::Connection connection(fs::parse_endpoint(rig.endpoint.c_str(), false), "me");
  fs::SentAssets sent(connection);
  for (const bool is_all : {false, true}) {
    fs::OwnObjects objects(sent, 8);
    const auto replica = fs::make_ref<fs::LocalScene>();
    const std::vector<const char*> names{"a", "b", "c"};
    for (const char* name : names) {
      replica->set(push(name, 1));
      objects.move_ahead(objects.add(name), *replica, scenes::at(1, 2, 3), nullptr, 1);
    }
    if (is_all) objects.drop_all();
    else objects.drop("b");
    objects.move_replica(*replica);
    for (const char* name : names) {
      const bool has_moved = replica->movement(name).motion.pose.position.x == 1;
      ck_assert(has_moved == (!is_all && *name != 'b'));
    }
  }
}
END_TEST

START_TEST(a_move_while_a_mesh_is_packed) {  // by another thread: it does not wait
  Rig rig;
  const auto scene = fs::make_ref<fs::RemoteScene>(fs::parse_endpoint(rig.endpoint.c_str(), false), "me");
  std::vector<fs_vec3> points(20000);  // enough that it is packed without the lock
  for (size_t i = 0; i < points.size(); ++i) points[i].x = 1e-6 * static_cast<double>(i);
  scene->set(push("moved", 0.1));
  for (const bool is_group : {false, true}) {
    const scenes::Shape shape = scenes::make_polyline(points.data(), points.size(), false);
    fs_object o = scenes::spring("large");
    o.primitive = FS_PRIMITIVE_POLYLINE;
    o.shape = shape.get();
    std::atomic<bool> has_moved{false};
    std::thread mover;
    bool was_waited_for = false;
    at_memory_file = [&] {
      if (mover.joinable()) return;
      mover = std::thread([&] {
        scene->move("moved", {{1, 0, 0}, {0, 0, 0, 1}}, nullptr, 0);
        has_moved = true;
      });
      was_waited_for = eventually([&] { return has_moved.load(); });
    };
    if (is_group) scene->begin();
    scene->set(o);
    if (is_group) scene->commit();
    at_memory_file = nullptr;
    ck_assert(mover.joinable());
    mover.join();
    ck_assert(was_waited_for);
  }
  scene->close();
}
END_TEST

int main() {
  Suite* suite = suite_create("client");
  scenes::add_once(suite, "cut short", {a_refused_shape_is_sent_again_in_two_tries,
                                        an_object_is_dropped_ahead_of_the_replica, a_move_while_a_mesh_is_packed});
  return scenes::run_suite(suite);
}
