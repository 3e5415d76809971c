// forceserver doctor: a page about this machine for a report: what is wrong, and what cures it.
#include <dlfcn.h>
#include <linux/capability.h>
#include <pwd.h>
#include <sys/resource.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>

#include "bus.h"
#include "device_words.h"
#include "doctor_page.h"
#include "lateness.h"
#include "local_servers.h"
#include "machine.h"
#include "program.h"
#include "words.h"

namespace {

constexpr int wanted_priority = 90;          // for limits.d: room for a driver's thread above the servo
constexpr std::size_t locked_bytes = 6 << 20;  // a servo at 1 kHz locks about 5 MB
#ifdef __aarch64__
constexpr const char* real_time_kernel = "linux-image-rt-arm64";  // a package of Debian
#else
constexpr const char* real_time_kernel = "linux-image-rt-amd64";
#endif

std::string bytes_text(double bytes) {
  if (bytes >= 1e9) return format("%.1f GB", bytes / 1e9);
  return bytes >= 1e6 ? format("%.0f MB", bytes / 1e6) : format("%.0f kB", bytes / 1e3);
}

// JSON: null where it is unlimited.
void tell_limit(DoctorPage& page, const char* label, __rlimit_resource resource, std::string (*to_text)(double)) {
  rlimit limit{};
  if (getrlimit(resource, &limit) != 0) return page.figure(label, std::string("not known: ") + std::strerror(errno));
  if (limit.rlim_cur == RLIM_INFINITY) return page.figure(label, "unlimited", nullptr);
  page.figure(label, to_text(double(limit.rlim_cur)), limit.rlim_cur);
}
std::string count_text(double count) { return format("%.0f", count); }

bool has_expressions() {
  fs_curve* curve = nullptr;
  const fs_status status = fs_curve_create_expression("d", &curve);
  fs_curve_destroy(curve);
  return status != FS_ERROR_UNSUPPORTED;
}

void tell_version(DoctorPage& page) {
  Dl_info library{};
  const bool is_known = dladdr(reinterpret_cast<void*>(&fs_version), &library) != 0 && library.dli_fname;
  const std::string of_library = fs_version();
  const std::string of_program = format("%d.%d.%d", FS_VERSION_MAJOR, FS_VERSION_MINOR, FS_VERSION_PATCH);
  std::error_code none;
  const std::string file = is_known ? std::filesystem::weakly_canonical(library.dli_fname, none).string() : "";
  page.figure("library", of_library + " at " + (file.empty() ? "a place that is not known" : file));
  page.figure("program", of_program + " at " + std::filesystem::read_symlink("/proc/self/exe", none).string());
  page.figure("build", FORCESERVER_BUILD);
  page.figure("expressions", has_expressions() ? "yes" : "no: built without muParser", has_expressions());
  if (of_library != of_program) {
    page.wrong(
        "the program is of version " + of_program + " and the library of version " + of_library,
        "install both from one package or one build; LD_LIBRARY_PATH and `ldconfig -p | grep forceserver` tell which library "
        "is found");
  }
}

void tell_machine(DoctorPage& page) {
  page.figure("system", known(distribution));
  page.figure("kernel", known(kernel));
  page.figure("preemption", known(preemption));
  page.figure("processor", known(processor));
  page.figure("governor", known(governor));
  const std::string container = known(container_kind).text;
  page.figure("container", container.empty() ? "none, as far as one can see" : container);
}

// How a user is granted priority and memory: by whoever starts the container, or by a file that pam_limits reads at the login.
std::string how_to_grant() {
  std::string text;
  if (const Known container = known(container_kind); container.is_known && !container.text.empty()) {
    text = format("start the container with --cap-add SYS_NICE --ulimit rtprio=%d --ulimit memlock=-1\nor, where users log in: ",
                  wanted_priority);
  }
  const std::string user = user_name(geteuid()), file = "/etc/security/limits.d/forceserver-" + user + ".conf";
  const std::string of_service =
      format("the unit of a service says instead: LimitRTPRIO=%d, LimitMEMLOCK=infinity", wanted_priority);
  if (access(file.c_str(), F_OK) == 0) {
    const std::string of_container = format(
        "a container does not read that file: it is started with --cap-add SYS_NICE --ulimit rtprio=%d --ulimit memlock=-1\n",
        wanted_priority);
    return text + file +
           format(" is there: log out and in again, until `prlimit --pid $$ --rtprio` says %d. If it does not:\n",
                  wanted_priority) +
           "the service that logs you in (su, sshd, cron, login) must have the line `session required pam_limits.so` in its file in "
           "/etc/pam.d\n" +
           (text.empty() ? of_container : "") + of_service;
  }
  text += "printf '%s\\n'";
  for (const std::string& grant : {format("rtprio %d", wanted_priority), std::string("memlock unlimited")}) {
    text += " '" + user + " - " + grant + "'";
  }
  return text + " | sudo tee " + file + "\nthen log out and in again; " + of_service;
}

void tell_grants(DoctorPage& page) {
  const std::string fifo = refusal_of_fifo(servo_priority), lock = refusal_of_lock(locked_bytes);
  page.figure("SCHED_FIFO",
              format("priority %d, which a servo asks for, is ", servo_priority) +
                  (fifo.empty() ? "granted" : "refused: " + fifo),
              fifo.empty());
  page.figure("locked memory",
              bytes_text(double(locked_bytes)) + (lock.empty() ? " can be locked" : " cannot be locked: " + lock), lock.empty());
  tell_limit(page, "RLIMIT_RTPRIO", RLIMIT_RTPRIO, count_text);
  tell_limit(page, "RLIMIT_MEMLOCK", RLIMIT_MEMLOCK, bytes_text);
  page.figure("capabilities", known([] {
                std::vector<std::string> names;
                if (has_capability(CAP_SYS_NICE)) names.push_back("CAP_SYS_NICE");
                if (has_capability(CAP_IPC_LOCK)) names.push_back("CAP_IPC_LOCK");
                return join(names, "neither CAP_SYS_NICE nor CAP_IPC_LOCK");
              }));
  page.figure("user", user_name(geteuid()));
  if (fifo.empty() && lock.empty()) return;
  std::vector<std::string> refused;
  if (!fifo.empty()) refused.push_back("a real-time priority, so its ticks may be kept waiting");
  if (!lock.empty()) refused.push_back("locked memory, so a tick may wait until memory is read from the disk");
  page.wrong("the system refuses a servo " + join(refused, ""), how_to_grant());
}

void tell_rule(DoctorPage& page) {
  const std::string rule = installed_rule();
  page.figure("udev rule", rule.empty() ? "not installed; devices on the USB need it: " + install_rule() : rule);
}

void tell_devices(DoctorPage& page) {
  const std::vector<fs_driver_info> all = drivers();
  Json told = Json::array(), found = Json::array();
  std::vector<std::string> lines, uris;
  for (const fs_driver_info& driver : all) {
    lines.push_back(format("%-12s %s", driver.scheme, origin(driver).c_str()));
    told.push_back({{"scheme", driver.scheme}, {"path", driver.path}, {"trouble", driver.trouble}});
  }
  std::string text;
  for (const std::string& line : lines) text += (text.empty() ? "" : "\n") + line;
  page.figure("drivers", text.empty() ? "none" : text, told);
  const Known found_devices = known([&] {
    for (const fs_device_entry& entry : forceserver::device_list()) uris.push_back(entry.uri);
    return join(uris, "none");
  });
  page.figure("devices", found_devices.text, uris);
  const Bus bus = look_at_bus();
  text.clear();
  for (const SeenDevice& seen : bus.seen) {
    const auto [what, cure] = trouble_of(seen, all);
    const std::string name = format("usb %04x:%04x, %s at %s", seen.vendor, seen.product, seen.name.c_str(), seen.node.c_str());
    text += (text.empty() ? "" : "\n") + name + ": " + (what.empty() ? "for the driver " + std::string(seen.scheme) : what);
    found.push_back({{"name", seen.name}, {"node", seen.node}, {"scheme", seen.scheme}, {"trouble", what}});
    if (what.empty()) continue;
    page.wrong(name + ": " + what, !cure.empty() ? cure
                                                 : format("the page device/%s/README.md says what this device needs; "
                                                          "`forceserver devices --why` tells more",
                                                          seen.scheme));
  }
  page.figure("usb", bus.seen.empty() ? why_none(bus) : text, found);
  tell_rule(page);
}

void tell_servers(DoctorPage& page) {
  Json list = Json::array();
  std::string text;
  for (const LocalServer& server : local_servers()) {
    const std::string user = server.is_user_known ? user_name(server.user) : "";
    text += (text.empty() ? "" : "\n") + server.name + ": user " + (user.empty() ? "not known" : user) + ", process " +
            (server.process ? std::to_string(server.process) + " (" + server.program + ")"
                            : std::string("not known: it is another user's, or in another container")) +
            (server.for_all ? ", for all users" : "");
    list.push_back({{"name", server.name},
                    {"user", user},
                    {"process", server.process},
                    {"program", server.program},
                    {"all_users", server.for_all}});
  }
  page.figure("running", text.empty() ? "none" : text, list);
  const std::vector<std::string> abandoned = abandoned_sockets();
  page.figure("abandoned", join(abandoned, "nothing: the shared memory of a server that was killed is gone with it"), abandoned);
  for (const std::string& file : abandoned) {
    page.better("a server that was killed has left " + file + "; the next server of that name takes it over",
                "rm '" + file + "'");
  }
}

// The folder in which calibrations are kept, as calibration_file in device/fidel/usb/calibration.cpp finds it; "": this user has
// no home.
std::string config_folder() {
  const char* const config = std::getenv("XDG_CONFIG_HOME");
  if (config && *config == '/') return config + std::string("/forceserver");
  const char* home = std::getenv("HOME");
  if (!home || *home != '/') {
    const passwd* const entry = getpwuid(getuid());
    home = entry ? entry->pw_dir : nullptr;
  }
  if (!home || *home != '/') return "";
  return std::string(home) + "/.config/forceserver";
}

void tell_home(DoctorPage& page) {
  const std::string folder = config_folder();
  const char* const cure = "export XDG_CONFIG_HOME=FOLDER, where FOLDER is one that this user may write to";
  if (folder.empty()) {
    page.figure("home", "none: neither XDG_CONFIG_HOME nor HOME is set, and the system knows no home of this user");
    return page.better("this user has no home: the calibration of a device cannot be kept", cure);
  }
  std::filesystem::path there = folder;  // or the nearest folder above it that is there
  std::error_code none;
  while (!std::filesystem::exists(there, none) && there.has_relative_path()) there = there.parent_path();
  const bool may_write = access(there.c_str(), W_OK) == 0;
  page.figure("home", folder + (may_write ? "" : std::string(", which cannot be written: ") + std::strerror(errno)));
  if (!may_write) page.better("calibrations are kept in " + folder + ", which this user may not write to", cure);
}

void tell_limits(DoctorPage& page) {
  const std::string memfd = refusal_of_memfd(), pidfd = refusal_of_pidfd();
  const char* const seccomp =
      "allow it in the seccomp filter of the container, such as: docker run --security-opt seccomp=unconfined";
  page.figure("shared memory", memfd.empty() ? "memfd_create works" : "memfd_create is refused: " + memfd, memfd.empty());
  if (!memfd.empty())
    page.wrong("the system refuses memfd_create, without which no server can be started and no client can send a mesh", seccomp);
  page.figure("end of processes", pidfd.empty() ? "pidfd_open works" : "pidfd_open is refused: " + pidfd, pidfd.empty());
  if (!pidfd.empty()) {
    page.better(
        "the system refuses pidfd_open: the end of a program whose forked children live on is noticed only with their end",
        seccomp);
  }
  page.figure("/dev/shm", known([] {
                struct statvfs info{};
                if (statvfs("/dev/shm", &info) != 0)
                  return std::string("not there: ") + std::strerror(errno) + "; forceserver does without";
                return bytes_text(double(info.f_blocks) * double(info.f_frsize)) + "; forceserver does not use it";
              }));
  page.figure("memory", known([&]() -> std::string {
                const std::optional<MemoryLimit> limit = memory_limit();
                if (!limit) return "no limit by a control group";
                const double left = double(limit->most) - double(std::min(limit->used, limit->most));
                if (left < 32e6) {
                  page.wrong("a control group leaves " + bytes_text(left) +
                                 " of memory, and a server needs about 30 MB even without meshes",
                             "raise the limit: `docker update --memory 1g CONTAINER`, or MemoryMax= in the unit of systemd");
                }
                return "limited to " + bytes_text(double(limit->most)) + " by a control group, of which " + bytes_text(left) +
                       " are left";
              }));
  tell_limit(page, "address space", RLIMIT_AS, bytes_text);
  page.figure("processor time", known([&]() -> std::string {
                const std::optional<double> limit = processor_limit();
                if (!limit) return "no limit by a control group";
                page.better(format("a control group limits the time to %.2g processors: when it is used up, a servo waits",
                                   *limit),
                            "remove the limit: `docker update --cpus 0 CONTAINER`, or CPUQuota= in the unit of systemd");
                return format("limited to %.2g processors by a control group", *limit);
              }));
  tell_limit(page, "descriptors", RLIMIT_NOFILE, count_text);
  rlimit files{};
  if (getrlimit(RLIMIT_NOFILE, &files) == 0 && files.rlim_cur < 128) {
    page.better("a process may open only " + std::to_string(files.rlim_cur) +
                    " files: a server needs about 10, and 2 or more for each client",
                "ulimit -n 1024");
  }
  tell_home(page);
}

std::string text_of(const Late& late) {
  return format("p50 %.0f us, p99 %.0f us, max %.0f us", late.p50 * 1e6, late.p99 * 1e6, late.most * 1e6);
}
Json to_json(const Late& late) { return {{"late_p50", late.p50}, {"late_p99", late.p99}, {"late_max", late.most}}; }

void tell_lateness(DoctorPage& page, double seconds) {
  Lateness found{};
  try {
    found = measure_lateness(seconds);
  } catch (const std::exception& error) {
    page.wrong(std::string("a servo cannot be started: ") + error.what(),
               "cure what else is wrong first; if that is nothing, send this page in a report");
    throw;
  }
  const fs_servo_stats& stats = found.stats;
  page.figure("measured", format("%g s of a servo at 1 kHz on sim:", seconds), seconds);
  page.figure("servo", "late " + text_of(found.servo), to_json(found.servo));
  page.figure("idle thread", "late " + text_of(found.idle) + " (a thread that only waits, at the same time)",
              to_json(found.idle));
  page.figure("missed ticks",
              format("%llu of %llu", static_cast<unsigned long long>(stats.misses),
                     static_cast<unsigned long long>(stats.ticks + stats.misses)),
              stats.misses);
  page.figure("granted", word_of(fs_realtime_name(stats.realtime)));
  page.figure("faults", fault_names(stats.faults));
  constexpr double much = 0.5e-3;  // s, half of a period
  const bool is_late = found.servo.p99 > much || double(stats.misses) > 1e-3 * double(stats.ticks);
  if (!is_late) return;
  const std::string measured = "a servo on this machine is late: p99 " + milliseconds(found.servo.p99) + ", and " +
                               std::to_string(stats.misses) + " ticks were missed";
  if (found.idle.p99 < 0.5 * found.servo.p99 && found.idle.most < 1e-3) {
    return page.wrong(measured + ", while a thread that only waits was not",
                      "send this page in a report: this is not to be expected");
  }
  page.wrong(measured + "; so is a thread that only waits, so the machine itself is late",
             stats.realtime < FS_REALTIME_FIFO ? "grant a real-time priority as above, then try again"
                                               : "end other programs, keep the processor at its full frequency "
                                                 "(sudo cpupower frequency-set -g performance), or install a real-time kernel "
                                                 "(Debian: sudo apt install " +
                                                     std::string(real_time_kernel) + ")");
}

void look_at_governor(DoctorPage& page) {
  const auto [found, is_known] = known(governor);
  if (!is_known || found == "performance") return;
  page.better("the frequency of the processor follows its load (governor " + found + "), so a servo may wake late",
              "sudo cpupower frequency-set -g performance");
}

}  // namespace

int doctor(const DoctorOptions& options) {
  DoctorPage page(options.json);
  page.section("Version", [&] { tell_version(page); });
  page.section("Machine", [&] {
    tell_machine(page);
    look_at_governor(page);
  });
  page.section("Real time", [&] { tell_grants(page); });
  page.section("Devices", [&] { tell_devices(page); });
  page.section("Servers", [&] { tell_servers(page); });
  page.section("Limits", [&] { tell_limits(page); });
  page.section("Lateness", [&] { tell_lateness(page, options.seconds); });
  return page.finish();
}
