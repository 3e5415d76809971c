// Files that are no good as a maker's library.
#pragma once

#include <dlfcn.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "scenes/folder.h"

namespace makers {

// Whether this machine has a library of a maker itself.
inline bool is_installed(const char* name) { return dlopen(name, RTLD_LAZY | RTLD_LOCAL) != nullptr; }

// A copy of a library that says of itself that it is for another processor (byte 18 of an ELF file; 0xb7: AArch64, 0x3e: x86-64).
inline std::string for_another_processor(const scenes::Folder& folder, const std::string& library) {
  const std::string path = folder / "other.so";
  std::filesystem::copy_file(library, path);
  std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
  file.seekg(18);
  const char other = file.get() == 0xb7 ? 0x3e : static_cast<char>(0xb7);
  file.seekp(18).put(other);
  return path;
}

// A text with the name of a library.
inline std::string no_library(const scenes::Folder& folder) {
  const std::string path = folder / "text.so";
  std::ofstream(path) << "this is not a library\n";
  return path;
}

}  // namespace makers
