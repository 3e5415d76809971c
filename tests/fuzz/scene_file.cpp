// The reader of scene files.
#include "base/error.h"
#include "file/scene_reader.h"
#include "fuzz/fuzz.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  try {
    // Meshes beside a file in a folder that does not exist: none is found.
    fs::parse_scene({reinterpret_cast<const char*>(data), size}, "/nonexistent/fuzz.json", 1000);
  } catch (const fs::Error& error) {
    fuzz::require(error.text.starts_with("/nonexistent/fuzz.json") && error.text.size() <= 600, "a sentence:", error.text.c_str());
    fuzz::require(error.status != FS_ERROR_INVALID && error.status != FS_ERROR_INTERNAL, "a status of", error.text.c_str());
  }
  return 0;
}
