// Helpers for the C functions, which let no exception out and no null pointer in.
#pragma once

#include <cstring>
#include <exception>
#include <new>
#include <stdexcept>

#include "base/error.h"

namespace fs {

// Runs f and turns an exception into a status; the exception's text becomes fs_last_error.
template <class F>
fs_status guarded(F&& f) noexcept {
  try {
    f();
    return FS_OK;
  } catch (Error& error) {
    return set_last_error(error.status, std::move(error.text));
  } catch (const std::bad_alloc&) {
    return set_last_error_literal(FS_ERROR_MEMORY, "out of memory");
  } catch (const std::length_error&) {  // a list longer than memory can be
    return set_last_error_literal(FS_ERROR_MEMORY, "out of memory");
  } catch (const std::exception& error) {
    return set_last_error(FS_ERROR_INTERNAL, error.what());
  }
}

// Throws INVALID if the argument is null; name: of the argument.
inline void require_pointer(const void* pointer, const char* name) {
  if (!pointer) fail(FS_ERROR_INVALID, "%s is null", name);
}

// [rt] For functions that must not throw: `return null_argument("tool is null")`.
inline fs_status null_argument(const char* literal) noexcept { return set_last_error_literal(FS_ERROR_INVALID, literal); }

// Copies as many elements as fit to `out`, and gives the size of the whole list in *count.
template <class T, class List>
void copy_list(const List& list, T* out, size_t capacity, size_t* count) {
  require_pointer(count, "count");
  if (capacity) require_pointer(out, "out");
  size_t i = 0;
  for (const T& element : list) {
    if (i == capacity) break;
    out[i++] = element;
  }
  *count = list.size();
}

}  // namespace fs
