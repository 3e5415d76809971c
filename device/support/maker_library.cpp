#include "device/support/maker_library.h"

#include <dlfcn.h>
#include <link.h>

#include "device/support/refusal.h"

namespace fs {

MakerLibrary::MakerLibrary(const char* wanted, std::initializer_list<std::string> names) {
  std::string reasons;
  for (const std::string& name : names) {
    handle_ = dlopen(name.c_str(), RTLD_NOW | RTLD_LOCAL | RTLD_NODELETE);
    if (handle_) break;
    const char* const reason = dlerror();
    reasons += (reasons.empty() ? "" : "; ") + std::string(reason ? reason : name.c_str());
  }
  if (!handle_)
    refuse(FS_ERROR_NOT_FOUND, "%s cannot be loaded: %s. library=PATH in the address, or LD_LIBRARY_PATH, names another place",
           wanted, reasons.c_str());
  link_map* map = nullptr;
  if (dlinfo(handle_, RTLD_DI_LINKMAP, &map) == 0 && map) path_ = map->l_name;
}

void* MakerLibrary::symbol_or_null(const char* name) const noexcept { return dlsym(handle_, name); }

void* MakerLibrary::symbol(const char* name) const {
  void* const found = symbol_or_null(name);
  if (!found) refuse(FS_ERROR_VERSION, "%s has no function %s: it is too old, or another library", path_.c_str(), name);
  return found;
}

}  // namespace fs
