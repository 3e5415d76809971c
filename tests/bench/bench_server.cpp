// What the shared-memory server costs: the move of an object and its way to the device, the servo's lateness, processor
// and memory for each client. Prints a table; README.md has one. bench_server [--quick] DATA_FILE
//
// Each part runs in a process of its own. The clients are processes too: this program again (client.h).
#include <dirent.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <functional>
#include <numeric>
#include <sstream>
#include <thread>

#include "client.h"
#include "device.h"
#include "figures.h"
#include "ipc/region.h"
#include "rig.h"
#include "transfer/records.h"
#include "transfer/shared_memory.h"
#include "scenes/random.h"

using namespace bench;

namespace {

bool is_quick = false;
double seconds(double full, double quick) { return is_quick ? quick : full; }
size_t count(size_t full) { return is_quick ? full / 4 : full; }

template <class T>
void keep(const T& value) {  // so that the compiler cannot leave it out
  asm volatile("" : : "r"(&value) : "memory");
}

// Runs f in a process of its own.
void in_process(const std::function<void()>& f) {
  std::fflush(nullptr);
  const pid_t process = fork();
  if (process == 0) {
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    f();
    std::fflush(nullptr);
    std::_Exit(0);
  }
  int status = 0;
  if (process < 0 || waitpid(process, &status, 0) != process || status != 0) {
    std::fprintf(stderr, "bench_server: a part has failed\n");
    std::exit(1);
  }
}

// What f(number of the call) takes, ns: the mean of each batch of calls, the clock being read before and after it.
template <class F>
Samples time_batches(size_t batches, size_t calls, F f) {
  Samples out;
  size_t number = 0;
  for (size_t i = 0; i < batches + batches / 10; ++i) {
    const int64_t begin = now_ns();
    for (size_t k = 0; k < calls; ++k) f(number++);
    const auto time = static_cast<double>(now_ns() - begin);
    if (i >= batches / 10) out.add(time / static_cast<double>(calls));  // not the first, so that caches are warm
  }
  return out;
}

std::vector<uint32_t> shuffled(uint32_t n) {
  std::vector<uint32_t> out(n);
  std::iota(out.begin(), out.end(), 0u);
  scenes::Random random(1);
  for (uint32_t i = n; i > 1; --i) std::swap(out[i - 1], out[random.below(i)]);
  return out;
}

fs::wire::Move some_move(size_t number) {
  fs::wire::Move move{};
  move.after = 1;
  move.motion.pose = {{0.1, 0.1, 1e-6 * static_cast<double>(number)}, {1, 0, 0, 0}};
  move.motion.time = 1;
  return move;
}

// ------------------------------------------------------------------------------------------------------------ writing

void part_write() {
  constexpr size_t calls = 64;
  const size_t batches = count(20000);
  const Samples empty = time_batches(batches, calls, [](size_t) { keep(fs_version()); });
  const Samples clock = time_batches(batches, calls, [](size_t) { keep(now_ns()); });
  table_row("write: an empty call", Unit::time, empty);
  table_row("write: a look at the clock", Unit::time, clock, {"empty call", &empty});

  Rig rig(real_time);
  const fs_twist twist{{0.01, 0, 0}, {}};
  for (const uint32_t n : {1u, 4000u}) {
    const std::string of = " of " + std::to_string(n);
    const std::vector<uint32_t> order = shuffled(n);
    const auto object = [&](size_t number) { return order[number % n]; };

    std::vector<fs::Seqlock<fs::wire::Move>> records(n);
    const Samples plain = time_batches(batches, calls, [&](size_t i) { records[object(i)].write(some_move(i)); });
    table_row("write: a plain seqlock" + of, Unit::time, plain, {"empty call", &empty});

    const std::unique_ptr<char[], decltype(&std::free)> memory(
        static_cast<char*>(std::aligned_alloc(4096, (fs::Inbox::bytes(n) + 4095) / 4096 * 4096)), &std::free);
    std::memset(memory.get(), 0, fs::Inbox::bytes(n));
    fs::Inbox inbox(memory.get(), n);
    const Samples slot = time_batches(batches, calls, [&](size_t i) { inbox.write(object(i), some_move(i)); });
    table_row("write: a slot of an inbox" + of, Unit::time, slot, {"plain seqlock", &plain});

    const auto time_moves = [&](const char* what, const Scene& scene) {
      struct Name {
        char text[FS_NAME_SIZE];
      };
      std::vector<Name> names(n);
      check(fs_scene_begin(scene.get()), "fs_scene_begin");
      for (uint32_t i = 0; i < n; ++i) {
        std::snprintf(names[i].text, sizeof names[i].text, "object %u", i);
        const fs_object object = far_point(names[i].text, static_cast<int>(i));
        check(fs_object_set(scene.get(), &object), "fs_object_set");
      }
      check(fs_scene_commit(scene.get()), "fs_scene_commit");
      check(fs_scene_sync(scene.get(), 20), "fs_scene_sync");
      const auto move = [&](const char* how, const fs_twist* given) {
        const Samples times = time_batches(batches, calls, [&](size_t i) {
          const fs_pose pose = some_move(i).motion.pose;
          fs_object_move(scene.get(), names[object(i)].text, &pose, given, FS_NOW);
        });
        table_row(std::string("write: fs_object_move, ") + what + ", " + how + of, Unit::time, times,
                  {"plain seqlock", &plain});
      };
      move("twist given", &twist);
      move("no twist", nullptr);
    };
    time_moves("connected", connect(rig.endpoint, "writer" + std::to_string(n)));
    time_moves("in process", make_scene());
  }

  // One call at a time, including the cost of the clock; and the first call after the server has gone to sleep.
  const Scene scene = connect(rig.endpoint, "single");
  fs_object o = far_point("object", 0);
  check(fs_object_set(scene.get(), &o), "fs_object_set");
  check(fs_scene_sync(scene.get(), 20), "fs_scene_sync");
  const auto move = [&](size_t) {
    o.pose.position.z += 1e-6;
    fs_object_move(scene.get(), o.name, &o.pose, &twist, FS_NOW);
  };
  const Samples single_clock = time_batches(count(100000), 1, [](size_t) {});
  const Samples single = time_batches(count(100000), 1, move);
  table_row("write: nothing, each timed alone", Unit::time, single_clock);
  table_row("write: fs_object_move, connected, each timed alone", Unit::time, single, {"nothing", &single_clock});
  Samples first;
  for (size_t i = 0; i < count(40); ++i) {
    sleep_for(0.15);
    const int64_t begin = now_ns();
    move(i);
    first.add(static_cast<double>(now_ns() - begin));
  }
  table_row("write: fs_object_move, connected, the server asleep", Unit::time, first, {"nothing", &single_clock});
}

// ------------------------------------------------------------------------------------------------------------ reading

// What a record takes that the server reads: `n` of 4096 were written, by this thread or by one on another processor.
void time_reads(uint32_t n, bool from_elsewhere) {
  constexpr uint32_t slots = 4096;
  const std::unique_ptr<char[], decltype(&std::free)> memory(
      static_cast<char*>(std::aligned_alloc(4096, (fs::Inbox::bytes(slots) + 4095) / 4096 * 4096)), &std::free);
  std::memset(memory.get(), 0, fs::Inbox::bytes(slots));
  fs::Inbox inbox(memory.get(), slots);
  std::vector<fs::Seqlock<fs::wire::Move>> records(slots);
  const std::vector<uint32_t> order = shuffled(slots);

  const auto write = [&](size_t number) {
    for (uint32_t i = 0; i < n; ++i) {
      inbox.write(order[i], some_move(number));
      records[order[i]].write(some_move(number));
    }
  };
  std::atomic<size_t> asked{0}, done{0};
  std::thread writer;
  if (from_elsewhere) {
    writer = std::thread([&] {
      for (size_t number = 1; number != SIZE_MAX; ++number) {
        size_t wanted;
        while ((wanted = asked.load(std::memory_order_acquire)) < number) sched_yield();
        if (wanted == SIZE_MAX) return;
        write(number);
        done.store(number, std::memory_order_release);
      }
    });
  }
  Samples taken, plain;
  // Few records are soon read: then several rounds make a sample, each with its own two looks at the clock.
  const size_t rounds = std::max<size_t>(1, 100 / n), samples = count(n > 1000 ? 1000 : 4000);
  uint64_t sum = 0;
  size_t number = 0;
  for (size_t k = 0; k < samples; ++k) {
    int64_t taking = 0, reading = 0;
    for (size_t i = 0; i < rounds; ++i) {
      ++number;
      if (from_elsewhere) {
        asked.store(number, std::memory_order_release);
        while (done.load(std::memory_order_acquire) < number) {
        }
      } else {
        write(number);
      }
      fs::wire::Move move;
      fs::Motion motion;
      const int64_t begin = now_ns();
      inbox.take_dirty([&](uint32_t slot) {
        if (inbox.read(slot, move) && fs::from_record(move.motion, motion)) sum += move.after;
      });
      const int64_t middle = now_ns();
      for (uint32_t r = 0; r < n; ++r) {
        if (records[order[r]].read(move)) sum += move.after;
        keep(move);
      }
      taking += middle - begin;
      reading += now_ns() - middle;
    }
    taken.add(static_cast<double>(taking) / static_cast<double>(rounds * n));
    plain.add(static_cast<double>(reading) / static_cast<double>(rounds * n));
  }
  if (from_elsewhere) {
    asked = SIZE_MAX;
    writer.join();
  }
  if (sum != 2 * uint64_t{samples} * rounds * n) progress("some records were not read");
  const std::string of = std::to_string(n) + " of 4096, written " + (from_elsewhere ? "elsewhere" : "here");
  table_row("read: a plain seqlock, " + of, Unit::time, plain);
  table_row("read: taken and checked, " + of, Unit::time, taken, {"plain seqlock", &plain});
}

void part_read() {
  for (const bool from_elsewhere : {false, true}) {
    for (const uint32_t n : {1u, 100u, 4000u}) time_reads(n, from_elsewhere);
  }
}

// ------------------------------------------------------------------------------------------------------------ latency

// One thread per processor that works all the time, at ordinary priority.
class Load {
 public:
  explicit Load(bool is_there) {
    if (!is_there) return;
    for (long i = 0; i < sysconf(_SC_NPROCESSORS_ONLN); ++i) {
      threads_.emplace_back([this] {
        while (!is_ended_) {
        }
      });
    }
  }
  ~Load() {
    is_ended_ = true;
    for (std::thread& thread : threads_) thread.join();
  }

