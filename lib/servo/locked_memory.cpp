#include "servo/locked_memory.h"

#include <link.h>
#ifdef __SANITIZE_ADDRESS__
#include <sanitizer/lsan_interface.h>
#endif
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstdint>
#include <mutex>

namespace fs {
namespace {

size_t page_size() noexcept { return static_cast<size_t>(sysconf(_SC_PAGESIZE)); }
size_t whole_pages(size_t bytes) noexcept { return (bytes + page_size() - 1) / page_size() * page_size(); }

// Whether any page of the range is locked. On Linux, msync with MS_INVALIDATE does nothing to these pages, but it fails
// with EBUSY if one of them is locked.
bool is_locked(const MemoryLock::Range& range) noexcept {
  return msync(const_cast<void*>(range.first), range.second, MS_ASYNC | MS_INVALIDATE) != 0 && errno == EBUSY;
}

// The segments of the loaded files whose functions a tick calls. They are locked once, however many servos there are.
class Code {
 public:
  bool lock() noexcept {
    const std::lock_guard lock(mutex_);
    if (users_++ > 0) return true;
    dl_iterate_phdr([](dl_phdr_info* info, size_t, void* self) { return static_cast<Code*>(self)->add(*info); }, this);
    if (!has_failed_) return true;
    release();
    return false;
  }
  void unlock() noexcept {
    const std::lock_guard lock(mutex_);
    release();
  }

 private:
  static constexpr size_t most_bytes = 16 << 20;  // of one segment: a larger one holds the application's data, too

  int add(const dl_phdr_info& info) noexcept {
    const auto parts = [&](auto f) {
      for (int i = 0; i < info.dlpi_phnum; ++i) {
        const ElfW(Phdr) & part = info.dlpi_phdr[i];
        if (part.p_type == PT_LOAD && part.p_flags & PF_R) f(info.dlpi_addr + part.p_vaddr, part.p_memsz);
      }
    };
    const std::array<uintptr_t, 3> wanted{reinterpret_cast<uintptr_t>(&page_size), reinterpret_cast<uintptr_t>(&clock_nanosleep),
                                          reinterpret_cast<uintptr_t>(static_cast<double (*)(double)>(&std::exp))};
    bool is_wanted = false;
    parts([&](uintptr_t begin, size_t size) {
      is_wanted = is_wanted || std::any_of(wanted.begin(), wanted.end(), [&](uintptr_t a) { return a - begin < size; });
    });
    if (is_wanted) parts([&](uintptr_t begin, size_t size) { add(begin, size); });
    return has_failed_;
  }
  void add(uintptr_t begin, size_t size) noexcept {
    const uintptr_t first = begin / page_size() * page_size();
    const size_t bytes = whole_pages(begin + size - first), half = whole_pages(bytes / 2);
    if (has_failed_ || bytes > most_bytes) return;
    const MemoryLock::Range range{reinterpret_cast<const void*>(first), bytes};
    if (!is_locked(range)) {
      has_failed_ = count_ == ranges_.size() || mlock(range.first, range.second) != 0;
      if (!has_failed_) ranges_[count_++] = range;
    } else if (bytes > page_size()) {  // a part is locked already: split the range to lock the rest
      add(first, half);
      add(first + half, bytes - half);
    }
  }
  void release() noexcept {
    if (--users_ > 0) return;
    for (size_t i = 0; i < count_; ++i) munlock(ranges_[i].first, ranges_[i].second);
    count_ = 0;
    has_failed_ = false;
  }

  std::mutex mutex_;
  int users_ = 0;
  bool has_failed_ = false;
  std::array<MemoryLock::Range, 256> ranges_;
  size_t count_ = 0;
};

Code& code() {
  // Never destroyed, because a servo may be stopped while the process ends. In static memory, so that creating it
  // cannot fail.
  alignas(Code) static std::byte place[sizeof(Code)];
  static Code& instance = *new (place) Code;
  return instance;
}

}  // namespace

void* map_pages(size_t bytes) {
  void* const pages = mmap(nullptr, whole_pages(bytes), PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (pages == MAP_FAILED) throw std::bad_alloc();
#ifdef __SANITIZE_ADDRESS__
  __lsan_register_root_region(pages, whole_pages(bytes));  // what only these pages refer to is not a leak
#endif
  return pages;
}

void unmap_pages(const void* pages, size_t bytes) noexcept {
#ifdef __SANITIZE_ADDRESS__
  __lsan_unregister_root_region(pages, whole_pages(bytes));
#endif
  munmap(const_cast<void*>(pages), whole_pages(bytes));
}

// Adds up the thread-local data of all loaded files, although some of it may not be on the stack, and 64 KiB that the C
// library reserves for files loaded later and for itself.
size_t thread_local_bytes() noexcept {
  size_t sum = 64 << 10;
  const auto add = [](dl_phdr_info* info, size_t, void* total) {
    for (int i = 0; i < info->dlpi_phnum; ++i) {
      const ElfW(Phdr) & part = info->dlpi_phdr[i];
      if (part.p_type == PT_TLS) *static_cast<size_t*>(total) += part.p_memsz + part.p_align;
    }
    return 0;
  };
  dl_iterate_phdr(add, &sum);
  return sum;
}

Stack::Stack(size_t bytes)
    : pages_(static_cast<char*>(map_pages(whole_pages(bytes) + page_size()))), guard_(page_size()), size_(whole_pages(bytes)),
      begin_(pages_ + guard_) {
  mprotect(pages_, guard_, PROT_NONE);
}

Stack::~Stack() { unmap_pages(pages_, guard_ + size_); }

bool MemoryLock::lock(const Ranges& pages) noexcept {
  has_code_ = code().lock();
  bool is_good = has_code_;
  for (size_t i = 0; i < pages.size() && is_good; ++i) {
    is_good = mlock(pages[i].first, pages[i].second) == 0;
    if (is_good) pages_[i] = pages[i];
  }
  if (!is_good) unlock();
  return is_good;
}

void MemoryLock::unlock() noexcept {
  for (Range& range : pages_) {
    if (range.first) munlock(range.first, range.second);
    range = {};
  }
  if (std::exchange(has_code_, false)) code().unlock();
}

}  // namespace fs
