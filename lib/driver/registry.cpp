#include "driver/registry.h"

#include <dlfcn.h>
#include <sys/stat.h>

#include <cstring>
#include <map>
#include <memory>
#include <mutex>
#include <set>

#include "base/error.h"
#include "base/grown.h"

namespace fs {
namespace {

constexpr size_t scheme_length_max = 31;

struct Registry {
  std::mutex mutex;
  std::map<std::string, fs_driver> drivers;  // entries are never changed or removed; their scheme points to the key
  std::set<std::string> announced;           // schemes without a driver
};

// Never destroyed: devices may still be open when the process ends.
Registry& registry() {
  static Registry* const instance = new Registry;
  return *instance;
}

// The table as this library knows it: functions that an older driver did not have yet are null.
fs_driver parse_driver(const fs_driver& driver) {
  const fs_driver table = read_grown(&driver);
  if (table.reserved) fail(FS_ERROR_INVALID, "driver.reserved is %u, must be 0", table.reserved);
  if (table.reserved_2) fail(FS_ERROR_INVALID, "driver.reserved_2 is %u, must be 0", table.reserved_2);
  constexpr uint32_t known_flags = FS_DRIVER_IN_SERVO;
  if (table.flags & ~known_flags)
    fail(FS_ERROR_VERSION, "driver.flags is %u, which has bits that forceserver %s does not know", table.flags, fs_version());
  if (!table.scheme) fail(FS_ERROR_INVALID, "driver.scheme is null");
  const size_t length = strnlen(table.scheme, scheme_length_max + 1);
  const std::string scheme(table.scheme, length);
  if (length < 1 || length > scheme_length_max ||
      scheme.find_first_not_of("abcdefghijklmnopqrstuvwxyz0123456789") != std::string::npos) {
    fail(FS_ERROR_INVALID, "driver.scheme is '%s', must be 1..%zu of a-z and 0-9", scheme.c_str(), scheme_length_max);
  }
  const auto require = [&](bool given, const char* function) {
    if (!given) fail(FS_ERROR_INVALID, "driver.%s of '%s' is null", function, scheme.c_str());
  };
  require(table.open, "open");
  require(table.close, "close");
  require(table.get_info, "get_info");
  if (table.receive || table.send) {
    require(table.receive, "receive");
    require(table.send, "send");
    if (table.read || table.write || table.advance) {
      fail(FS_ERROR_INVALID, "driver '%s' has receive and send, so read, write and advance must be null", scheme.c_str());
    }
  } else {
    require(table.read, "read");
    require(table.write, "write");
    if (table.flags)
      fail(FS_ERROR_INVALID, "driver.flags of '%s' is %u, must be 0 without receive and send", scheme.c_str(), table.flags);
  }
  return table;
}

}  // namespace

void register_driver(const fs_driver& driver) {
  const fs_driver table = parse_driver(driver);
  Registry& all = registry();
  const std::lock_guard lock(all.mutex);
  const auto [entry, inserted] = all.drivers.try_emplace(table.scheme, table);
  if (!inserted) fail(FS_ERROR_EXISTS, "a driver of the scheme '%s' is registered already", table.scheme);
  entry->second.scheme = entry->first.c_str();
}

void load_driver(const char* path) {
  if (!*path) fail(FS_ERROR_INVALID, "path is empty, must be the path of a driver's library");
  struct stat info{};
  if (std::strchr(path, '/') && stat(path, &info) == 0 && !S_ISREG(info.st_mode)) {  // dlopen would block on a pipe
    fail(FS_ERROR_IO, "path is '%s', which is not a file", path);
  }
  std::unique_ptr<void, int (*)(void*)> library(dlopen(path, RTLD_NOW | RTLD_LOCAL), dlclose);
  if (!library) fail(FS_ERROR_IO, "path is '%s': %s", path, dlerror());
  const auto entry = reinterpret_cast<fs_driver_entry_function>(dlsym(library.get(), "fs_driver_entry"));
  if (!entry) fail(FS_ERROR_IO, "path is '%s', a library without a driver: %s", path, dlerror());
  const fs_driver* const driver = entry();
  if (!driver) fail(FS_ERROR_IO, "path is '%s', a library whose fs_driver_entry gives no driver", path);
  register_driver(*driver);
  static_cast<void>(library.release());  // the registry has its functions: it is never unloaded
}

void announce_scheme(const char* scheme) {
  Registry& all = registry();
  const std::lock_guard lock(all.mutex);
  all.announced.insert(scheme);
}

bool is_announced(const std::string& scheme) {
  Registry& all = registry();
  const std::lock_guard lock(all.mutex);
  return all.announced.contains(scheme);
}

const fs_driver* find_driver(const std::string& scheme) {
  Registry& all = registry();
  const std::lock_guard lock(all.mutex);
  const auto entry = all.drivers.find(scheme);
  return entry == all.drivers.end() ? nullptr : &entry->second;
}

std::vector<const fs_driver*> all_drivers() {
  Registry& all = registry();
  const std::lock_guard lock(all.mutex);
  std::vector<const fs_driver*> drivers;
  for (const auto& [scheme, driver] : all.drivers) drivers.push_back(&driver);
  return drivers;
}

}  // namespace fs