 private:
  std::atomic<bool> is_ended_{false};
  std::vector<std::thread> threads_;
};

void part_latency() {
  struct Pace {
    const char* name;
    double shortest, longest, full, quick;  // s
    bool is_loaded;
  };
  const Pace awake{"200 Hz", 0.003, 0.007, 8, 1.5, false}, asleep{"5 Hz: the server sleeps", 0.1, 0.3, 12, 2, false},
      loaded{"200 Hz, processors busy", 0.003, 0.007, 6, 1.5, true};
  for (const int priority : {real_time, ordinary}) {
    const std::string how = priority == real_time ? "real-time servo, " : "ordinary servo, ";
    Samples here;
    const auto measure = [&](const Pace& pace, bool is_connected) {
      progress("latency: %s%s, %s ...", how.c_str(), pace.name, is_connected ? "connected" : "in process");
      std::unique_ptr<Rig> rig = std::make_unique<Rig>(priority);
      Job work = job(Work::turn, rig->endpoint, 1, 1);
      work.shortest = pace.shortest;
      work.longest = pace.longest;
      Crew crew(work, is_connected ? 1 : 0);
      Page& page = crew.page();
      std::thread thread;
      if (!is_connected) {
        const fs_object object = drawing_point("object 0");
        check(fs_object_set(rig->scene.get(), &object), "fs_object_set");
        thread = std::thread([&] { turn_at_random(rig->scene.get(), page); });
      }
      {
        const Load load(pace.is_loaded);
        crew.begin();
        sleep_for(seconds(pace.full, pace.quick));
        page.is_ended = 1;
        if (!is_connected) thread.join();
        sleep_for(0.05);
      }
      rig.reset();
      size_t overtaken = 0;
      const Samples samples = latencies(page, take_arrivals(), overtaken);
      if (overtaken) progress("  %zu moves were overtaken by the next", overtaken);
      const std::string name = "latency: " + how + (is_connected ? "" : "in process, ") + pace.name;
      if (is_connected) {
        table_row(name, Unit::time, samples, {"in process", &here});
        if (priority == real_time && !pace.is_loaded) {
          Samples calls;
          for (uint64_t k = 0; k < page.turn_count; ++k) calls.add(static_cast<double>(page.turns[k].call));
          table_row("latency: the call itself, " + std::string(pace.name), Unit::time, calls);
        }
      } else {
        here = samples;
        table_row(name, Unit::time, samples);
      }
    };
    measure({awake.name, awake.shortest, awake.longest, 5, 1, false}, false);
    measure(awake, true);
    measure(asleep, true);
    measure(loaded, true);
  }
}

// --------------------------------------------------------------------------------------------- lateness and processor

// cyclictest beside us: when each ms it woke up, ns after it should have.
class Cyclictest {
 public:
  explicit Cyclictest(double time) {
    char command[200];
    std::snprintf(command, sizeof command,
                  "cyclictest -q -m -N -t 1 -p 80 -i 1000 -D %d -h 1000000 --default-system 2>/dev/null"
                  " | grep -v ' 000000$'", static_cast<int>(std::ceil(time)));
    pipe_ = popen(command, "r");
  }
  Samples result() {
    Samples out;
    char line[200];
    double longest = 0;
    long time, number;
    while (std::fgets(line, sizeof line, pipe_)) {
      if (std::sscanf(line, "%ld %ld", &time, &number) == 2) {
        out.values.insert(out.values.end(), static_cast<size_t>(number), static_cast<double>(time));
      } else if (std::sscanf(line, "# Max Latencies: %lf", &longest) == 1) {
        // Values above the range of the histogram; only the largest of them is known.
      } else if (std::sscanf(line, "# Histogram Overflows: %ld", &number) == 1) {
        out.values.insert(out.values.end(), static_cast<size_t>(number), longest);
      }
    }
    pclose(pipe_);
    return out;
  }
  static bool is_there() { return std::system("command -v cyclictest > /dev/null") == 0; }

