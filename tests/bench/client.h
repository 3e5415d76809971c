// The client processes: this program again, with "--client". Server and clients share a page, and the clients leave
// when their standard input ends.
#pragma once

#include <sys/types.h>

#include <atomic>
#include <string>
#include <vector>

#include <forceserver/forceserver.h>

#include "device.h"
#include "figures.h"

namespace bench {

enum class Work : int {
  idle,   // connect, set the objects, and no more
  turn,   // one object, turned about the hand at random moments
  crowd,  // moves all objects `rate` times a second, the scenes one after another
  other,  // whatever the program defines; its parameter is `rate`
};

struct Job {
  Work work;
  char endpoint[64];
  int scenes, objects;           // a process; a scene
  double rate;                   // crowd: Hz
  double shortest, longest;      // turn: s between two moves
};

inline constexpr int places = 16;  // of the turned object: move k is known by the direction k % 16

struct Turn {
  int64_t time, call;            // ns: when the object was moved, and how long the call took
};

struct Page {
  Job job;
  std::atomic<int> ready;        // processes whose objects are felt
  std::atomic<int> is_begun, is_ended;
  std::atomic<uint64_t> moves;   // made by all
  std::atomic<int64_t> bytes;    // private memory that connecting and setting took, of all
  std::atomic<uint64_t> turn_count;
  Turn turns[1 << 15];
  // Times, ns, of a client that also sends requests and meshes.
  std::atomic<uint64_t> request_count, mesh_count, failures;
  double requests[1 << 15], meshes[1 << 12];
};

// Client processes that run as long as this object lives.
class Crew {
 public:
  Crew(const Job& job, int processes);  // returns when all objects are felt
  ~Crew();
  void kill();                          // at once, whatever they are doing
  void begin() { page_->is_begun = 1; }
  void end();                           // ends them, and waits until they have left
  Page& page() { return *page_; }

 private:
  Page* page_;
  int gate_ = -1;                       // their standard input
  std::vector<pid_t> processes_;
};
Job job(Work work, const std::string& endpoint, int scenes, int objects);

int run_client(const char* page_descriptor, const char* number);  // main, in a client process
int64_t private_bytes();                                          // of this process

// Turns the object about the hand until the page says that it is over. For comparison also in the server's process.
void turn_at_random(fs_scene* scene, Page& page);
Page* make_page(int& descriptor);
Page& page_of_client(const char* page_descriptor);                // in a client process

// From each move to the write of the force that comes of it, ns. overtaken: the next move came before a tick.
Samples latencies(const Page& page, const std::vector<Arrival>& arrivals, size_t& overtaken);

}  // namespace bench
