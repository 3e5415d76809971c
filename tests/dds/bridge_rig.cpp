#include "dds/bridge_rig.h"

#include <signal.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <random>

extern char** environ;

namespace dds {

using forceserver::Device;
using forceserver::Scene;
using forceserver::Server;
using forceserver::Servo;

Process::Process(const std::vector<std::string>& command) {
  std::vector<char*> words;
  for (const std::string& word : command) words.push_back(const_cast<char*>(word.c_str()));
  words.push_back(nullptr);
  file_ = memfd_create("output", 0);
  posix_spawn_file_actions_t files;
  posix_spawn_file_actions_init(&files);
  posix_spawn_file_actions_addopen(&files, 0, "/dev/null", 0, 0);
  posix_spawn_file_actions_adddup2(&files, file_, 1);
  posix_spawn_file_actions_adddup2(&files, file_, 2);
  pid_t id = 0;
  if (posix_spawn(&id, words[0], &files, nullptr, words.data(), environ) != 0) {
    std::perror(words[0]);
    std::abort();
  }
  posix_spawn_file_actions_destroy(&files);
  id_ = id;
}

void Process::send(int signal) const {
  if (id_ > 0) ::kill(id_, signal);
}

int Process::wait() {
  int status = 0;
  const bool has_ended = scenes::eventually([&] { return waitpid(id_, &status, WNOHANG) == id_; });
  if (!has_ended) {
    kill();
    return -1;
  }
  id_ = 0;
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

int Process::end() {
  send(SIGTERM);
  return wait();
}

void Process::kill() {
  if (id_ > 0) {
    ::kill(id_, SIGKILL);
    waitpid(id_, nullptr, 0);
  }
  id_ = 0;
  if (file_ >= 0) close(file_);
  file_ = -1;
}

std::string Process::output() const {
  std::string out;
  char piece[4096];
  off_t at = 0;
  for (ssize_t count; file_ >= 0 && (count = pread(file_, piece, sizeof piece, at)) > 0; at += count) out.append(piece, count);
  return out;
}

RoomName::RoomName() {
  std::random_device random;
  room = "test" + std::to_string(getpid()) + "-" + std::to_string(random() % 1000000);
  domain = std::to_string(1 + random() % 200);
}

Site::Site(const RoomName& room, std::string the_name, const SiteOptions& options)
    : name(std::move(the_name)), endpoint("shm:" + room.room + name), room_(room), options_(options) {
  start_server();
  start_bridge();
}

Site::~Site() {
  bridge.kill();
  stop_server();
}

void Site::start_server() {
  own = Scene::create();
  device_ = Device::open(options_.device);
  fs_servo_options servo_options = fs_servo_options_init();
  servo_options.fade = options_.fade;
  servo_options.priority = -1;
  servo = Servo::start(own, device_, &servo_options);
  fs_server_options server_options = options_.server;
  server_ = Server::start(servo, endpoint, &server_options);
}

void Site::stop_server() {
  server_ = {};
  servo = {};
  device_ = {};
  own = {};
}

void Site::start_bridge() {
  std::vector<std::string> command = {BRIDGE, endpoint, "--site", name, "--room", room_.room, "--domain", room_.domain};
  command.insert(command.end(), options_.bridge.begin(), options_.bridge.end());
  bridge = Process(command);
}

double weight_of(const Scene& scene, const std::string& name) {
  fs_report report{};
  return fs_scene_get_report(scene.get(), name.c_str(), &report) == FS_OK ? report.weight : 0;
}

bool has_object(const Scene& scene, const std::string& name) {
  fs_object object = fs_object_init("", FS_PRIMITIVE_POINT);
  const fs_status status = fs_object_get(scene.get(), name.c_str(), &object);
  fs_object_release(&object);
  return status == FS_OK;
}

size_t objects_of(const Scene& scene, const std::string& client) {
  size_t count = 0;
  return fs_scene_get_motions(scene.get(), client.c_str(), nullptr, 0, &count) == FS_OK ? count : 0;
}

fs_object spring_at(const std::string& name, fs_vec3 place) {
  fs_object out = fs_object_init(name.c_str(), FS_PRIMITIVE_POINT);
  out.front = fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, 100, 0, 5);
  out.pose.position = place;
  return out;
}

}  // namespace dds
