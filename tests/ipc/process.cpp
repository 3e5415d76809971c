#include "ipc/process.h"

#include <dirent.h>
#include <fcntl.h>
#include <poll.h>
#include <spawn.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <thread>
#include <utility>

extern char** environ;

namespace life {
namespace {

[[noreturn]] void stop(const char* what) {  // ends the test: its set-up has failed
  std::perror(what);
  std::abort();
}

double steady() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

void write_line(int descriptor, const std::string& line) {
  const std::string text = line + "\n";
  size_t done = 0;
  while (done < text.size()) {
    const ssize_t written = write(descriptor, text.data() + done, text.size() - done);
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) return;  // the other process no longer reads
    done += static_cast<size_t>(written);
  }
}

// Moves the first line out of what was read.
bool take_line(std::string& read, std::string& line) {
  const size_t end = read.find('\n');
  if (end == std::string::npos) return false;
  line = read.substr(0, end);
  read.erase(0, end + 1);
  return true;
}

}  // namespace

Process::Process(const std::vector<std::string>& arguments) {
  int in[2], out[2];
  if (pipe2(in, O_CLOEXEC) != 0 || pipe2(out, O_CLOEXEC) != 0) stop("pipe");
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, in[0], STDIN_FILENO);
  posix_spawn_file_actions_adddup2(&actions, out[1], STDOUT_FILENO);
  std::vector<std::string> words = arguments;
  words.insert(words.begin(), "client");
  std::vector<char*> pointers;
  for (std::string& word : words) pointers.push_back(word.data());
  pointers.push_back(nullptr);
  const int error = posix_spawn(&id_, "/proc/self/exe", &actions, nullptr, pointers.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (error) {
    errno = error;
    stop("posix_spawn");
  }
  close(in[0]);
  close(out[1]);
  input_ = in[1];
  output_ = out[0];
}

Process::~Process() {
  if (id_) kill_it();
  stop_saying();
  if (output_ >= 0) close(output_);
}

void Process::swap(Process& other) noexcept {
  std::swap(id_, other.id_);
  std::swap(input_, other.input_);
  std::swap(output_, other.output_);
  std::swap(heard_, other.heard_);
}

bool Process::hear(std::string& line, double timeout) {
  const double start = steady();
  while (!take_line(heard_, line)) {
    pollfd look{output_, POLLIN, 0};
    const double rest = timeout - (steady() - start);
    const int ready = poll(&look, 1, rest > 0 ? static_cast<int>(rest * 1000 + 1) : 0);
    if (ready < 0 && errno == EINTR) continue;
    char buffer[4096];
    const ssize_t got = ready > 0 ? read(output_, buffer, sizeof buffer) : 0;
    if (got <= 0) return false;
    heard_.append(buffer, static_cast<size_t>(got));
  }
  return true;
}

void Process::expect(const std::string& wanted) {
  std::string line = "nothing";
  if (hear(line) && line == wanted) return;
  std::fprintf(stderr, "process %d says '%s', not '%s'\n", id_, line.c_str(), wanted.c_str());
  std::abort();
}

void Process::say(const std::string& line) { write_line(input_, line); }

void Process::stop_saying() {
  if (input_ >= 0) close(std::exchange(input_, -1));
}

int Process::wait() {
  const double start = steady();
  int status = 0;
  pid_t ended;
  while ((ended = waitpid(id_, &status, WNOHANG)) == 0 || (ended < 0 && errno == EINTR)) {
    if (steady() - start > 30) send(SIGKILL);
    std::this_thread::sleep_for(std::chrono::microseconds(100));
  }
  if (ended != id_) stop("waitpid");
  id_ = 0;
  return status;
}

void Process::kill_it() {
  send(SIGKILL);
  wait();
}

void leave_with_parent() {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  std::signal(SIGPIPE, SIG_IGN);
}

void tell(const std::string& line) { write_line(STDOUT_FILENO, line); }

bool listen(std::string& line) {
  static std::string read_so_far;
  while (!take_line(read_so_far, line)) {
    char buffer[4096];
    const ssize_t got = read(STDIN_FILENO, buffer, sizeof buffer);
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) return false;
    read_so_far.append(buffer, static_cast<size_t>(got));
  }
  return true;
}

std::vector<std::string> descriptors() {
  std::vector<std::string> out;
  DIR* folder = opendir("/proc/self/fd");
  if (!folder) stop("/proc/self/fd");
  while (const dirent* entry = readdir(folder)) {
    const int number = std::atoi(entry->d_name);
    if (number <= STDERR_FILENO || number == dirfd(folder)) continue;
    char target[256] = {};
    if (readlinkat(dirfd(folder), entry->d_name, target, sizeof target - 1) > 0) out.push_back(target);
  }
  closedir(folder);
  return out;
}

Holdings holdings() {
  Holdings out;
  out.descriptors = descriptors().size();
  std::error_code gone;
  for ([[maybe_unused]] const auto& task : std::filesystem::directory_iterator("/proc/self/task", gone)) ++out.threads;
  std::ifstream maps("/proc/self/maps");
  for (std::string line; std::getline(maps, line);) out.mappings += line.find("memfd:forceserver") != std::string::npos;
  return out;
}

std::string to_text(const Holdings& h) {
  return std::to_string(h.descriptors) + " descriptors, " + std::to_string(h.threads) + " threads, " +
         std::to_string(h.mappings) + " mappings";
}

size_t resident_bytes() {
  std::ifstream file("/proc/self/statm");
  size_t all = 0, resident = 0;
  file >> all >> resident;
  return resident * static_cast<size_t>(sysconf(_SC_PAGESIZE));
}

bool has_socket(const std::string& endpoint) {
  const std::string name = "/" + endpoint.substr(endpoint.find(':') + 1);
  std::ifstream sockets("/proc/net/unix");
  for (std::string line; std::getline(sockets, line);) {
    if (line.ends_with(name)) return true;
  }
  return false;
}

}  // namespace life
