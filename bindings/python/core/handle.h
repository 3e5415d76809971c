// Handles of the library: calls with them are counted, and close() waits for those under way.
// All state here is guarded by the GIL, unless its comment says otherwise.
#pragma once

#include <atomic>
#include <condition_variable>
#include <mutex>
#include <set>
#include <thread>

#include "functions.h"
#include "objects.h"

namespace forceserver_python {

inline unsigned forks = 0;  // how many forks lie between this process and the one that imported the module

// Wakes those who wait for a change of what the GIL guards. They wait without the GIL.
class Bell {
 public:
  void ring() {
    const std::lock_guard lock(mutex_);
    ++rings_;
    rung_.notify_all();
  }
  // Until the next ring, or for one slice; then signals are handled. `rings` is taken before the state is looked at.
  void wait(unsigned rings) {
    without_gil([&] {
      std::unique_lock lock(mutex_);
      rung_.wait_for(lock, slice, [&] { return rings_ != rings; });
    });
    check_signals();
  }
  unsigned rings() {
    const std::lock_guard lock(mutex_);
    return rings_;
  }

 private:
  std::mutex mutex_;
  std::condition_variable rung_;
  unsigned rings_ = 0;
};

// A kind of handle of the library, as the generator says it.
struct Kind {
  const char* name;
  bool ends_at_exit;
  void (*give_back)(void* handle);        // takes null too
  void* (*retain)(void* handle);          // null: there is none
  std::string (*described)(void* handle);  // what its repr says; null: nothing
  PyTypeObject* type = nullptr;           // in Python
};
template <class T>
inline Kind kind_of;
inline std::vector<Kind*> kinds;  // all
template <class T>
py::handle python_class() {
  return reinterpret_cast<PyObject*>(kind_of<T>.type);
}

template <class T>
T* retained(T* handle) {
  return handle ? static_cast<T*>(kind_of<T>.retain(handle)) : nullptr;
}
template <class T>
void give_back(T* handle) {
  kind_of<T>.give_back(handle);
}

// The handles with which this thread is in a call, the innermost first.
struct CallOfThread {
  const void* handle;
  CallOfThread* outer;
};
inline thread_local CallOfThread* calls_of_thread = nullptr;

// A handle of the library. Each call with it is counted; close() refuses later calls and waits for those under way. The
// last of them gives the handle back.
class Handle {
 public:
  Handle(void* pointer, const Kind& kind) : kind_(kind), pointer_(pointer), address_(pointer) {
    if (kind.ends_at_exit) alive.insert(this);
  }
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;
  // Nobody has a reference, so no call is under way, but for those of threads that a fork has left behind in the
  // parent: they may have had the library's locks.
  ~Handle() {
    if (kind_.ends_at_exit) alive.erase(this);
    if (born_ == forks || calls_ == 0) give_back();
  }

  // Takes the pointer of a handle that nobody else uses.
  void* take() {
    enter();
    --calls_;
    if (calls_ > 0) {
      raise(FS_ERROR_STATE, std::string("this ") + kind_.name + " is in use: it cannot become another's");
    }
    closing_ = true;
    return std::exchange(pointer_, nullptr);
  }

  void* enter() {
    if (born_ != forks) after_fork();
    if (closing_ || !pointer_) raise(FS_ERROR_STATE, std::string("this ") + kind_.name + " is closed");
    ++calls_;
    return pointer_;
  }
  // The call that gives a closed handle back is counted until that is done: so whoever closes it as well waits for it.
  void leave() {
    if (closing_ && calls_ == 1) give_back();
    --calls_;
    if (closing_ && calls_ == 0) sync_->bell.ring();
  }

  void close() {
    closing_ = true;
    if (born_ != forks && calls_ > 0) {  // see the destructor
      pointer_ = nullptr;
    } else if (calls_ == 0) {
      ++calls_;
      leave();
    } else if (!is_in_call_of_this_thread()) {  // as a signal's handler or a finalizer may be
      while (calls_ > 0) {
        const unsigned rings = sync_->bell.rings();
        if (calls_ > 0) sync_->bell.wait(rings);
      }
    }
  }
  const Kind& kind() const { return kind_; }
  bool closed() const { return closing_ || !pointer_; }
  bool belongs_here() const { return born_ == forks || calls_ == 0; }  // false: see after_fork

