#include "base/whole_file.h"

#include <cerrno>
#include <cstdarg>
#include <cstdio>
#include <system_error>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/descriptor.h"
#include "base/error.h"
#include "base/text.h"

namespace fs {
namespace {

[[noreturn]] void fail_system(const std::string& path, const char* what, int error) {
  const bool is_missing = error == ENOENT || error == ENOTDIR;
  fail_at(is_missing ? FS_ERROR_NOT_FOUND : FS_ERROR_IO, path, "%s: %s", what, std::generic_category().message(error).c_str());
}

const char* kind_name(mode_t mode) {
  if (S_ISDIR(mode)) return "a directory";
  if (S_ISFIFO(mode)) return "a pipe";
  if (S_ISSOCK(mode)) return "a socket";
  return "a device";
}

// Creates a new file in `directory` ("" or ending in '/') with an unused name, and sets path to it.
int create_temporary(const std::string& directory, std::string& path) {
  for (unsigned i = 0;; ++i) {
    path = directory + ".forceserver-" + std::to_string(::getpid()) + "-" + std::to_string(i) + ".tmp";
    const int descriptor = ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (descriptor >= 0 || errno != EEXIST) return descriptor;
  }
}

bool write_all(int descriptor, std::string_view text) {
  while (!text.empty()) {
    const ssize_t written = ::write(descriptor, text.data(), text.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return false;
    text.remove_prefix(static_cast<size_t>(written));
  }
  return true;
}

}  // namespace

void fail_at(fs_status status, const std::string& where, const char* format, ...) {
  va_list arguments;
  va_start(arguments, format);
  const std::string text = formatted(format, arguments);
  va_end(arguments);
  throw Error{status, where + ": " + text};
}

std::string read_whole_file(const std::string& path, uint64_t most) {
  const auto require_regular = [&](const struct stat& status) {
    if (!S_ISREG(status.st_mode)) fail_at(FS_ERROR_IO, path, "is %s, must be a file", kind_name(status.st_mode));
  };
  struct stat status;
  if (::stat(path.c_str(), &status) == 0) require_regular(status);  // before open, which may have effects on a device
  // The file may have been replaced since stat. Without O_NONBLOCK, opening a pipe would wait for a writer.
  Descriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  if (file.get() < 0) fail_system(path, "cannot be opened", errno);
  if (::fstat(file.get(), &status) != 0) fail_system(path, "cannot be read", errno);
  require_regular(status);
  if (static_cast<uint64_t>(status.st_size) > most) {
    fail_at(FS_ERROR_IO, path, "has %lld bytes, must have at most %llu", static_cast<long long>(status.st_size),
            static_cast<unsigned long long>(most));
  }

  std::string bytes(static_cast<size_t>(status.st_size), '\0');
  size_t size = 0;
  while (size < bytes.size()) {
    const ssize_t count = ::read(file.get(), bytes.data() + size, bytes.size() - size);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) fail_system(path, "cannot be read", errno);
    if (count == 0) break;  // the file became shorter meanwhile
    size += static_cast<size_t>(count);
  }
  bytes.resize(size);
  return bytes;
}

void write_file_atomically(const std::string& path, const std::string& text) {
  struct stat old;
  const bool is_there = ::stat(path.c_str(), &old) == 0;
  if (is_there && !S_ISREG(old.st_mode)) {  // a rename would replace it, even /dev/null
    fail_at(FS_ERROR_IO, path, "is %s, cannot be replaced", kind_name(old.st_mode));
  }
  const std::string directory = path.substr(0, path.rfind('/') + 1);  // "" where there is no '/'
  std::string temporary;
  Descriptor file(create_temporary(directory, temporary));
  if (file.get() < 0) {
    fail_at(FS_ERROR_IO, path, "cannot be written: %s", std::generic_category().message(errno).c_str());
  }

  if (is_there) (void)!::fchmod(file.get(), old.st_mode & 07777);
  const bool is_good = write_all(file.get(), text) && ::fsync(file.get()) == 0 && file.close() == 0 &&
                       ::rename(temporary.c_str(), path.c_str()) == 0;
  if (!is_good) {
    const int error = errno;
    ::unlink(temporary.c_str());
    fail_at(FS_ERROR_IO, path, "cannot be written: %s; nothing was changed", std::generic_category().message(error).c_str());
  }
  // Flush the directory too, so that the rename reaches the disk; a file system that refuses this cannot do better.
  const Descriptor parent(::open(directory.empty() ? "." : directory.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (parent.get() >= 0) (void)!::fsync(parent.get());
}

}  // namespace fs
