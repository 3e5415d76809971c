// A temporary folder for one test. The destructor removes it with all that is in it.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <iterator>
#include <stdexcept>
#include <string>

namespace scenes {

struct Folder {
  std::string path;

  Folder() : path((std::filesystem::temp_directory_path() / "forceserver-test-XXXXXX").string()) {
    if (!mkdtemp(path.data())) throw std::runtime_error("no folder " + path);
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  ~Folder() {
    std::error_code gone;
    std::filesystem::remove_all(path, gone);
  }

  std::string operator/(const std::string& name) const { return path + "/" + name; }
  size_t files() const {
    return static_cast<size_t>(std::distance(std::filesystem::directory_iterator(path), {}));
  }
};

}  // namespace scenes
