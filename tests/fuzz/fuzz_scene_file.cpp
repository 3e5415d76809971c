// libFuzzer on the reader of scene files. Built and run by tests/fuzz/run.
#include <cstdlib>

#include "base/error.h"
#include "file/scene_reader.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  try {
    // Meshes beside a file in a folder that does not exist: none is found.
    fs::parse_scene({reinterpret_cast<const char*>(data), size}, "/nonexistent/fuzz.json", 1000);
  } catch (const fs::Error& error) {
    if (!error.text.starts_with("/nonexistent/fuzz.json") || error.text.size() > 600) std::abort();
    if (error.status == FS_ERROR_INVALID || error.status == FS_ERROR_INTERNAL) std::abort();
  }
  return 0;
}
