#include "attacks.h"

#include <sys/prctl.h>
#include <unistd.h>

#include <bit>
#include <cmath>
#include <csignal>
#include <cstring>
#include <string>
#include <vector>

#include "ipc/raw_client.h"
#include "rig.h"
#include "scenes/handles.h"
#include "scenes/random.h"

namespace bench {
namespace {

using scenes::Random;

struct FreeShape {
  void operator()(fs_shape* p) const { fs_shape_destroy(p); }
  void operator()(fs_curve* p) const { fs_curve_destroy(p); }
};
using Shape = std::unique_ptr<fs_shape, FreeShape>;
using Curve = std::unique_ptr<fs_curve, FreeShape>;

// The server may refuse a call, and may disconnect the client: then it connects again.
class Client {
 public:
  explicit Client(const Page& page) : endpoint_(page.job.endpoint) { join(); }
  fs_scene* scene() { return scene_.get(); }
  void look(fs_status status) {
    if (status == FS_ERROR_DISCONNECTED) join();
    if (status == FS_ERROR_FULL) sleep_for(0.001);
  }

 private:
  void join() {
    for (;;) {
      scene_.reset();
      fs_scene* scene = nullptr;
      if (fs_scene_connect(endpoint_.c_str(), "hostile", &scene) == FS_OK) {
        scene_.reset(scene);
        return;
      }
      sleep_for(0.01);
    }
  }
  const std::string endpoint_;
  Scene scene_;
};

Curve table_of(size_t count) {
  std::vector<double> forces(count);
  for (size_t i = 0; i < count; ++i) forces[i] = 1 + static_cast<double>(i % 7) * 1e-3;
  fs_curve* curve = nullptr;
  check(fs_curve_create_table(forces.data(), forces.size(), 1e-5, &curve), "fs_curve_create_table");
  return Curve(curve);
}

fs_object custom_point(const std::string& name, const fs_curve* curve, double gain) {
  fs_object object = far_point(name.c_str(), 0);
  object.front = fs_profile_init(FS_PROFILE_CUSTOM, FS_SENSE_ATTRACTIVE, gain, 0, 0.1);
  object.front.curve = const_cast<fs_curve*>(curve);
  object.pose.position.x = 5;
  object.front.reach = 0.005;
  return object;
}

void set_tables(Page& page, double pause) {
  Client client(page);
  const Curve curve = table_of(62501);
  ++page.ready;
  for (int k = 0;; ++k) {
    const fs_object object = custom_point("c", curve.get(), 1 + 1e-6 * k);
    client.look(fs_object_set(client.scene(), &object));
    if (pause > 0) sleep_for(pause);
  }
}
void tables_at_times(Page& page) { set_tables(page, 0.05); }
void tables_at_once(Page& page) { set_tables(page, 0); }

void groups_of_tables(Page& page) {
  Client client(page);
  const Curve curve = table_of(62501);
  ++page.ready;
  for (int k = 0;; ++k) {
    client.look(fs_scene_begin(client.scene()));
    for (int i = 0; i < 120; ++i) {
      const fs_object object = custom_point("c" + std::to_string(i), curve.get(), 1 + 1e-3 * i + 1e-6 * k);
      client.look(fs_object_set(client.scene(), &object));
    }
    client.look(fs_scene_commit(client.scene()));
    client.look(fs_scene_sync(client.scene(), 1));
  }
}

// Points that fall into one slot of a table by one well-known way to hash doubles.
std::vector<fs_vec3> colliding_points(size_t n, uint64_t seed) {
  constexpr uint64_t factor = 0x9e3779b97f4a7c15u;
  uint64_t inverse = factor;
  for (int i = 0; i < 6; ++i) inverse *= 2 - factor * inverse;
  const auto hash = [](uint64_t h, double c) {
    h = (h ^ std::bit_cast<uint64_t>(c + 0.0)) * factor;
    return h ^ h >> 32;
  };
  Random random(seed);
  std::vector<fs_vec3> points;
  while (points.size() < n) {
    const size_t i = points.size();
    const double x = 1 + 1e-3 * static_cast<double>(i % 1000), y = 1e-3 * static_cast<double>(i / 1000);
    const uint64_t high = random.below(1u << 31), low = (high ^ (random.below(1u << 10) << 20)) & 0xffffffff;
    const double z = std::bit_cast<double>(((high << 32 | low) * inverse) ^ hash(hash(0, x), y));
    if (std::fabs(z) < 1e3 && std::fabs(z) > 1e-300) points.push_back({x, y, z});
  }
  return points;
}

std::vector<fs_vec3> ordinary_points(size_t n, uint64_t seed) {
  Random random(seed);
  std::vector<fs_vec3> points(n);
  for (fs_vec3& p : points) p = {random.between(1, 2), random.between(1, 2), random.between(1, 2)};
  return points;
}

Shape mesh_of(const std::vector<fs_vec3>& points) {
  std::vector<uint32_t> corners(points.size());
  for (size_t i = 0; i < corners.size(); ++i) corners[i] = static_cast<uint32_t>(i);
  fs_shape* shape = nullptr;
  check(fs_shape_create_mesh(points.data(), points.size(), corners.data(), corners.size() / 3, &shape),
        "fs_shape_create_mesh");
  return Shape(shape);
}

// Another mesh of n points again and again.
void meshes(Page& page, size_t n, std::vector<fs_vec3> (*points)(size_t, uint64_t)) {
  Client client(page);
  std::vector<std::vector<fs_vec3>> all;
  for (uint64_t seed = 1; seed <= 2; ++seed) all.push_back(points(n, seed));
  ++page.ready;
  for (size_t k = 0;; ++k) {
    const Shape shape = mesh_of(all[k % all.size()]);
    fs_object object = fs_object_init("mesh", FS_PRIMITIVE_MESH);
    object.shape = shape.get();
    object.front = fs_profile_init(FS_PROFILE_CONSTANT, FS_SENSE_REPULSIVE, 1, 0, 1);
    object.front.reach = 0.005;
    client.look(fs_object_set(client.scene(), &object));
    client.look(fs_scene_sync(client.scene(), 1));
  }
}
void colliding_meshes(Page& page) { meshes(page, 150'000, colliding_points); }
void large_meshes(Page& page) { meshes(page, 900'000, ordinary_points); }
void small_meshes(Page& page) { meshes(page, 3000, ordinary_points); }

void fill(Client& client, int objects) {
  client.look(fs_scene_begin(client.scene()));
  for (int i = 0; i < objects; ++i) {
    const fs_object object = far_point(("o" + std::to_string(i)).c_str(), i);
    client.look(fs_object_set(client.scene(), &object));
  }
  client.look(fs_scene_commit(client.scene()));
  client.look(fs_scene_sync(client.scene(), 5));
}

// As much as a client may have, all at once.
void largest_groups(Page& page) {
  Client client(page);
  fill(client, 4000);
  ++page.ready;
  for (int k = 0;; ++k) {
    client.look(fs_scene_begin(client.scene()));
    for (int round = 0; round < 4; ++round) {
      for (int i = 0; i < 4000; ++i) {
        fs_object object = far_point(("o" + std::to_string(i)).c_str(), i);
        object.front.gain = 1 + 1e-3 * (k % 100);
        client.look(fs_object_set(client.scene(), &object));
      }
    }
    client.look(fs_scene_commit(client.scene()));
    client.look(fs_scene_sync(client.scene(), 1));
  }
}

void sets(Page& page) {
  Client client(page);
  fill(client, 100);
  ++page.ready;
  for (int k = 0;; ++k) {
    fs_object object = far_point(("o" + std::to_string(k % 100)).c_str(), k % 100);
    object.front.gain = 1 + 1e-3 * (k % 100);
    client.look(fs_object_set(client.scene(), &object));
  }
}

void moves(Page& page) {
  Client client(page);
  fill(client, 4000);
  ++page.ready;
  std::vector<std::string> names;
  for (int i = 0; i < 4000; ++i) names.push_back("o" + std::to_string(i));
  const fs_twist still{};
  for (int k = 0;; ++k) {
    for (int i = 0; i < 4000; ++i) {
      fs_pose pose = far_point("", i).pose;
      pose.position.z += 1e-3 * (k % 10);
      client.look(fs_object_move(client.scene(), names[static_cast<size_t>(i)].c_str(), &pose, &still, FS_NOW));
    }
  }
}

void reports(Page& page) {
  Client client(page);
  fill(client, 4000);
  std::vector<fs_report> all(5000);
  ++page.ready;
  for (;;) {
    size_t n = 0;
    client.look(fs_scene_get_reports(client.scene(), all.data(), all.size(), &n));
  }
}

void clears(Page& page) {
  Client client(page);
  ++page.ready;
  for (;;) {
    fill(client, 4000);
    client.look(fs_scene_clear(client.scene()));
    client.look(fs_scene_sync(client.scene(), 1));
  }
}

void edits(Page& page) {
  Client client(page);
  ++page.ready;
  for (int k = 0;; ++k) {
    fs_object object = fs_object_init(victim, FS_PRIMITIVE_POINT);
    object.front = fs_profile_init(FS_PROFILE_CONSTANT, FS_SENSE_ATTRACTIVE, 1e-3 * (1 + k % 2), 0, 1);
    object.front.reach = 0.005;
    client.look(fs_object_change(client.scene(), &object, FS_PART_PROFILES));
  }
}

void comings_and_goings(Page& page) {
  ++page.ready;
  for (int k = 0;; ++k) {
    fs_scene* scene = nullptr;
    if (fs_scene_connect(page.job.endpoint, ("hostile" + std::to_string(k % 50)).c_str(), &scene) == FS_OK) {
      const fs_object object = far_point("o", 0);
      fs_object_set(scene, &object);
      fs_scene_destroy(scene);
    }
  }
}

void expressions(Page& page) {
  Client client(page);
  ++page.ready;
  for (int k = 0;; ++k) {
    std::string text = std::to_string(1 + k % 10);
    while (text.size() + 7 <= 255) text += "+sin(t)";
    fs_curve* curve = nullptr;
    check(fs_curve_create_expression(text.c_str(), &curve), "fs_curve_create_expression");
    const Curve owned(curve);
    const fs_object object = custom_point("e" + std::to_string(k % 20), curve, 1);
    client.look(fs_object_set(client.scene(), &object));
  }
}

// ---- Clients that do not use the library.

using hostile::RawClient;

RawClient join(Page& page) {
  RawClient client(page.job.endpoint);
  client.join("hostile");
  return client;
}

void requests(Page& page) {  // as many as it can; it throws the answers away
  RawClient client = join(page);
  fs::wire::Target target{};
  std::strcpy(target.name, victim);
  ++page.ready;
  for (;;) {
    uint64_t last = 0;
    for (int i = 0; i < 32; ++i) last = client.send(fs::wire::type_report, target);
    if (!client.reply_of(last)) client = join(page);
  }
}

void deaf(Page& page) {  // sends requests, and reads no answers
  RawClient client = join(page);
  ++page.ready;
  for (int k = 0;; ++k) {
    client.send(k % 2 ? fs::wire::type_reports : fs::wire::type_clients);
    if (client.is_dropped()) client = join(page);
  }
}

void many_curves(Page& page) {  // has 10,000 curves, and gets an object with a curve of another client
  RawClient client = join(page);
  const double forces[] = {1, 2};
  for (uint64_t id = 1; id <= 10'000; ++id) {
    const fs::wire::Curve curve{id, 2, 1, {}};
    const fs::Descriptor data = fs::make_blob({fs::bytes_of(forces, 2)});
    client.send(fs::wire::type_curve, curve, data.get());
  }
  fs::wire::Target target{};
  std::strcpy(target.name, "honest/curved");
  client.ask(fs::wire::type_get, target);
  ++page.ready;
  for (;;) {
    uint64_t last = 0;
    for (int i = 0; i < 32; ++i) last = client.send(fs::wire::type_get, target);
    if (!client.reply_of(last)) client = join(page);
  }
}

// Changes wait for a mesh, thousands of them, while curves are done one after another.
void waiting_changes(Page& page) {
  const std::vector<fs_vec3> points = ordinary_points(300'000, 1);
  std::vector<uint32_t> corners(points.size());
  for (size_t i = 0; i < corners.size(); ++i) corners[i] = static_cast<uint32_t>(i);
  const fs::Descriptor data = fs::make_blob({fs::bytes_of(points.data(), points.size()),
                                             fs::bytes_of(corners.data(), corners.size())});
  ++page.ready;
  for (;;) {
    RawClient client = join(page);
    uint64_t id = 1;
    client.send(fs::wire::type_shape, fs::wire::Shape{id, FS_PRIMITIVE_MESH, 0, points.size(), corners.size() / 3},
                data.get());
    fs_object mesh = fs_object_init("mesh", FS_PRIMITIVE_MESH);
    mesh.front = fs_profile_init(FS_PROFILE_CONSTANT, FS_SENSE_REPULSIVE, 1, 0, 1);
    mesh.front.reach = 0.005;
    fs::wire::Object record = fs::to_record(mesh);
    record.shape = id;
    for (uint32_t i = 0; i < 2000; ++i) {
      fs::put_text(record.name, "m" + std::to_string(i));
      client.set(i, record);
    }
    for (uint32_t i = 0; i < 500; ++i) {
      client.expression(++id, "1");
      fs_object point = custom_point("p", nullptr, 1);
      fs::wire::Object of_curve = fs::to_record(point);
      of_curve.front.curve = id;
      client.set(2000, of_curve);
    }
    client.ask(fs::wire::type_sync);
  }
}

void a_process_that_computes(Page& page) {  // no attack: the cost of sharing the processors
  ++page.ready;
  for (;;) {
  }
}

void two_that_compute(Page& page) {  // as much load as a server that is asked all the time and its client
  if (fork() == 0) {
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    for (;;) {
    }
  }
  a_process_that_computes(page);
}

}  // namespace

const Attack attacks[] = {
    {"a process that only computes", a_process_that_computes},
    {"two processes that only compute", two_that_compute},
    {"another gain of a table of 62,501, 20 times a second", tables_at_times},
    {"the same, as often as it can", tables_at_once},
    {"groups of 120 such tables", groups_of_tables},
    {"meshes of 150,000 points whose hashes collide", colliding_meshes},
    {"meshes of 900,000 points, one after another", large_meshes},
    {"meshes of 3000 points, one after another", small_meshes},
    {"expressions of 255 bytes, each a new one", expressions},
    {"groups of 16,000 changes", largest_groups},
    {"4000 objects set and cleared", clears},
    {"changes of 100 objects, as many as it can", sets},
    {"moves of 4000 objects, as many as it can", moves},
    {"reports of 4000 objects", reports},
    {"32 requests at a time", requests},
    {"changes of another's object", edits},
    {"connects and leaves", comings_and_goings},
    {"asks and does not read", deaf},
    {"gets, among 10,000 curves of its own", many_curves},
    {"2000 changes wait for a mesh, others do not", waiting_changes},
};
const size_t attack_count = std::size(attacks);

}  // namespace bench
