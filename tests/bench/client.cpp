#include "client.h"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "figures.h"
#include "rig.h"
#include "scenes/random.h"

extern char** environ;

namespace bench {
namespace {

[[noreturn]] void stop(const char* what) {
  std::perror(what);
  std::_Exit(1);
}

Page* map_page(int descriptor) {
  void* memory = mmap(nullptr, sizeof(Page), PROT_READ | PROT_WRITE, MAP_SHARED, descriptor, 0);
  if (memory == MAP_FAILED) stop("mmap");
  return static_cast<Page*>(memory);
}

std::string object_name(int i) { return "object " + std::to_string(i); }

void fill(fs_scene* scene, const Job& job) {
  check(fs_scene_begin(scene), "fs_scene_begin");
  for (int i = 0; i < job.objects; ++i) {
    const std::string name = object_name(i);
    const fs_object object = job.work == Work::turn ? drawing_point(name.c_str()) : far_point(name.c_str(), i);
    check(fs_object_set(scene, &object), "fs_object_set");
  }
  check(fs_scene_commit(scene), "fs_scene_commit");
  check(fs_scene_sync(scene, 20), "fs_scene_sync");
}

// Each scene's objects all at once, as an application does in its frame; the scenes in turn.
void move_crowd(const std::vector<Scene>& scenes, Page& page, int number) {
  const Job& job = page.job;
  std::vector<fs_object> objects;
  for (int i = 0; i < job.objects; ++i) objects.push_back(far_point(object_name(i).c_str(), i));
  const double step = 1e9 / (job.rate * static_cast<double>(scenes.size()));
  const int64_t begin = now_ns() + static_cast<int64_t>(0.37 * number * step);
  for (int64_t k = 0; !page.is_ended; ++k) {
    sleep_until(begin + static_cast<int64_t>(static_cast<double>(k) * step));
    fs_scene* scene = scenes[static_cast<size_t>(k) % scenes.size()].get();
    for (fs_object& object : objects) {
      object.pose.position.z = 0.001 * static_cast<double>(k % 10);
      check(fs_object_move(scene, object.name, &object.pose, nullptr, FS_NOW), "fs_object_move");
    }
    page.moves.fetch_add(objects.size(), std::memory_order_relaxed);
  }
}

}  // namespace

int64_t private_bytes() {
  long pages = 0, shared = 0;
  std::FILE* file = std::fopen("/proc/self/statm", "r");
  if (!file || std::fscanf(file, "%*d %ld %ld", &pages, &shared) != 2) stop("/proc/self/statm");
  std::fclose(file);
  return int64_t{pages - shared} * sysconf(_SC_PAGESIZE);
}

void turn_at_random(fs_scene* scene, Page& page) {
  const fs_twist still{};
  scenes::Random random(5);
  while (page.turn_count < std::size(page.turns)) {
    sleep_for(random.between(page.job.shortest, page.job.longest));
    if (page.is_ended) return;
    const uint64_t k = page.turn_count;
    const fs_pose pose = on_circle(static_cast<int>(k % places), places);
    page.turns[k].time = now_ns();
    check(fs_object_move(scene, "object 0", &pose, &still, FS_NOW), "fs_object_move");
    page.turns[k].call = now_ns() - page.turns[k].time;
    page.turn_count = k + 1;
  }
}

Page& page_of_client(const char* page_descriptor) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  return *map_page(std::atoi(page_descriptor));
}

Samples latencies(const Page& page, const std::vector<Arrival>& arrivals, size_t& overtaken) {
  Samples out;
  const auto place_of = [](const Arrival& a) {
    const double angle = std::atan2(a.force.y, a.force.x) / (2 * M_PI);
    return static_cast<uint64_t>(std::lround((angle < 0 ? angle + 1 : angle) * places)) % places;
  };
  size_t next = 0;
  for (uint64_t k = 0; k < page.turn_count; ++k) {
    const int64_t end = k + places < page.turn_count ? page.turns[k + places].time : INT64_MAX;
    size_t i = next;
    while (i < arrivals.size() && arrivals[i].time < page.turns[k].time) ++i;
    while (i < arrivals.size() && arrivals[i].time < end && place_of(arrivals[i]) != k % places) ++i;
    if (i == arrivals.size() || arrivals[i].time >= end) {
      ++overtaken;
      continue;
    }
    out.add(static_cast<double>(arrivals[i].time - page.turns[k].time));
    next = i;
  }
  return out;
}

int run_client(const char* page_descriptor, const char* number_text) {
  Page& page = page_of_client(page_descriptor);
  const int number = std::atoi(number_text);
  const Job& job = page.job;
  const int64_t before = private_bytes();
  std::vector<Scene> scenes;
  for (int i = 0; i < job.scenes; ++i) {
    scenes.push_back(connect(job.endpoint, "client " + std::to_string(number) + "." + std::to_string(i)));
    fill(scenes.back().get(), job);
  }
  page.bytes += private_bytes() - before;
  ++page.ready;
  char byte;
  while (job.work != Work::idle && !page.is_begun) sleep_for(0.001);
  if (job.work == Work::turn) turn_at_random(scenes[0].get(), page);
  if (job.work == Work::crowd) move_crowd(scenes, page, number);
  while (read(STDIN_FILENO, &byte, 1) > 0) {
  }
  return 0;
}

Page* make_page(int& descriptor) {
  descriptor = memfd_create("bench-page", 0);  // stays open in the client
  if (descriptor < 0 || ftruncate(descriptor, sizeof(Page)) != 0) stop("memfd_create");
  return map_page(descriptor);
}

Job job(Work work, const std::string& endpoint, int scenes, int objects) {
  Job out{};
  out.work = work;
  std::snprintf(out.endpoint, sizeof out.endpoint, "%s", endpoint.c_str());
  out.scenes = scenes;
  out.objects = objects;
  return out;
}

Crew::Crew(const Job& job, int processes) {
  int descriptor, gate[2];
  page_ = make_page(descriptor);
  page_->job = job;
  if (pipe2(gate, O_CLOEXEC) != 0) stop("pipe");
  gate_ = gate[1];
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, gate[0], STDIN_FILENO);
  const std::string page = std::to_string(descriptor);
  for (int i = 0; i < processes; ++i) {
    const std::string number = std::to_string(i);
    const char* arguments[] = {"bench_server", "--client", page.c_str(), number.c_str(), nullptr};
    pid_t process;
    errno = posix_spawn(&process, "/proc/self/exe", &actions, nullptr, const_cast<char**>(arguments), environ);
    if (errno) stop("posix_spawn");
    processes_.push_back(process);
  }
  posix_spawn_file_actions_destroy(&actions);
  close(gate[0]);
  close(descriptor);
  while (page_->ready < processes) {
    int status;
    for (const pid_t process : processes_) {
      if (waitpid(process, &status, WNOHANG) == process) {
        std::fprintf(stderr, "a client process has ended too early\n");
        std::_Exit(1);
      }
    }
    sleep_for(0.005);
  }
}

void Crew::kill() {
  for (const pid_t process : processes_) ::kill(process, SIGKILL);
  end();
}

void Crew::end() {
  page_->is_ended = 1;
  if (gate_ >= 0) close(gate_);
  gate_ = -1;
  for (const pid_t process : processes_) waitpid(process, nullptr, 0);
  processes_.clear();
}

Crew::~Crew() {
  end();
  munmap(page_, sizeof *page_);
}

}  // namespace bench
