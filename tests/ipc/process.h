// This program again as another process: a client or a server that is killed, stopped, forked, or of another user. What
// it is to do stands in its arguments. It says what it has done in lines on its standard output, and takes lines on its
// standard input, which ends when whoever started it is through with it.
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

// First of all: it does not outlive the one that started it.
void leave_with_parent();
void tell(const std::string& line);
bool listen(std::string& line);  // false: nobody speaks any more

// ---- What a process holds.

struct Holdings {
  size_t descriptors = 0, threads = 0, mappings = 0;  // mappings: of the library's memory files
  bool operator==(const Holdings&) const = default;
};
Holdings holdings();                   // of this process
std::string to_text(const Holdings& holdings);
size_t resident_bytes();               // of this process
std::vector<std::string> descriptors();  // what each of this process is, beyond the three standard ones
bool has_socket(const std::string& endpoint);  // somebody listens there, or is connected

}  // namespace life
