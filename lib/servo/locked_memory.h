// Memory that must not be paged out, because a tick uses it. It has whole pages of its own, so that locking and
// unlocking it never affects other data.
#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <new>
#include <utility>

namespace fs {

void* map_pages(size_t bytes);                               // whole pages, zeros. Throws std::bad_alloc
void unmap_pages(const void* pages, size_t bytes) noexcept;  // of the same size

// An allocator that gives a container's elements pages of their own.
template <class T>
struct PageAllocator {
  using value_type = T;
  PageAllocator() = default;
  template <class U>
  PageAllocator(const PageAllocator<U>&) {}
  T* allocate(size_t n) {
    if (n > std::numeric_limits<size_t>::max() / sizeof(T)) throw std::bad_alloc();
    return static_cast<T*>(map_pages(n * sizeof(T)));
  }
  void deallocate(T* pages, size_t n) noexcept { unmap_pages(pages, n * sizeof(T)); }
  friend bool operator==(const PageAllocator&, const PageAllocator&) { return true; }
};

// An upper bound of the thread-local data that a new thread has on its stack, in bytes.
size_t thread_local_bytes() noexcept;

// The stack of a thread, with a guard page below it: an overflow of the stack faults at once.
class Stack {
 public:
  explicit Stack(size_t bytes);
  ~Stack();
  Stack(const Stack&) = delete;
  Stack& operator=(const Stack&) = delete;
  void* begin() const noexcept { return begin_; }
  size_t size() const noexcept { return size_; }

 private:
  char* pages_;
  size_t guard_, size_;
  char* begin_;
};

// Keeps memory from being paged out: the pages it is given, and the loaded files of this library, the C library and the
// mathematical library. All locks share these files. What the application has locked of them itself stays locked.
class MemoryLock {
 public:
  MemoryLock() = default;
  ~MemoryLock() { unlock(); }
  MemoryLock(const MemoryLock&) = delete;
  MemoryLock& operator=(const MemoryLock&) = delete;

  // Brings all pages into memory at once and locks them. Returns false when the system does not allow it; then none is
  // locked.
  using Range = std::pair<const void*, size_t>;
  using Ranges = std::array<Range, 3>;
  bool lock(const Ranges& pages) noexcept;
  void unlock() noexcept;

 private:
  Ranges pages_{};  // null: not locked
  bool has_code_ = false;
};

}  // namespace fs
