#include "driver/registry.h"

#include <dlfcn.h>
#include <link.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>

#include "base/error.h"
#include "base/grown.h"

namespace fs {
namespace {

struct RegisteredDriver {
  fs_driver table;   // its scheme points to the key
  std::string path;  // of its library; empty: it has none
};

struct Registry {
  std::mutex loading;  // while a module is being loaded, so that none is loaded twice
  std::mutex mutex;
  std::map<std::string, RegisteredDriver> drivers;  // entries are never changed or removed
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
  const std::string scheme(table.scheme, strnlen(table.scheme, scheme_length_max + 1));
  if (!is_scheme(scheme)) {
    fail(FS_ERROR_INVALID, "driver.scheme is '%s', must be 1..%zu of a-z and 0-9", scheme.c_str(), scheme_length_max);
  }
  const auto require = [&](bool given, const char* function) {
    if (!given) fail(FS_ERROR_INVALID, "driver.%s of '%s' is null", function, scheme.c_str());
  };
  require(table.open, "open");
  require(table.close, "close");
  require(table.get_info, "get_info");
  const auto require_both = [&](bool first, bool second, const char* first_name, const char* second_name) {
    if (first && second) return;
    fail(FS_ERROR_INVALID, "driver.%s of '%s' is null, and %s is there: both or neither are needed",
         first ? second_name : first_name, scheme.c_str(), first ? first_name : second_name);
  };
  if (!table.receive && !table.send && !table.read && !table.write) {
    fail(FS_ERROR_INVALID, "driver.receive of '%s' is null: it needs receive and send, or read and write", scheme.c_str());
  }
  if (table.receive || table.send) {
    require_both(table.receive, table.send, "receive", "send");
    if (table.read || table.write || table.advance) {
      fail(FS_ERROR_INVALID, "driver '%s' has receive and send, so read, write and advance must be null", scheme.c_str());
    }
  } else {
    require_both(table.read, table.write, "read", "write");
    if (table.flags)
      fail(FS_ERROR_INVALID, "driver.flags of '%s' is %u, must be 0 without receive and send", scheme.c_str(), table.flags);
  }
  return table;
}

// As the library says: a variable of that name must not be called.
bool is_function(void* symbol) {
  Dl_info info{};
  void* found = nullptr;
  if (!dladdr1(symbol, &info, &found, RTLD_DL_SYMENT) || !found || info.dli_saddr != symbol) return true;  // nobody knows
  const auto type = ELF64_ST_TYPE(static_cast<const ElfW(Sym)*>(found)->st_info);
  return type != STT_OBJECT && type != STT_TLS;
}

void add(const fs_driver& driver, const char* path, const char* scheme) {
  const fs_driver table = parse_driver(driver);
  if (scheme && std::strcmp(scheme, table.scheme) != 0) {
    fail(FS_ERROR_IO, "path is '%s', whose driver is '%s': a module has the name of its scheme", path, table.scheme);
  }
  Registry& all = registry();
  const std::lock_guard lock(all.mutex);
  const auto [entry, inserted] = all.drivers.try_emplace(table.scheme, RegisteredDriver{table, path});
  if (!inserted) fail(FS_ERROR_EXISTS, "a driver of the scheme '%s' is registered already", table.scheme);
  entry->second.table.scheme = entry->first.c_str();
}

// scheme: of a module; null: any.
void load(const char* path, const char* scheme) {
  struct stat info{};
  if (std::strchr(path, '/') && stat(path, &info) == 0 && !S_ISREG(info.st_mode)) {  // dlopen would block on a pipe
    fail(FS_ERROR_IO, "path is '%s', which is not a file", path);
  }
  std::unique_ptr<void, int (*)(void*)> library(dlopen(path, RTLD_NOW | RTLD_LOCAL), dlclose);
  if (!library) {
    const std::string why = dlerror(), beginning = path + std::string(": ");  // mostly it names the library itself
    fail(FS_ERROR_IO, "the driver's library '%s' cannot be loaded: %s", path,
         why.c_str() + (why.rfind(beginning, 0) == 0 ? beginning.size() : 0));
  }
  void* const symbol = dlsym(library.get(), "fs_driver_entry");
  if (!symbol) fail(FS_ERROR_IO, "path is '%s', a library without a driver: %s", path, dlerror());
  if (!is_function(symbol)) fail(FS_ERROR_IO, "path is '%s', a library whose fs_driver_entry is no function", path);
  const auto entry = reinterpret_cast<fs_driver_entry_function>(symbol);
  const fs_driver* driver = nullptr;
  try {
    driver = entry();
  } catch (...) {
    fail(FS_ERROR_IO, "path is '%s', a library whose fs_driver_entry throws", path);
  }
  if (!driver) fail(FS_ERROR_IO, "path is '%s', a library whose fs_driver_entry gives no driver", path);
  add(*driver, path, scheme);
  static_cast<void>(library.release());  // the registry has its functions: it is never unloaded
}

const fs_driver* find_registered(const std::string& scheme) {
  Registry& all = registry();
  const std::lock_guard lock(all.mutex);
  const auto entry = all.drivers.find(scheme);
  return entry == all.drivers.end() ? nullptr : &entry->second.table;
}

constexpr const char* extension = ".so";

// In order of their names.
std::vector<std::string> module_schemes() {
  std::vector<std::string> found;
  std::error_code error;  // mostly: there is no such folder
  for (const auto& file : std::filesystem::directory_iterator(module_folder(), error)) {
    const std::string scheme = file.path().stem();
    if (file.path().extension() == extension && is_scheme(scheme) && file.exists(error)) found.push_back(scheme);
  }
  std::sort(found.begin(), found.end());
  return found;
}

}  // namespace

bool is_scheme(const std::string& text) {
  return !text.empty() && text.size() <= scheme_length_max &&
         text.find_first_not_of("abcdefghijklmnopqrstuvwxyz0123456789") == std::string::npos;
}

void register_driver(const fs_driver& driver) { add(driver, "", nullptr); }

void load_driver(const char* path) {
  if (!*path) fail(FS_ERROR_INVALID, "path is empty, must be the path of a driver's library");
  load(path, nullptr);
}

std::string module_folder() {
  Dl_info info{};
  if (!dladdr(reinterpret_cast<void*>(&module_folder), &info) || !info.dli_fname) return "";
  std::error_code error;
  const std::filesystem::path library = std::filesystem::weakly_canonical(info.dli_fname, error);
  return (library.parent_path() / "forceserver/drivers-1").string();
}

const fs_driver* find_driver(const std::string& scheme) {
  if (const fs_driver* const driver = find_registered(scheme)) return driver;
  if (!is_scheme(scheme)) return nullptr;  // so that no path is made of it
  const std::string path = module_folder() + "/" + scheme + extension;
  if (access(path.c_str(), F_OK) != 0) return nullptr;
  const std::lock_guard lock(registry().loading);
  if (const fs_driver* const driver = find_registered(scheme)) return driver;
  load(path.c_str(), scheme.c_str());
  return find_registered(scheme);
}

std::vector<const fs_driver*> all_drivers() {
  Registry& all = registry();
  const std::lock_guard lock(all.mutex);
  std::vector<const fs_driver*> drivers;
  for (const auto& [scheme, entry] : all.drivers) drivers.push_back(&entry.table);
  return drivers;
}

std::vector<std::string> all_schemes() {
  std::vector<std::string> schemes = module_schemes();
  for (const fs_driver* const driver : all_drivers()) schemes.emplace_back(driver->scheme);
  std::sort(schemes.begin(), schemes.end());
  schemes.erase(std::unique(schemes.begin(), schemes.end()), schemes.end());
  return schemes;
}

std::vector<fs_driver_info> list_drivers() {
  std::vector<fs_driver_info> out;
  const auto tell = [&](const std::string& scheme, const std::string& path, const std::string& trouble) {
    fs_driver_info& info = out.emplace_back();
    scheme.copy(info.scheme, sizeof info.scheme - 1);
    path.copy(info.path, sizeof info.path - 1);
    trouble.copy(info.trouble, sizeof info.trouble - 1);
  };
  for (const std::string& scheme : module_schemes()) {
    try {
      find_driver(scheme);
    } catch (const Error& error) {
      tell(scheme, module_folder() + "/" + scheme + extension, error.text);
    }
  }
  Registry& all = registry();
  const std::lock_guard lock(all.mutex);
  for (const auto& [scheme, entry] : all.drivers) tell(scheme, entry.path, "");
  std::sort(out.begin(), out.end(),
            [](const fs_driver_info& a, const fs_driver_info& b) { return std::strcmp(a.scheme, b.scheme) < 0; });
  return out;
}

}  // namespace fs
