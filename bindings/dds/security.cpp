#include "security.h"

#include <dlfcn.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>

namespace bridge {
namespace {

namespace fs = std::filesystem;

struct KeyFile {
  const char* property;
  const char* name;
  const char* mark;  // what such a file has in it
  const char* what;
};
constexpr KeyFile key_files[]{
    {"dds.sec.auth.identity_ca", "identity_ca.pem", "-----BEGIN CERTIFICATE-----", "a certificate"},
    {"dds.sec.auth.identity_certificate", "certificate.pem", "-----BEGIN CERTIFICATE-----", "a certificate"},
    {"dds.sec.auth.private_key", "key.pem", "PRIVATE KEY-----", "a private key"},
    {"dds.sec.access.permissions_ca", "permissions_ca.pem", "-----BEGIN CERTIFICATE-----", "a certificate"},
    {"dds.sec.access.governance", "governance.p7s", "pkcs7-signature", "a signed document"},
    {"dds.sec.access.permissions", "permissions.p7s", "pkcs7-signature", "a signed document"},
};

[[noreturn]] void refuse(const std::string& sentence) {
  throw std::runtime_error(sentence + " (make-keys makes a folder of six files for each site)");
}

// Cyclone DDS says only in its log what is wrong with such a file.
void check(const fs::path& folder, const KeyFile& file) {
  const std::string name = (folder / file.name).string();
  errno = 0;
  std::ifstream in(name, std::ios::binary);
  const std::string text{std::istreambuf_iterator<char>(in), {}};
  const int error = in.is_open() ? 0 : errno;
  if (error == ENOENT) refuse(name + " is missing");
  if (error) refuse(name + " cannot be read: " + std::strerror(error));
  if (text.find(file.mark) == text.npos) refuse(name + " is not " + file.what);
}

// Where a plugin of the loaded Cyclone DDS lies: Debian has them beside the library in a folder that is named after it
// (libddsc0debian), a Cyclone DDS of one's own right beside it. Cyclone DDS opens the name as it is, so it has to be whole.
std::string plugin(const std::string& name) {
  const std::string file = "lib" + name + ".so";
  Dl_info loaded{};
  // By its name: the address that a program has of a function may be in the program itself.
  void* const known = dlsym(RTLD_DEFAULT, "dds_create_participant");
  if (known && dladdr(known, &loaded) != 0 && loaded.dli_fname) {
    std::error_code error;
    const fs::path library = fs::absolute(loaded.dli_fname, error);  // .../libddsc.so.0debian
    for (const fs::path& path : {library, fs::weakly_canonical(library, error)}) {
      if (path.empty()) continue;
      const std::string whole = path.filename().string();
      const size_t ending = whole.find(".so");
      std::string own = whole.substr(0, ending);
      if (ending != whole.npos && whole.size() > ending + 4) own += whole.substr(ending + 4);
      for (const fs::path& candidate :
           {path.parent_path() / own / file, path.parent_path() / "libddsc0debian" / file, path.parent_path() / file}) {
        if (fs::exists(candidate, error)) return candidate.string();
      }
    }
  }
  return file;  // where the system looks
}

}  // namespace

void secure(dds_qos_t& qos, const std::string& folder) {
  const fs::path place = fs::absolute(folder);
  const auto set = [&](const std::string& name, const std::string& value) { dds_qset_prop(&qos, name.c_str(), value.c_str()); };
  for (const KeyFile& file : key_files) {
    check(place, file);
    set(file.property, "file:" + (place / file.name).string());
  }
  const struct {
    std::string kind, library, function;
  } plugins[]{{"auth", "dds_security_auth", "authentication"},
              {"access", "dds_security_ac", "access_control"},
              {"crypto", "dds_security_crypto", "crypto"}};
  for (const auto& [kind, library, function] : plugins) {
    const std::string path = plugin(library);
    void* const opened = dlopen(path.c_str(), RTLD_LAZY | RTLD_LOCAL);
    if (!opened) throw std::runtime_error("a security plugin of Cyclone DDS cannot be loaded: " + std::string(dlerror()));
    dlclose(opened);
    set("dds.sec." + kind + ".library.path", path);
    set("dds.sec." + kind + ".library.init", "init_" + function);
    set("dds.sec." + kind + ".library.finalize", "finalize_" + function);
  }
}

}  // namespace bridge