 private:
  std::FILE* pipe_;
};

pid_t thread_of_name(const char* wanted) {
  DIR* list = opendir("/proc/self/task");
  pid_t found = 0;
  while (const dirent* entry = readdir(list)) {
    std::ifstream file(std::string("/proc/self/task/") + entry->d_name + "/comm");
    std::string name;
    if (std::getline(file, name) && name == wanted) found = std::atoi(entry->d_name);
  }
  closedir(list);
  return found;
}

// The moves that the server has taken of all clients.
uint64_t moves_taken(fs_scene* watcher) {
  std::vector<fs_client> clients(200);
  size_t n = 0;
  check(fs_scene_get_clients(watcher, clients.data(), clients.size(), &n), "fs_scene_get_clients");
  uint64_t sum = 0;
  for (size_t i = 0; i < std::min(n, clients.size()); ++i) sum += clients[i].moves;
  return sum;
}

struct LoadCase {
  const char* name;
  int processes, scenes;  // and scenes a process
  Work work;
  bool is_beside;         // cyclictest at the same time
};
struct LoadFigures {
  Samples late, servo, server, beside;
  Samples taken, written;  // moves a second
  Samples p50, p99;        // of late, by those of cyclictest beside it, or alone in the same round

  void add(const LoadFigures& round, const Samples& alone) {
    const Samples& peer = round.beside.values.empty() ? alone : round.beside;
    if (!peer.values.empty()) {
      p50.add(round.late.p50() / peer.p50());
      p99.add(round.late.p99() / peer.p99());
    }
    late.add(round.late);
    servo.add(round.servo);
    server.add(round.server);
    beside.add(round.beside);
    taken.add(round.taken);
    written.add(round.written);
  }
};

LoadFigures measure_load(const LoadCase& c, double time) {
  progress("load: %s%s ...", c.name, c.is_beside ? ", cyclictest beside it" : "");
  LoadFigures out;
  Rig rig(real_time);
  Job work = job(c.work, rig.endpoint, c.scenes, c.work == Work::crowd ? 100 : 0);
  work.rate = 25;
  Crew crew(work, c.processes);
  const Scene watcher = c.work == Work::crowd ? connect(rig.endpoint, "watcher") : nullptr;
  crew.begin();
  sleep_for(0.5);
  const pid_t servo = servo_thread(), server = thread_of_name("fs-server");
  std::unique_ptr<Cyclictest> cyclictest;
  if (c.is_beside) cyclictest = std::make_unique<Cyclictest>(time);
  const uint64_t taken = watcher ? moves_taken(watcher.get()) : 0, written = crew.page().moves;

  // The lateness of each tick, from the flight record: it holds 2 s.
  std::vector<fs_tick> record(4000);
  double newest = -1;
  const auto read_record = [&](bool is_first) {
    size_t n = 0;
    check(fs_servo_get_record(rig.servo.get(), record.data(), record.size(), &n), "fs_servo_get_record");
    for (size_t i = 0; i < n; ++i) {
      if (!is_first && record[i].state.time > newest) out.late.add(1e9 * record[i].late);
    }
    if (n) newest = std::max(newest, record[n - 1].state.time);
  };
  read_record(true);
  int64_t before = now_ns(), servo_before = processor_time(servo), server_before = processor_time(server);
  const int64_t begin = before, end = begin + static_cast<int64_t>(1e9 * time);
  for (int64_t now = before; now < end;) {
    sleep_for(0.25);
    now = now_ns();
    const int64_t servo_now = processor_time(servo), server_now = processor_time(server);
    const auto part = [&](int64_t used) { return 100 * static_cast<double>(used) / static_cast<double>(now - before); };
    out.servo.add(part(servo_now - servo_before));
    out.server.add(part(server_now - server_before));
    before = now, servo_before = servo_now, server_before = server_now;
    read_record(false);
  }
  if (watcher) {
    const double passed = 1e-9 * static_cast<double>(now_ns() - begin);
    out.written.add(static_cast<double>(crew.page().moves - written) / passed);
    out.taken.add(static_cast<double>(moves_taken(watcher.get()) - taken) / passed);
  }
  const fs_servo_stats stats = rig.stats();
  if (stats.faults || stats.misses) {
    progress("  faults %u, ticks missed %llu", stats.faults, static_cast<unsigned long long>(stats.misses));
  }
  if (cyclictest) out.beside = cyclictest->result();
  return out;
}

// Rounds of cyclictest alone and of each case, so that each is compared with what the machine was like just then.
void part_load() {
  const bool has_cyclictest = Cyclictest::is_there();
  if (!has_cyclictest) progress("cyclictest is not installed (Debian: rt-tests): the servo is not compared with it");
  const double time = seconds(2, 1.5);
  const int rounds = is_quick ? 1 : 5;
  const LoadCase cases[] = {
      {"no client", 0, 0, Work::idle, false},
      {"1 client, idle", 1, 1, Work::idle, false},
      {"64 clients, idle", 8, 8, Work::idle, false},
      {"64 clients, idle", 8, 8, Work::idle, true},
      {"1 client, 100 objects at 25 Hz", 1, 1, Work::crowd, false},
      {"64 clients, 100 objects each at 25 Hz", 8, 8, Work::crowd, false},
      {"64 clients, 100 objects each at 25 Hz", 8, 8, Work::crowd, true},
  };
  std::vector<std::pair<const LoadCase*, LoadFigures>> all;
  for (const LoadCase& c : cases) {
    if (!c.is_beside || has_cyclictest) all.emplace_back(&c, LoadFigures());
  }
  Samples alone;
  for (int round = 1; round <= rounds; ++round) {
    Samples now;
    if (has_cyclictest) {
      progress("load, round %d of %d: cyclictest alone ...", round, rounds);
      now = Cyclictest(time).result();
      alone.add(now);
    }
    for (auto& [c, figures] : all) figures.add(measure_load(*c, time), now);
  }

  table_row("late: cyclictest alone", Unit::time, alone);
  for (const auto& [c, figures] : all) {
    const std::string name = std::string("late: ") + c->name;
    if (c->is_beside) table_row(std::string("late: cyclictest beside ") + c->name, Unit::time, figures.beside);
    table_row(name + (c->is_beside ? ", beside it" : ""), Unit::time, figures.late);
    if (!has_cyclictest) continue;
    const std::string of = name + (c->is_beside ? ", by cyclictest beside it" : ", by cyclictest alone");
    table_row(of + ": p50", Unit::ratio, figures.p50);
    table_row(of + ": p99", Unit::ratio, figures.p99);
  }
  const LoadFigures& none = all.front().second;
  for (const auto& [c, figures] : all) {
    if (c->is_beside) continue;
    table_row(std::string("servo thread: ") + c->name, Unit::percent, figures.servo, {"no client", &none.servo});
    table_row(std::string("server thread: ") + c->name, Unit::percent, figures.server, {"no client", &none.server});
    if (c->work == Work::crowd) {
      table_row(std::string("moves written: ") + c->name, Unit::rate, figures.written);
      table_row(std::string("moves taken: ") + c->name, Unit::rate, figures.taken);
      if (c->processes > 1) {
        const double used = 1e7 * (figures.server.p50() - none.server.p50());  // ns a second
        table_row(std::string("server thread a move: ") + c->name, Unit::time, used / figures.taken.p50());
      }
    }
  }
}

// ------------------------------------------------------------------------------------------------------------- memory

// The size of the memory that is shared with clients, whichever process has touched it.
int64_t shared_bytes() {
  std::ifstream maps("/proc/self/maps");
  int64_t sum = 0;
  const auto page = static_cast<size_t>(sysconf(_SC_PAGESIZE));
  for (std::string line; std::getline(maps, line);) {
    unsigned long begin, end;
    if (line.find("memfd:forceserver-") == std::string::npos) continue;
    if (std::sscanf(line.c_str(), "%lx-%lx", &begin, &end) != 2) continue;
    std::vector<unsigned char> there((end - begin) / page);
    mincore(reinterpret_cast<void*>(begin), end - begin, there.data());
    for (const unsigned char is_there : there) sum += (is_there & 1) ? static_cast<int64_t>(page) : 0;
  }
  return sum;
}

void measure_memory(int clients, int objects) {
  const std::string name = std::to_string(objects) + " objects";
  progress("memory: %d clients of %s ...", clients, name.c_str());
  const Rig rig(ordinary, 100);  // slow, as these are too many objects for 1 kHz
  sleep_for(0.2);
  const int64_t before = private_bytes(), shared_before = shared_bytes();
  Crew crew(job(Work::idle, rig.endpoint, clients, objects), 1);
  sleep_for(0.5);
  const auto each = [&](int64_t bytes) { return static_cast<double>(bytes) / clients; };
  table_row("memory: a client at the server, " + name, Unit::bytes, each(private_bytes() - before));
  table_row("memory: shared by both, " + name, Unit::bytes, each(shared_bytes() - shared_before));
  table_row("memory: in the client, " + name, Unit::bytes, each(crew.page().bytes));
}

void part_memory() {
  in_process([] { measure_memory(32, 0); });
  in_process([] { measure_memory(32, 100); });
  in_process([] { measure_memory(4, 4000); });
  // If a process may lock all its memory, and does, all that it maps exists at once.
  const size_t all = fs::Inbox::bytes(4096) + sizeof(fs::Outbox);
  table_row("memory: shared by both, all of it", Unit::bytes, static_cast<double>(all));
}

// -------------------------------------------------------------------------------------------------------------- lists

// How long a viewer waits for the places of all objects.
void part_lists() {
  constexpr int n = 200;
  const auto fill = [](fs_scene* scene, int objects, bool enabled = true) {
    check(fs_scene_begin(scene), "fs_scene_begin");
    for (int i = 0; i < objects; ++i) {
      fs_object object = far_point(("object " + std::to_string(i)).c_str(), i);
      object.enabled = enabled;
      check(fs_object_set(scene, &object), "fs_object_set");
    }
    check(fs_scene_commit(scene), "fs_scene_commit");
    check(fs_scene_sync(scene, 20), "fs_scene_sync");
  };
  const auto motions = [](fs_scene* scene, std::vector<fs_motion>& out) {
    size_t there = 0;
    check(fs_scene_get_motions(scene, nullptr, out.data(), out.size(), &there), "fs_scene_get_motions");
    keep(out);
  };
  {
    const Rig rig(ordinary);
    const Scene owner = connect(rig.endpoint, "owner"), viewer = connect(rig.endpoint, "viewer"), here = make_scene();
    fill(owner.get(), n);
    fill(here.get(), n);
    std::vector<std::string> names;
    for (int i = 0; i < n; ++i) names.push_back("owner/object " + std::to_string(i));
    std::vector<fs_motion> list(n);
    std::vector<fs_report> reports(n);
    const auto get = [&](size_t i) {
      fs_object object = fs_object_init("", FS_PRIMITIVE_POINT);
      check(fs_object_get(viewer.get(), names[i % n].c_str(), &object), "fs_object_get");
      fs_object_release(&object);
    };
    const Samples one = time_batches(count(2000), 1, [&](size_t) { motions(viewer.get(), list); });
    const Peer peer{"fs_scene_get_motions", &one};
    table_row("lists: 200 objects of another client, fs_scene_get_motions", Unit::time, one);
    table_row("lists: the same, fs_scene_get_reports", Unit::time, time_batches(count(2000), 1, [&](size_t) {
                size_t there = 0;
                check(fs_scene_get_reports(viewer.get(), reports.data(), n, &there), "fs_scene_get_reports");
              }), peer);
    table_row("lists: the same, 200 times fs_object_get", Unit::time, time_batches(count(100), 1, [&](size_t) {
                for (size_t i = 0; i < n; ++i) get(i);
              }), peer);
    table_row("lists: one fs_object_get", Unit::time, time_batches(count(2000), 1, get), peer);
    table_row("lists: fs_scene_get_view", Unit::time, time_batches(count(2000), 1, [&](size_t) {
                fs_view view;
                check(fs_scene_get_view(viewer.get(), "owner", &view), "fs_scene_get_view");
              }), peer);
    table_row("lists: 200 own objects, in process, fs_scene_get_motions", Unit::time,
              time_batches(count(2000), 1, [&](size_t) { motions(here.get(), list); }), peer);
  }
  // Many objects, and another client that asks for little meanwhile: its requests wait for one whole list at most, its
  // moves for none.
  constexpr int many = 65536;
  const Rig rig(ordinary, 200);  // slow, as these are too many objects for 1 kHz
  const Scene viewer = connect(rig.endpoint, "viewer"), other = connect(rig.endpoint, "other");
  fill(rig.scene.get(), many, false);
  std::vector<fs_motion> list(many);
  const auto ask = [&] {
    Samples out;
    for (size_t i = 0; i < count(1000); ++i) {
      sleep_for(1e-3);
      const int64_t begin = now_ns();
      fs_frame frame;
      check(fs_scene_get_frame(other.get(), nullptr, &frame), "fs_scene_get_frame");
      out.add(static_cast<double>(now_ns() - begin));
    }
    return out;
  };
  const Samples alone = ask();
  table_row("lists: 65,536 objects, fs_scene_get_motions", Unit::time,
            time_batches(count(100), 1, [&](size_t) { motions(viewer.get(), list); }));
  std::atomic<bool> is_over{false};
  std::thread thread([&] {
    while (!is_over) motions(viewer.get(), list);
  });
  table_row("lists: another's fs_scene_get_frame meanwhile", Unit::time, ask(), {"alone", &alone});
  is_over = true;
  thread.join();
}

// --------------------------------------------------------------------------------------------------------------- parts

void print_realtime() {
  const Rig rig(real_time);
  const char* const names[] = {"none", "a better nice value", "SCHED_FIFO", "SCHED_FIFO, memory locked"};
  std::printf("Real-time granted to the servo: %s\n\n", names[rig.stats().realtime]);
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc == 4 && !std::strcmp(argv[1], "--client")) return run_client(argv[2], argv[3]);
  std::string file, only;
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    if (argument == "--quick") {
      is_quick = true;
    } else if (argument.starts_with("--only=")) {
      only = argument.substr(7);
    } else if (file.empty() && !argument.starts_with("-")) {
      file = argument;
    }
  }
  if (file.empty()) {
    std::fprintf(stderr, "usage: bench_server [--quick] [--only=write|read|lists|latency|load|memory] DATA_FILE\n");
    return 2;
  }
  const auto part = [&](const char* name, const std::function<void()>& f) {
    if (only.empty() || only == name) in_process(f);
  };
  print_machine();
  in_process(print_realtime);
  table_begin(file);
  part("write", part_write);
  part("read", part_read);
  part("lists", part_lists);
  part("latency", part_latency);
  part("load", part_load);
  part("memory", part_memory);
  std::printf("\nAll samples: %s\n", file.c_str());
  return 0;
}
