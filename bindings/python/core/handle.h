// Handles of the library: calls with them are counted, and close() waits for those under way.
// All state here is guarded by the GIL, unless its comment says otherwise.
#pragma once

#include <atomic>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <set>
#include <thread>

#include "errors.h"

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

// What the generator says about each kind of handle: name, give_back, retain where there is one.
template <class T>
struct Kind;

// The handles with which this thread is in a call, the innermost first.
struct CallOfThread {
  const void* handle;
  CallOfThread* outer;
};
inline thread_local CallOfThread* calls_of_thread = nullptr;

// A handle of the library. Each call with it is counted; close() refuses later calls and waits for those under way. The
// last of them gives the handle back.
template <class T>
class Handle {
 public:
  explicit Handle(T* pointer) : pointer_(pointer), address_(pointer) {
    if constexpr (Kind<T>::ends_at_exit) alive.insert(this);
  }
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;
  // Nobody has a reference, so no call is under way, but for those of threads that a fork has left behind in the
  // parent: they may have had the library's locks.
  ~Handle() {
    if constexpr (Kind<T>::ends_at_exit) alive.erase(this);
    if (born_ == forks || calls_ == 0) give_back();
  }

  // Takes the pointer of a handle that nobody else uses.
  T* take() {
    enter();
    --calls_;
    if (calls_ > 0) {
      raise(FS_ERROR_STATE, std::string("this ") + Kind<T>::name + " is in use: it cannot become another's");
    }
    closing_ = true;
    return std::exchange(pointer_, nullptr);
  }

  T* enter() {
    if (born_ != forks) after_fork();
    if (closing_ || !pointer_) raise(FS_ERROR_STATE, std::string("this ") + Kind<T>::name + " is closed");
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

  static inline std::set<Handle*> alive;

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
    T* pointer = std::exchange(pointer_, nullptr);
    if (pointer) without_gil([&] { Kind<T>::give_back(pointer); });
  }

  void after_fork() {
    if (calls_ > 0) {
      raise(FS_ERROR_STATE, std::string("another thread was in a call with this ") + Kind<T>::name +
                                " when the process forked: the child cannot use it");
    }
    born_ = forks;
    (void)sync_.release();  // a mutex that a thread of the parent may have is not destroyed
    sync_ = std::make_unique<Sync>();
  }

  T* pointer_;
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
  explicit Use(Handle<T>& handle) : handle_(handle), pointer_(handle.enter()), call_{&handle, calls_of_thread} {
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
  Handle<T>& handle_;
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

// The C++ object of a Python object of this class or a subclass; null where it is another, or one whose __init__ has
// failed. (pybind11 itself would make room for the latter and go on with what lies there.)
template <class C>
C* made_of(py::handle object, PyTypeObject* type) {
  if (Py_TYPE(object.ptr()) != type && !PyType_IsSubtype(Py_TYPE(object.ptr()), type)) return nullptr;
  return static_cast<C*>(reinterpret_cast<py::detail::instance*>(object.ptr())->get_value_and_holder().value_ptr());
}

template <class T>
inline PyTypeObject* handle_type = nullptr;

template <class T>
Handle<T>& as_handle(py::handle object, const char* name) {
  if (auto* made = made_of<Handle<T>>(object, handle_type<T>)) return *made;
  type_error(std::string(name) + " must be a " + Kind<T>::name);
}

template <class T>
py::object new_handle(T* pointer) {
  if (!pointer) return py::none();
  try {
    return py::cast(std::make_unique<Handle<T>>(pointer));
  } catch (...) {
    Kind<T>::give_back(pointer);
    throw;
  }
}

// What there is to say in the repr of an open handle.
template <class T>
std::string described(T*) {
  return "";
}
inline std::string several(size_t count, const char* what) {
  return std::to_string(count) + " " + what + (count == 1 ? "" : "s");
}
inline std::string described(fs_shape* shape) {
  size_t points = 0, triangles = 0;
  fs_shape_get_points(shape, &points);
  const bool is_mesh = fs_shape_get_triangles(shape, &triangles) != nullptr;
  return " of " + several(points, "point") + (is_mesh ? ", " + several(triangles, "triangle") : "");
}
inline std::string described(fs_curve* curve) {
  if (const char* text = fs_curve_get_expression(curve)) return std::string(" '") + text + "'";
  size_t count = 0;
  double step = 0;
  fs_curve_get_table(curve, &count, &step);
  char said[64];
  snprintf(said, sizeof said, ", a table of %zu forces, one each %g m", count, step);
  return said;
}

template <class T>
py::class_<Handle<T>> handle_class(py::module_& module, const char* name, const char* doc) {
  using H = Handle<T>;
  py::class_<H> made(module, name, doc, py::module_local());
  handle_type<T> = reinterpret_cast<PyTypeObject*>(made.ptr());
  const auto as_self = [](const py::object& self) -> H& { return as_handle<T>(self, "self"); };
  // What object itself would do for protocols 0 and 1 ends the process: it makes an instance of pybind11's base class.
  const auto refuse = [](const py::object& self, const py::args&) -> py::object {
    type_error("cannot copy or pickle a " + text_of(py::type::of(self).attr("__name__")) + ": it is a handle of this process");
  };
  made.def("__reduce__", refuse).def("__reduce_ex__", refuse);
  made.def(py::init([](const py::object& other) { return std::make_unique<H>(as_handle<T>(other, "other").take()); }),
           py::arg("other"), "__init__(self, other)\n--\n\nTakes over what another one has, which is then closed.")
      .def(
          "close", [as_self](const py::object& self) { as_self(self).close(); },
          "close($self)\n--\n\nRefuses later calls, waits for calls under way in other threads, and gives the handle "
          "back. Where this thread itself is in a call, as in a signal's handler, the end of that call gives it back. A "
          "second close does nothing.")
      .def_property_readonly(
          "closed", [as_self](const py::object& self) { return as_self(self).closed(); }, "Whether close() was called.")
      .def("__enter__",
           [as_self](py::object self) {
             if (as_self(self).closed()) raise(FS_ERROR_STATE, std::string("this ") + Kind<T>::name + " is closed");
             return self;
           })
      .def("__exit__", [as_self](const py::object& self, const py::args&) { as_self(self).close(); })
      .def("__eq__",
           [as_self](const py::object& self, const py::object& other) -> py::object {
             const H* with = made_of<H>(other, handle_type<T>);
             if (!with) return py::reinterpret_borrow<py::object>(Py_NotImplemented);
             return py::bool_(as_self(self).equals(*with));
           })
      .def("__hash__", [as_self](const py::object& self) { return reinterpret_cast<intptr_t>(as_self(self).address()); })
      .def("__repr__", [as_self](const py::object& self) -> std::string {
        H& handle = as_self(self);
        const std::string type = text_of(py::type::of(self).attr("__name__"));
        if (handle.closed() || !handle.belongs_here()) return "<closed forceserver." + type + ">";
        const Use<T> use(handle);
        return "<forceserver." + type + described(static_cast<T*>(use)) + ">";
      });
  return made;
}

}  // namespace forceserver_python
