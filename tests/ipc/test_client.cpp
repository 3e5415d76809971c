// What a client keeps in mind of its objects and of the shapes that it has sent, where a call is cut short.
#include <dlfcn.h>
#include <sys/socket.h>

#include <cerrno>

#include "client/own_objects.h"
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

static fs::Asset line() {
  static const fs::Vec3 points[]{{0, 0, 0}, {0.01, 0, 0}, {0.02, 0.01, 0}};
  return {fs::make_polyline(points, 3, false), nullptr};
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

int main() {
  Suite* suite = suite_create("client");
  scenes::add_once(suite, "cut short", {a_refused_shape_is_sent_again_in_two_tries,
                                        an_object_is_dropped_ahead_of_the_replica});
  return scenes::run_suite(suite);
}
