// Intrusive reference counts: a C handle is the object itself, and Ref is the C++ way to hold one.
// LocalCounted is the same without atomics, for objects that a lock guards.
#pragma once

#include <atomic>
#include <cassert>
#include <cstdint>
#include <utility>

namespace fs {

template <class Derived>
class LocalCounted {
 public:
  void retain() const noexcept { ++references_; }
  void release() const noexcept {
    assert(references_ > 0);
    if (--references_ == 0) delete static_cast<const Derived*>(this);
  }
  // True while the caller has the only reference; then it may change the object in place.
  bool is_unique() const noexcept { return references_ == 1; }

 protected:
  LocalCounted() = default;
  LocalCounted(const LocalCounted&) {}  // a copy has its own count
  ~LocalCounted() = default;

 private:
  mutable uint32_t references_ = 1;
};

template <class Derived>
class Counted {
 public:
  Counted() = default;
  Counted(const Counted&) {}  // a copy has its own count
  Counted& operator=(const Counted&) = delete;

  void retain() const noexcept { references_.fetch_add(1, std::memory_order_relaxed); }
  void release() const noexcept {
    const uint32_t before = references_.fetch_sub(1, std::memory_order_acq_rel);
    assert(before > 0);
    if (before == 1) delete static_cast<const Derived*>(this);
  }

 protected:
  ~Counted() = default;

 private:
  mutable std::atomic<uint32_t> references_{1};
};

// A reference to a Counted object. Null is allowed.
template <class T>
class Ref {
 public:
  Ref() = default;
  Ref(std::nullptr_t) {}
  Ref(const Ref& other) noexcept : Ref(retain(other.pointer_)) {}
  Ref(Ref&& other) noexcept : pointer_(std::exchange(other.pointer_, nullptr)) {}
  template <class U>
  Ref(Ref<U> other) noexcept : pointer_(other.detach()) {}
  Ref& operator=(Ref other) noexcept {
    std::swap(pointer_, other.pointer_);
    return *this;
  }
  ~Ref() {
    if (pointer_) pointer_->release();
  }

  static Ref adopt(T* pointer) noexcept {  // takes over the caller's reference
    Ref ref;
    ref.pointer_ = pointer;
    return ref;
  }
  static Ref retain(T* pointer) noexcept {  // adds one
    if (pointer) pointer->retain();
    return adopt(pointer);
  }
  T* detach() noexcept { return std::exchange(pointer_, nullptr); }  // gives the reference to the caller

  T* get() const noexcept { return pointer_; }
  T* operator->() const noexcept { return pointer_; }
  T& operator*() const noexcept { return *pointer_; }
  explicit operator bool() const noexcept { return pointer_ != nullptr; }
  friend bool operator==(const Ref& a, const Ref& b) noexcept { return a.pointer_ == b.pointer_; }

 private:
  T* pointer_ = nullptr;
};

template <class T, class... Arguments>
Ref<T> make_ref(Arguments&&... arguments) {
  return Ref<T>::adopt(new T(std::forward<Arguments>(arguments)...));
}

}  // namespace fs
