// This program again as another process: a client or a server that is killed, stopped, forked, or of another user. Its
// arguments say what to do. It reports on standard output, line by line, and reads lines from standard input, which is
// closed when the process that started it no longer needs it.
#pragma once

#include <sys/types.h>

#include <csignal>
#include <string>
#include <vector>

namespace life {

class Process {
 public:
  Process() = default;
  explicit Process(const std::vector<std::string>& arguments);
  Process(Process&& other) noexcept { swap(other); }
  Process& operator=(Process&& other) noexcept {
    swap(other);
    return *this;
  }
  ~Process();  // kills it, if it is still there

  pid_t id() const { return id_; }
  // Its next line, within so long (s); a line that is cut off by its death does not count. False: none came.
  bool hear(std::string& line, double timeout = 30);
  // The next line must be this one.
  void expect(const std::string& line);
  void say(const std::string& line);
  void stop_saying();  // its standard input ends

  void send(int signal) const { ::kill(id_, signal); }
  int wait();       // until it has ended; its status as waitpid gives it. 30 s at most, then it is killed
  void kill_it();   // and waits
  void forget() { id_ = 0; }  // it has been waited for

 private:
  void swap(Process& other) noexcept;

  pid_t id_ = 0;
  int input_ = -1, output_ = -1;
  std::string heard_;
};

// ---- In the other process.

// Call it first: the process then ends with the one that started it.
void leave_with_parent();
void tell(const std::string& line);
bool listen(std::string& line);  // false: standard input is closed

// ---- What a process holds.

struct Holdings {
  size_t descriptors = 0, threads = 0, mappings = 0;  // mappings: of the library's memory files
  bool operator==(const Holdings&) const = default;
};
Holdings holdings();                   // of this process
std::string to_text(const Holdings& holdings);
size_t resident_bytes();               // of this process
std::vector<std::string> descriptors();  // what each descriptor of this process is, except the three standard ones
bool has_socket(const std::string& endpoint);  // a process listens there, or is connected

}  // namespace life
