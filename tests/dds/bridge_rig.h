// Sites of a room on this machine, for tests: each has a servo with a simulated device, a server and a bridge. The servers are in
// the test's process, the bridges are processes of their own.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "api/world.h"
#include "scenes/handles.h"

namespace dds {

// A process that the test starts and ends.
class Process {
 public:
  Process() = default;
  explicit Process(const std::vector<std::string>& command);
  Process(Process&& other) noexcept { swap(other); }
  Process& operator=(Process&& other) noexcept {
    swap(other);
    return *this;
  }
  ~Process() { kill(); }

  void send(int signal) const;
  int end();   // by SIGTERM; its exit status, -1: it was killed
  int wait();  // until it ends by itself; as above
  void kill();
  std::string output() const;  // all so far
  bool is_running() const { return id_ > 0; }

 private:
  void swap(Process& other) noexcept {
    std::swap(id_, other.id_);
    std::swap(file_, other.file_);
  }
  int id_ = 0, file_ = -1;
};

// A room of its own, which no other test shares.
struct RoomName {
  RoomName();
  std::string room, domain;
};

struct SiteOptions {
  std::string device = "sim:?hold=0,0,0";
  fs_server_options server = fs_server_options_init();
  double fade = 0;  // s; 0: the servo's
  std::vector<std::string> bridge;  // options of it
};

class Site {
 public:
  Site(const RoomName& room, std::string name, const SiteOptions& options = {});
  ~Site();

  void start_server();
  void stop_server();
  void start_bridge();
  forceserver::Scene connect(const std::string& client) const { return forceserver::Scene::connect(endpoint, client); }

  const std::string name, endpoint;
  forceserver::Scene own;
  forceserver::Servo servo;
  Process bridge;

 private:
  const RoomName room_;
  const SiteOptions options_;
  forceserver::Device device_;
  forceserver::Server server_;
};

size_t objects_of(const forceserver::Scene& scene, const std::string& client);  // 0: also if it is not there
bool has_object(const forceserver::Scene& scene, const std::string& name);
double weight_of(const forceserver::Scene& scene, const std::string& name);  // 0: it is not there
fs_object spring_at(const std::string& name, fs_vec3 place);  // 100 N/m, 5 N at most

// Of a single move: without a twist one is worked out, and carries the object on past the pose (fs_object_move).
inline constexpr fs_twist at_rest{};

// Waits until it holds, or fails with the sentence and what the bridges said.
#define EVENTUALLY(condition)                                                                                      \
  ck_assert_msg(scenes::eventually([&] { return (condition); }), "never: %s", #condition)

}  // namespace dds