  // Equal are those of the same thing: while both are open, else only one and itself.
  bool equals(const Handle& other) const {
    return this == &other || (!closed() && !other.closed() && pointer_ == other.pointer_);
  }
  const void* address() const { return address_; }  // also after close()

  // Read without the GIL, between the ticks of a long step.
  bool closing() const { return closing_; }

  // One thread at a time, for tools.
  std::mutex& serial() { return sync_->serial; }

  static inline std::set<Handle*> alive;  // of those that end at exit

  // At the end of the interpreter: all that are alive, also those that a daemon thread uses.
  static void close_all() {
    for (int waits = 0; !alive.empty();) {
      Handle& handle = **alive.begin();
      handle.closing_ = true;
      if (handle.born_ == forks && handle.calls_ > 0 && waits < 2000) {
        ++waits;
        without_gil([] { std::this_thread::sleep_for(std::chrono::milliseconds(1)); });
        continue;
      }
      alive.erase(&handle);
      if (handle.calls_ == 0) handle.close();
    }
  }

 private:
  struct Sync {
    Bell bell;
    std::mutex serial;
  };

  bool is_in_call_of_this_thread() const {
    for (const CallOfThread* call = calls_of_thread; call; call = call->outer) {
      if (call->handle == this) return true;
    }
    return false;
  }

  void give_back() {
    closing_ = true;
    void* pointer = std::exchange(pointer_, nullptr);
    if (pointer) without_gil([&] { kind_.give_back(pointer); });
  }

  void after_fork() {
    if (calls_ > 0) {
      raise(FS_ERROR_STATE, std::string("another thread was in a call with this ") + kind_.name +
                                " when the process forked: the child cannot use it");
    }
    born_ = forks;
    (void)sync_.release();  // a mutex that a thread of the parent may have is not destroyed
    sync_ = std::make_unique<Sync>();
  }

  const Kind& kind_;
  void* pointer_;
  const void* address_;
  int calls_ = 0;
  std::atomic<bool> closing_ = false;
  unsigned born_ = forks;
  std::unique_ptr<Sync> sync_ = std::make_unique<Sync>();
};

// Counts a call in, and out again. Made and destroyed with the GIL.
template <class T>
class Use {
 public:
  explicit Use(Handle& handle) : handle_(handle), pointer_(static_cast<T*>(handle.enter())), call_{&handle, calls_of_thread} {
    calls_of_thread = &call_;
  }
  Use(const Use&) = delete;
  Use& operator=(const Use&) = delete;
  ~Use() {
    calls_of_thread = call_.outer;
    handle_.leave();
  }
  operator T*() const { return pointer_; }

 private:
  Handle& handle_;
  T* pointer_;
  CallOfThread call_;
};

// The mutex of a tool. Who waits for it does not have the GIL.
class Serial {
 public:
  explicit Serial(std::mutex& mutex) : mutex_(mutex) {
    if (!mutex_.try_lock()) without_gil([&] { mutex_.lock(); });
  }
  Serial(const Serial&) = delete;
  Serial& operator=(const Serial&) = delete;
  ~Serial() { mutex_.unlock(); }

 private:
  std::mutex& mutex_;
};

inline Handle& as_handle(py::handle object, const Kind& kind, const char* name) {
  if (auto* made = made_of<Handle>(object, kind.type)) return *made;
  type_error(std::string(name) + " must be a " + kind.name);
}
template <class T>
Handle& as_handle(py::handle object, const char* name) {
  return as_handle(object, kind_of<T>, name);
}

inline py::object new_handle(void* pointer, const Kind& kind) {
  if (!pointer) return py::none();
  try {
    return new_object(kind.type, std::make_unique<Handle>(pointer, kind));
  } catch (...) {
    kind.give_back(pointer);
    throw;
  }
}
template <class T>
py::object new_handle(T* pointer) {
  return new_handle(pointer, kind_of<T>);
}

}  // namespace forceserver_python
