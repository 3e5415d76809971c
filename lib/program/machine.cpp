#include "machine.h"

#include <linux/capability.h>
#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <sys/utsname.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <set>
#include <stdexcept>
#include <thread>
#include <vector>

#include "words.h"

namespace {

std::vector<std::string> lines_of(const std::string& file) {
  errno = 0;
  std::ifstream stream(file);
  if (!stream) throw std::runtime_error(file + ": " + std::strerror(errno ? errno : EIO));
  std::vector<std::string> lines;
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

// The value in a line "name<separator>value"; "": there is none.
std::string value_in(const std::vector<std::string>& lines, std::string_view name, char separator) {
  for (const std::string& line : lines) {
    const std::size_t at = line.find(separator);
    if (at == line.npos || line.substr(0, line.find_last_not_of(" \t", at - 1) + 1) != name) continue;
    const std::size_t begin = line.find_first_not_of(" \t\"", at + 1), end = line.find_last_not_of(" \t\"");
    return begin == line.npos ? "" : line.substr(begin, end - begin + 1);
  }
  return "";
}

// The folders of this process's control groups that have this file, from the innermost outwards. controller: of version 1.
std::vector<std::string> control_groups(const std::string& controller, const std::string& file_of_1,
                                        const std::string& file_of_2) {
  std::vector<std::string> files;
  for (const std::string& line : lines_of("/proc/self/cgroup")) {  // "4:memory:/path", or "0::/path" of version 2
    const std::size_t first = line.find(':'), second = line.find(':', first + 1);
    if (second == line.npos) continue;
    const std::string controllers = "," + line.substr(first + 1, second - first - 1) + ",";
    const bool is_2 = controllers == ",,";
    if (!is_2 && controllers.find("," + controller + ",") == controllers.npos) continue;
    const std::string root = is_2 ? "/sys/fs/cgroup" : "/sys/fs/cgroup/" + controller;
    std::filesystem::path path = line.substr(second + 1);
    for (;; path = path.parent_path()) {
      const std::string file = root + (path == "/" ? "" : path.string()) + "/" + (is_2 ? file_of_2 : file_of_1);
      if (access(file.c_str(), R_OK) == 0) files.push_back(file);
      if (!path.has_relative_path()) break;
    }
  }
  return files;
}

}  // namespace

std::string text_of(const std::string& file) {
  const std::vector<std::string> lines = lines_of(file);
  return lines.empty() ? "" : lines.front();
}

std::string kernel() {
  utsname names{};
  if (uname(&names) != 0) throw std::runtime_error(std::strerror(errno));
  return std::string(names.sysname) + " " + names.release + " " + names.machine + ", " + names.version;
}

std::string distribution() {
  const std::string name = value_in(lines_of("/etc/os-release"), "PRETTY_NAME", '=');
  return name.empty() ? "without a name in /etc/os-release" : name;
}

std::string processor() {
  const std::vector<std::string> lines = lines_of("/proc/cpuinfo");
  std::string model = value_in(lines, "model name", ':');
  if (model.empty()) model = "of a model that /proc/cpuinfo does not name";
  cpu_set_t set;
  const bool is_known = sched_getaffinity(0, sizeof set, &set) == 0;
  const long all = sysconf(_SC_NPROCESSORS_ONLN);
  model += format(", %ld processor%s", all, all == 1 ? "" : "s");
  if (is_known && CPU_COUNT(&set) != all) model += format(", of which this process may use %d", CPU_COUNT(&set));
  const std::string flags = value_in(lines, "flags", ':') + " ";
  if (flags.find(" hypervisor ") != flags.npos) model += "; a virtual machine, whose host may keep it waiting";
  return model;
}

std::string preemption() {
  const std::string version = kernel();
  if (version.find("PREEMPT_RT") != version.npos) return "full, of a real-time kernel (PREEMPT_RT)";
  if (version.find("PREEMPT_DYNAMIC") == version.npos) {
    return version.find("PREEMPT") != version.npos ? "full (PREEMPT)" : "none or voluntary";
  }
  const auto [models, is_known] = known([] { return text_of("/sys/kernel/debug/sched/preempt"); });  // "none (voluntary) full"
  const std::size_t begin = models.find('('), end = models.find(')');
  if (is_known && begin != models.npos && end != models.npos) {
    return models.substr(begin + 1, end - begin - 1) + " (PREEMPT_DYNAMIC)";
  }
  return "as the kernel was started (PREEMPT_DYNAMIC); " + models;
}

std::string governor() {
  std::set<std::string> all;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator("/sys/devices/system/cpu/cpufreq", error)) {
    all.insert(text_of(entry.path() / "scaling_governor"));
  }
  if (all.empty())
    throw std::runtime_error("the system does not tell of the processor's frequency (no /sys/devices/system/cpu/cpufreq)");
  return join({all.begin(), all.end()}, "");
}

