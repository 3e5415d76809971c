// The reader of scene files.
#include <climits>

#include "base/error.h"
#include "file/scene_reader.h"
#include "fuzz/fuzz.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  try {
    // Meshes beside a file in a folder that does not exist: none is found.
    fs::parse_scene({reinterpret_cast<const char*>(data), size}, "/nonexistent/fuzz.json", 1000);
  } catch (const fs::Error& error) {
    // A sentence about a mesh quotes its whole path, because a part would not say which file is meant.
    const size_t longest = 600 + (error.text.find("/nonexistent/", 1) == error.text.npos ? 0 : PATH_MAX);
    const bool is_good = error.text.starts_with("/nonexistent/fuzz.json") && error.text.size() <= longest;
    fuzz::require(is_good, "a sentence:", error.text.c_str());
    fuzz::require(error.status != FS_ERROR_INVALID && error.status != FS_ERROR_INTERNAL, "a status of", error.text.c_str());
  }
  return 0;
}
