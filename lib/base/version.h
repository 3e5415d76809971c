// The library's version as text.
#pragma once

#include <forceserver/base.h>

#define FS_STRING_OF(x) #x
#define FS_VERSION_TEXT(major, minor, patch) FS_STRING_OF(major) "." FS_STRING_OF(minor) "." FS_STRING_OF(patch)

namespace fs {

inline constexpr char library_version[] = FS_VERSION_TEXT(FS_VERSION_MAJOR, FS_VERSION_MINOR, FS_VERSION_PATCH);

}  // namespace fs

#undef FS_VERSION_TEXT
#undef FS_STRING_OF