std::string container_kind() {
  if (access("/.dockerenv", F_OK) == 0) return "Docker";
  if (access("/run/.containerenv", F_OK) == 0) return "Podman";
  const char* const told = std::getenv("container");  // by systemd-nspawn, LXC and Podman
  if (told && *told) return told;
  std::error_code error;
  if (std::filesystem::exists("/run/systemd/container", error)) return text_of("/run/systemd/container");
  return "";
}

bool has_capability(int number) {
  const std::string bits = value_in(lines_of("/proc/self/status"), "CapEff", ':');
  return std::strtoull(bits.c_str(), nullptr, 16) >> number & 1;
}

std::string refusal_of_fifo(int priority) {
  int error = 0;
  std::thread([&] {  // this thread keeps its own
    sched_param parameter{};
    parameter.sched_priority = priority;
    error = pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameter);
  })
      .join();
  return error ? std::strerror(error) : "";
}

std::string refusal_of_lock(std::size_t bytes) {
  void* const pages = mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (pages == MAP_FAILED) return std::strerror(errno);
  const std::string refusal = mlock(pages, bytes) == 0 ? "" : std::strerror(errno);
  munmap(pages, bytes);
  return refusal;
}

std::string refusal_of_memfd() {
  const int made = memfd_create("forceserver-doctor", MFD_CLOEXEC | MFD_ALLOW_SEALING);
  if (made < 0) return std::strerror(errno);
  close(made);
  return "";
}

std::string refusal_of_pidfd() {
  const long opened = syscall(SYS_pidfd_open, getpid(), 0);
  if (opened < 0) return std::strerror(errno);
  close(static_cast<int>(opened));
  return "";
}

std::optional<MemoryLimit> memory_limit() {
  std::optional<MemoryLimit> least;  // of which the least is left
  for (const std::string& file : control_groups("memory", "memory.limit_in_bytes", "memory.max")) {
    const std::string text = text_of(file);
    if (text == "max") continue;
    const std::uint64_t most = std::strtoull(text.c_str(), nullptr, 10);
    constexpr std::uint64_t unlimited = std::uint64_t(1) << 60;
    if (most >= unlimited) continue;
    const std::string folder = file.substr(0, file.rfind('/'));
    const char* const used_file = file.ends_with("memory.max") ? "/memory.current" : "/memory.usage_in_bytes";
    const std::uint64_t used = std::strtoull(text_of(folder + used_file).c_str(), nullptr, 10);
    if (!least || most - std::min(used, most) < least->most - std::min(least->used, least->most)) least = {most, used};
  }
  return least;
}

std::optional<double> processor_limit() {
  std::optional<double> least;
  for (const std::string& file : control_groups("cpu", "cpu.cfs_quota_us", "cpu.max")) {
    const std::string text = text_of(file);  // us in a period, or "max"; in version 2 the period follows
    const double quota = std::strtod(text.c_str(), nullptr);
    if (!(quota > 0)) continue;
    const bool is_2 = file.ends_with("cpu.max");
    const std::string folder = file.substr(0, file.rfind('/'));
    const std::string period = is_2 ? text.substr(std::min(text.size(), text.find(' '))) : text_of(folder + "/cpu.cfs_period_us");
    const double processors = quota / std::max(1.0, std::strtod(period.c_str(), nullptr));
    if (!least || processors < *least) least = processors;
  }
  return least;
}
