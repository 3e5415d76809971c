// What every generated function of forceserver._core is made of: handles, structs, arrays, enums and errors.
// All state here is guarded by the GIL, unless its comment says otherwise.
#pragma once

#include <cxxabi.h>
#include <pthread.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstring>
#include <functional>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <thread>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

#include <pybind11/eval.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <forceserver/driver.h>
#include <forceserver/forceserver.h>

namespace forceserver_python {

namespace py = pybind11;

// ------------------------------------------------------------------------------------------------------------- errors

// The exception class of each status, filled by the module's initialisation; never freed.
struct Errors {
  PyObject* base = nullptr;
  std::vector<std::pair<int, PyObject*>> classes;

  PyObject* of(int status) const {
    for (const auto& [value, type] : classes) {
      if (value == status) return type;
    }
    return base;
  }
};
inline Errors errors;

[[noreturn]] inline void raise(PyObject* type, const std::string& text) {
  PyObject* message = PyUnicode_DecodeUTF8(text.data(), static_cast<Py_ssize_t>(text.size()), "replace");
  if (message) PyErr_SetObject(type, py::reinterpret_steal<py::object>(message).ptr());
  throw py::error_already_set();
}

[[noreturn]] inline void raise(fs_status status, const std::string& text) { raise(errors.of(status), text); }
[[noreturn]] inline void type_error(const std::string& text) { raise(PyExc_TypeError, text); }
[[noreturn]] inline void value_error(const std::string& text) { raise(PyExc_ValueError, text); }

// fs_last_error belongs to this thread, so it is still the sentence of the call that has just returned.
inline void check(fs_status status) {
  if (status < 0) raise(status, fs_last_error());
}

// Ctrl-C and other signals run their Python handlers here.
inline void check_signals() {
  if (PyErr_CheckSignals() != 0) throw py::error_already_set();
}

// str(object)
inline std::string text_of(py::handle object) { return py::cast<std::string>(py::str(object)); }

constexpr std::chrono::milliseconds slice{100};  // a wait looks for signals this often

// A daemon thread that comes back while the interpreter ends never gets the GIL: CPython before 3.14 ends such a thread
// by unwinding its stack, which would run destructors that need the GIL. So it stays here until the process has ended.
inline void take_gil(PyThreadState* state) {
  try {
    PyEval_RestoreThread(state);
  } catch (abi::__forced_unwind&) {
    for (;;) pause();
  }
}

template <class F>
auto without_gil(F&& call) {
  PyThreadState* const state = PyEval_SaveThread();
  if constexpr (std::is_void_v<decltype(call())>) {
    call();
    take_gil(state);
  } else {
    const auto result = call();
    take_gil(state);
    return result;
  }
}

// ------------------------------------------------------------------------------------------------------------ handles

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

// A handle of the library. Each call with it is counted; close() refuses later calls, waits for those under way, and
// gives the handle back.
template <class T>
class Handle {
 public:
  explicit Handle(T* pointer) : pointer_(pointer) {
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
    leave();
    closing_ = true;
    return std::exchange(pointer_, nullptr);
  }

  T* enter() {
    if (born_ != forks) after_fork();
    if (closing_ || !pointer_) raise(FS_ERROR_STATE, std::string("this ") + Kind<T>::name + " is closed");
    ++calls_;
    return pointer_;
  }
  void leave() {
    --calls_;
    if (closing_ && calls_ == 0) sync_->bell.ring();
  }

  void close() {
    closing_ = true;
    if (born_ != forks && calls_ > 0) pointer_ = nullptr;  // see the destructor
    while (pointer_ && calls_ > 0) {
      const unsigned rings = sync_->bell.rings();
      if (calls_ > 0) sync_->bell.wait(rings);
    }
    give_back();
  }
  bool closed() const { return closing_ || !pointer_; }
  const void* address() const { return pointer_; }
  // Read without the GIL, between the ticks of a long step.
  bool closing() const { return closing_; }

  // One thread at a time, for tools.
  std::mutex& serial() { return sync_->serial; }

  // A group of changes belongs to the thread that began it. Changes by other threads wait until it is closed.
  void begin_change() {
    wait_until([&] { return holder_ == 0 || holder_ == PyThread_get_thread_ident(); });
    ++changing_;
  }
  void end_change() {
    --changing_;
    sync_->bell.ring();
  }
  // False: this thread has it already.
  bool hold() {
    const unsigned long self = PyThread_get_thread_ident();
    if (holder_ == self) return false;
    wait_until([&] { return holder_ == 0; });
    holder_ = self;
    try {
      wait_until([&] { return changing_ == 0; });
    } catch (...) {
      let_go();
      throw;
    }
    return true;
  }
  void let_go() {
    holder_ = 0;
    sync_->bell.ring();
  }

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
      if (handle.calls_ == 0) handle.give_back();
    }
  }

 private:
  struct Sync {
    Bell bell;
    std::mutex serial;
  };

  template <class Condition>
  void wait_until(Condition condition) {
    while (!condition()) {
      const unsigned rings = sync_->bell.rings();
      if (condition()) return;
      leave();  // so that a signal's handler can close the handle
      try {
        sync_->bell.wait(rings);
      } catch (...) {
        ++calls_;
        throw;
      }
      enter_again();
    }
  }
  void enter_again() {
    ++calls_;
    if (closing_) raise(FS_ERROR_STATE, std::string("this ") + Kind<T>::name + " is closed");
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
    if constexpr (std::is_same_v<T, fs_scene>) {
      if (holder_ != 0 && holder_ != PyThread_get_thread_ident()) {
        holder_ = 0;
        fs_scene_cancel(pointer_);
      }
    }
  }

  T* pointer_;
  int calls_ = 0;
  std::atomic<bool> closing_ = false;
  unsigned born_ = forks;
  unsigned long holder_ = 0;  // the thread whose group is open; 0: none
  int changing_ = 0;          // changes under way
  std::unique_ptr<Sync> sync_ = std::make_unique<Sync>();
};

// Counts a call in, and out again. Made and destroyed with the GIL.
template <class T>
class Use {
 public:
  explicit Use(Handle<T>& handle) : handle_(handle), pointer_(handle.enter()) {}
  Use(const Use&) = delete;
  Use& operator=(const Use&) = delete;
  ~Use() { handle_.leave(); }
  operator T*() const { return pointer_; }

 private:
  Handle<T>& handle_;
  T* pointer_;
};

// A change of a scene: waits while another thread has a group open.
class Change {
 public:
  explicit Change(Handle<fs_scene>& scene) : scene_(scene) { scene.begin_change(); }
  Change(const Change&) = delete;
  Change& operator=(const Change&) = delete;
  ~Change() { scene_.end_change(); }

 private:
  Handle<fs_scene>& scene_;
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

// -------------------------------------------------------------------------------------------------------------- enums

// A Python enum of the headers. Never freed.
struct Enum {
  PyObject* type = nullptr;
  PyObject* members = nullptr;  // value -> member
  bool flags = false;

  py::object to_python(long value) const {
    const py::int_ key(value);
    if (flags) return py::reinterpret_borrow<py::object>(type)(key);
    PyObject* member = PyDict_GetItem(members, key.ptr());
    return member ? py::reinterpret_borrow<py::object>(member) : py::object(key);  // a newer library may have more
  }
  long from_python(py::handle value, const char* name) const {
    if (PyUnicode_Check(value.ptr())) {
      const py::object upper = value.attr("upper")();
      const py::object all = py::reinterpret_borrow<py::object>(type).attr("__members__");
      if (!all.contains(upper)) value_error(std::string(name) + ": no such name: '" + text_of(value) + "'");
      return PyLong_AsLong(all[upper].ptr());
    }
    if (!PyLong_Check(value.ptr()) || PyBool_Check(value.ptr())) {
      type_error(std::string(name) + " must be an enum, an int or a name");
    }
    const long number = PyLong_AsLong(value.ptr());
    if (number == -1 && PyErr_Occurred()) throw py::error_already_set();
    if (flags ? number < 0 || number > UINT32_MAX : !PyDict_GetItem(members, value.ptr())) {
      value_error(std::string(name) + ": no such value: " + std::to_string(number));
    }
    return number;
  }
};
template <class T>
inline Enum enum_of;  // T: the C enum

inline Enum make_enum(py::module_& module, const char* name, const char* doc, bool flags,
                      const std::vector<std::tuple<const char*, long>>& values) {
  py::list items;
  for (const auto& [key, value] : values) items.append(py::make_tuple(key, value));
  const py::object type = py::module_::import("enum").attr(flags ? "IntFlag" : "IntEnum")(
      name, items, py::arg("module") = "forceserver._core");
  type.attr("__doc__") = doc;
  py::dict members;
  for (const auto& [key, value] : values) members[py::int_(value)] = type.attr(key);
  module.attr(name) = type;
  return {py::object(type).release().ptr(), members.release().ptr(), flags};
}

// ------------------------------------------------------------------------------------------------- numbers and strings

template <class T>
T number(py::handle value, const char* name) {
  if constexpr (std::is_same_v<T, bool>) {
    if (value.ptr() == Py_True) return true;
    if (value.ptr() == Py_False) return false;
    const std::string type = Py_TYPE(value.ptr())->tp_name;
    if (type == "numpy.bool" || type == "numpy.bool_") return PyObject_IsTrue(value.ptr()) == 1;
    type_error(std::string(name) + " must be True or False");
  } else if constexpr (std::is_floating_point_v<T>) {
    if (PyFloat_CheckExact(value.ptr())) return PyFloat_AS_DOUBLE(value.ptr());
    const double number = PyFloat_AsDouble(value.ptr());
    if (number == -1 && PyErr_Occurred()) {
      PyErr_Clear();
      type_error(std::string(name) + " must be a number");
    }
    return number;
  } else {
    py::detail::make_caster<T> caster;
    if (!caster.load(value, false)) {
      if (!PyIndex_Check(value.ptr())) type_error(std::string(name) + " must be an int");
      const py::object index = py::reinterpret_steal<py::object>(PyNumber_Index(value.ptr()));
      if (!index || !caster.load(index, false)) {
        PyErr_Clear();
        value_error(std::string(name) + " is out of range");
      }
    }
    return py::detail::cast_op<T>(caster);
  }
}

// A string for the library: str, bytes, or for a path anything with __fspath__; null for None where that is allowed.
class Text {
 public:
  Text(py::handle value, const char* name, bool null, bool path = false) {
    if (value.is_none() && null) return;
    py::object object = py::reinterpret_borrow<py::object>(value);
    if (path && !PyUnicode_Check(value.ptr()) && !PyBytes_Check(value.ptr())) {
      object = py::reinterpret_steal<py::object>(PyOS_FSPath(value.ptr()));
      if (!object) throw py::error_already_set();
    }
    if (PyUnicode_Check(object.ptr())) {
      object = py::reinterpret_steal<py::object>(PyUnicode_AsEncodedString(object.ptr(), "utf-8", "surrogateescape"));
      if (!object) throw py::error_already_set();
    }
    if (!PyBytes_Check(object.ptr())) type_error(std::string(name) + " must be a str");
    text_ = static_cast<std::string>(py::reinterpret_borrow<py::bytes>(object));
    if (text_.find('\0') != std::string::npos) value_error(std::string(name) + " has a null character");
    null_ = false;
  }
  const char* get() const { return null_ ? nullptr : text_.c_str(); }
  size_t size() const { return text_.size(); }

 private:
  std::string text_;
  bool null_ = true;
};

inline py::object text_to_python(const char* text, size_t size) {
  PyObject* object = PyUnicode_DecodeUTF8(text, static_cast<Py_ssize_t>(size), "surrogateescape");
  if (!object) throw py::error_already_set();
  return py::reinterpret_steal<py::object>(object);
}
inline py::object text_to_python(const char* text) {
  return text ? text_to_python(text, strlen(text)) : py::object(py::none());
}

// ------------------------------------------------------------------------------------------------------------- arrays

inline std::string shape_text(const py::array& array) {
  return text_of(array.attr("shape"));
}

inline bool has_shape(const py::array& array, const std::vector<py::ssize_t>& shape) {
  return std::equal(shape.begin(), shape.end(), array.shape(), array.shape() + array.ndim());
}

// Any array of numbers, a sequence too.
inline py::array to_array(py::handle value, const char* name) {
  py::object array;
  if (py::isinstance<py::array>(value)) {
    array = py::reinterpret_borrow<py::object>(value);
  } else {
    if (PyUnicode_Check(value.ptr()) || value.is_none()) type_error(std::string(name) + " must be numbers");
    try {
      array = py::module_::import("numpy").attr("asarray")(value);
    } catch (py::error_already_set& error) {
      if (!error.matches(PyExc_ValueError)) throw;  // a ragged sequence
      type_error(std::string(name) + ": " + error.what());
    }
  }
  return py::reinterpret_borrow<py::array>(array);
}

// The entries of an array that comes in, as T in one piece: shape (n,) for width 1, else (n, width). Rounding and
// complex numbers are refused; integers are looked at one by one where they could be out of range.
template <class T>
py::array entries(py::handle value, int width, const char* name) {
  py::array array = to_array(value, name);
  const char kind = array.dtype().kind();
  const auto fail = [&] {
    const std::string wanted = std::is_floating_point_v<T> ? "floats" : "integers";
    type_error(std::string(name) + " must be " + wanted + " of shape (n" +
               (width > 1 ? ", " + std::to_string(width) : ",") + "), not " + text_of(array.dtype()) +
               " of shape " + shape_text(array));
  };
  const bool empty = array.size() == 0 && array.ndim() <= 2;
  if (kind != 'i' && kind != 'u' && !(std::is_floating_point_v<T> && kind == 'f') && !empty) fail();
  if (!empty && (width == 1 ? array.ndim() != 1 : array.ndim() != 2 || array.shape(1) != width)) fail();
  if constexpr (std::is_integral_v<T>) {
    if (!empty && !py::isinstance<py::array_t<T>>(array)) {
      const py::object low = array.attr("min")(), high = array.attr("max")();
      const bool negative = low < py::int_(0);
      if (negative || high > py::int_(std::numeric_limits<T>::max())) {
        value_error(std::string(name) + ": out of range: " + text_of(negative ? low : high));
      }
    }
  }
  return py::array_t<T, py::array::c_style | py::array::forcecast>::ensure(array);
}

// Where results go: the caller's array, which must be right as it is, or a new one.
template <class T>
py::array results(py::handle out, const std::vector<py::ssize_t>& shape, const char* name) {
  if (out.is_none()) return py::array_t<T>(shape);
  const auto fail = [&](const std::string& why) {
    py::tuple wanted(shape.size());
    for (size_t i = 0; i < shape.size(); ++i) wanted[i] = shape[i];
    type_error(std::string(name) + " must be a writable array in one piece of " +
               text_of(py::dtype::of<T>()) + ", shape " + text_of(wanted) +
               ": " + why);
  };
  if (!py::isinstance<py::array>(out)) fail("it is no numpy array");
  py::array array = py::reinterpret_borrow<py::array>(out);
  if (!py::isinstance<py::array_t<T>>(out)) fail("it has " + text_of(array.dtype()));
  if (!has_shape(array, shape)) {
    fail("it has shape " + shape_text(array));
  }
  if (!(array.flags() & py::array::c_style) || reinterpret_cast<uintptr_t>(array.data()) % alignof(T) != 0) {
    fail("it has gaps between its entries");
  }
  if (!array.writeable()) fail("it is read-only");
  return array;
}

// One vector, quaternion or matrix: a sequence or array of `count` numbers.
inline void load_doubles(py::handle value, double* out, const std::vector<py::ssize_t>& shape, const char* name) {
  size_t count = 1;
  for (const py::ssize_t side : shape) count *= static_cast<size_t>(side);
  if (shape.size() == 1 && (PyTuple_CheckExact(value.ptr()) || PyList_CheckExact(value.ptr()))) {
    if (static_cast<size_t>(PySequence_Fast_GET_SIZE(value.ptr())) == count) {
      std::vector<double> values(count);
      size_t i = 0;
      for (; i < count; ++i) {
        PyObject* item = PySequence_Fast_GET_ITEM(value.ptr(), static_cast<Py_ssize_t>(i));
        if (!PyFloat_Check(item) && !PyLong_Check(item)) break;
        values[i] = PyFloat_AsDouble(item);
        if (values[i] == -1 && PyErr_Occurred()) throw py::error_already_set();
      }
      if (i == count) {
        std::copy(values.begin(), values.end(), out);
        return;
      }
    }
  }
  const py::array array = to_array(value, name);
  const char kind = array.dtype().kind();
  if ((kind != 'f' && kind != 'i' && kind != 'u') || !has_shape(array, shape)) {
    py::tuple wanted(shape.size());
    for (size_t i = 0; i < shape.size(); ++i) wanted[i] = shape[i];
    type_error(std::string(name) + " must be numbers of shape " + text_of(wanted) + ", not " +
               text_of(array.dtype()) + " of shape " + shape_text(array));
  }
  const auto doubles = py::array_t<double, py::array::c_style | py::array::forcecast>::ensure(array);
  std::memcpy(out, doubles.data(), count * sizeof(double));
}

// What is a few doubles and no more is a numpy array in Python; its shape.
template <class T>
struct Doubles : std::false_type {};
template <>
struct Doubles<fs_vec3> : std::true_type {
  static std::vector<py::ssize_t> shape() { return {3}; }
};
template <>
struct Doubles<fs_quat> : std::true_type {
  static std::vector<py::ssize_t> shape() { return {4}; }
};
template <>
struct Doubles<fs_mat3> : std::true_type {
  static std::vector<py::ssize_t> shape() { return {3, 3}; }
};

template <class T>
T value(py::handle object, const char* name) {
  T out;
  if constexpr (std::is_same_v<T, fs_quat>) {
    if (py::hasattr(object, "as_quat")) {  // scipy's Rotation gives x, y, z, w
      double xyzw[4];
      load_doubles(object.attr("as_quat")(), xyzw, {4}, name);
      return {xyzw[3], xyzw[0], xyzw[1], xyzw[2]};
    }
  }
  load_doubles(object, reinterpret_cast<double*>(&out), Doubles<T>::shape(), name);
  return out;
}

// ------------------------------------------------------------------------------------------------------------ structs

// What the generator says about each struct: its defaults, and which of its fields are pointers to handles; for each of
// them a box has a reference.
template <class T>
T default_of();
template <class T>
struct HandlesOf {
  template <class F>
  static void each(T&, F&&) {}
};
template <class T, class F>
void each_handle(T& value, F&& call) {
  HandlesOf<T>::each(value, call);
}

template <class T>
T* retained(T* handle) {
  return handle ? Kind<T>::retain(handle) : nullptr;
}

template <class T>
void give_back(T* handle) {
  Kind<T>::give_back(handle);
}

// A struct of one's own.
template <class T>
struct Box {
  T value;

  explicit Box(const T& from) : value(from) {
    each_handle(value, [](auto& handle) { handle = retained(handle); });
  }
  Box(const Box& other) : Box(other.value) {}
  Box& operator=(const Box&) = delete;
  ~Box() {
    each_handle(value, [](auto& handle) { give_back(handle); });
  }
};

// A struct as Python sees it: the whole of a box, or a part of it that keeps the box alive.
template <class T>
struct Struct {
  std::shared_ptr<void> box;
  T* at;

  static Struct make(const T& from) {
    auto box = std::make_shared<Box<T>>(from);
    T* at = &box->value;
    return {std::move(box), at};
  }
  void assign(const T& from) {
    Box<T> old(*at), fresh(from);
    std::swap(fresh.value, *at);  // the old handles go with `fresh`
  }
};

template <class T>
Struct<T>& as_struct(py::handle value, const char* name);

// The fields of a class, by name, for __init__ and repr.
template <class T>
struct Field {
  const char* name;
  const char* unit;
  std::function<py::object(py::object)> get;
  std::function<void(Struct<T>&, py::handle)> set;
};

template <class T>
class Class {
 public:
  static inline PyTypeObject* type = nullptr;
  static inline PyObject* dtype = nullptr;
  static inline const char* name = "";

  Class(py::module_& module, const char* class_name, const char* doc, py::dtype type_of_arrays)
      : class_(module, class_name, doc, py::module_local()) {
    name = class_name;
    type = reinterpret_cast<PyTypeObject*>(class_.ptr());
    if (type_of_arrays.itemsize() != sizeof(T)) value_error(std::string(class_name) + ": its dtype has another size");
    class_.attr("dtype") = type_of_arrays;
    dtype = type_of_arrays.release().ptr();
    class_.def(py::init([](const py::kwargs& fields) {
      auto made = Struct<T>::make(default_of<T>());
      for (const auto& [key, value] : fields) set(made, py::cast<std::string>(key), value);
      return made;
    }));
    const auto copy = [](const py::object& self) { return Struct<T>::make(*as_self(self).at); };
    class_.def("copy", copy, "A copy that shares nothing with this one.");
    class_.def("__copy__", copy);
    class_.def("__deepcopy__", [copy](const py::object& self, py::handle) { return copy(self); });
    class_.def("__repr__", [](py::object self) { return repr(self); });
    class_.def_property_readonly("__array_interface__", [](const py::object& object) {
      const Struct<T>& self = as_self(object);
      bool has_handles = false;
      each_handle(*self.at, [&](auto&) { has_handles = true; });
      py::dict interface;
      interface["version"] = 3;
      interface["shape"] = py::tuple(0);
      interface["typestr"] = "|V" + std::to_string(sizeof(T));
      interface["descr"] = py::reinterpret_borrow<py::object>(dtype).attr("descr");
      interface["data"] = py::make_tuple(reinterpret_cast<uintptr_t>(self.at), has_handles);  // read-only: has pointers
      return interface;
    });
  }

  template <class M>
  void field(const char* field_name, M T::*member, const char* unit, const char* doc) {
    add(field_name, unit, doc, [member](const py::object& self) { return get(self, as_self(self).at->*member); },
        [member, field_name](Struct<T>& self, py::handle value) { put(self.at->*member, value, field_name); });
  }

  // Bits in an integer.
  void flags(const char* field_name, uint32_t T::*member, const Enum* bits, const char* doc) {
    add(field_name, "", doc,
        [member, bits](const py::object& self) { return bits->to_python(as_self(self).at->*member); },
        [member, bits, field_name](Struct<T>& self, py::handle value) {
          self.at->*member = static_cast<uint32_t>(bits->from_python(value, field_name));
        });
  }

 private:
  static Struct<T>& as_self(const py::object& self) { return as_struct<T>(self, "self"); }
  static inline std::vector<Field<T>> fields;

  template <class Get, class Set>
  void add(const char* field_name, const char* unit, const char* doc, Get get, Set set) {
    fields.push_back({field_name, unit, get, set});
    const auto put = [set](const py::object& self, const py::object& value) { set(as_self(self), value); };
    class_.def_property(field_name, get, put, doc);
  }

  static void set(Struct<T>& self, const std::string& key, py::handle value) {
    for (const auto& field : fields) {
      if (field.name == key) return field.set(self, value);
    }
    type_error(std::string(name) + " has no field '" + key + "'");
  }

  static std::string repr(const py::object& self) {
    std::string text = py::cast<std::string>(py::type::of(self).attr("__name__")) + "(";
    const char* comma = "";
    for (const auto& field : fields) {
      const py::object value = field.get(self);
      std::string shown;
      if (PyFloat_Check(value.ptr())) {
        char number[32];
        snprintf(number, sizeof number, "%.6g", PyFloat_AS_DOUBLE(value.ptr()));
        shown = number;
      } else if (py::isinstance<py::array>(value)) {
        const py::array array = py::reinterpret_borrow<py::array>(value);
        shown = array.size() > 9 ? "array of shape " + shape_text(array)
                                 : text_of(array.attr("tolist")());
      } else if (PyLong_Check(value.ptr()) && !PyLong_CheckExact(value.ptr()) && !PyBool_Check(value.ptr())) {
        shown = py::cast<std::string>(value.attr("name").is_none() ? py::str("0") : py::str(value.attr("name")));
        if (shown.empty()) shown = "0";
      } else {
        shown = text_of(py::repr(value));
      }
      text += std::string(comma) + field.name + "=" + shown + (*field.unit ? std::string(" ") + field.unit : "");
      comma = ", ";
    }
    return text + ")";
  }

  template <class M>
  static py::object get(const py::object& self, M& member) {
    if constexpr (std::is_same_v<M, double> || std::is_same_v<M, bool>) {
      return py::cast(member);
    } else if constexpr (std::is_integral_v<M>) {
      return py::int_(member);
    } else if constexpr (std::is_enum_v<M>) {
      return enum_of<M>.to_python(static_cast<int>(member));
    } else if constexpr (Doubles<M>::value) {
      return py::array_t<double>(Doubles<M>::shape(), reinterpret_cast<double*>(&member), self);
    } else if constexpr (std::is_pointer_v<M>) {
      return new_handle(retained(member));
    } else if constexpr (std::is_array_v<M>) {
      using E = std::remove_extent_t<M>;
      if constexpr (std::is_same_v<E, char>) {
        return text_to_python(member, strnlen(member, sizeof member));
      } else {
        static_assert(Doubles<E>::value);
        auto shape = Doubles<E>::shape();
        shape.insert(shape.begin(), std::extent_v<M>);
        return py::array_t<double>(shape, reinterpret_cast<double*>(&member[0]), self);
      }
    } else {
      return py::cast(Struct<M>{as_self(self).box, &member});
    }
  }

  template <class M>
  static void put(M& member, py::handle object, const char* field_name) {
    if constexpr (std::is_arithmetic_v<M>) {
      member = number<M>(object, field_name);
    } else if constexpr (std::is_enum_v<M>) {
      member = static_cast<M>(enum_of<M>.from_python(object, field_name));
    } else if constexpr (Doubles<M>::value) {
      member = value<M>(object, field_name);
    } else if constexpr (std::is_pointer_v<M>) {
      using H = std::remove_pointer_t<M>;
      H* fresh = nullptr;
      if (!object.is_none()) {
        const Use<H> use(as_handle<H>(object, field_name));
        fresh = retained(static_cast<H*>(use));
      }
      Kind<H>::give_back(std::exchange(member, fresh));
    } else if constexpr (std::is_array_v<M>) {
      using E = std::remove_extent_t<M>;
      if constexpr (std::is_same_v<E, char>) {
        const Text text(object, field_name, false);
        if (text.size() >= sizeof member) {
          value_error(std::string(field_name) + " has " + std::to_string(text.size()) + " bytes, at most " +
                      std::to_string(sizeof member - 1) + " fit");
        }
        std::memset(member, 0, sizeof member);
        std::memcpy(member, text.get(), text.size());
      } else {
        auto shape = Doubles<E>::shape();
        shape.insert(shape.begin(), std::extent_v<M>);
        load_doubles(object, reinterpret_cast<double*>(&member[0]), shape, field_name);
      }
    } else {
      Struct<M>{nullptr, &member}.assign(*as_struct<M>(object, field_name).at);
    }
  }

  py::class_<Struct<T>> class_;
};

template <class T>
Struct<T>* if_struct(py::handle object) {
  return made_of<Struct<T>>(object, Class<T>::type);
}
template <class T>
Struct<T>& as_struct(py::handle object, const char* name) {
  if (Struct<T>* made = if_struct<T>(object)) return *made;
  type_error(std::string(name) + " must be a " + Class<T>::name);
}

// A struct that goes into a call without the GIL: a copy, with references of its own; null for None where allowed.
template <class T>
class Input {
 public:
  Input(py::handle object, const char* name, bool null) {
    if (!(object.is_none() && null)) box_ = std::make_unique<Box<T>>(*as_struct<T>(object, name).at);
  }
  const T* get() const { return box_ ? &box_->value : nullptr; }

 private:
  std::unique_ptr<Box<T>> box_;
};

// What a call has filled. Its handles are retained; `filled` is then released by the caller.
template <class T>
py::object new_struct(const T& filled) {
  return py::cast(Struct<T>::make(filled));
}

// An array of structs that comes in: in one piece, of the class's dtype.
template <class T>
py::array structs(py::handle object, const char* name) {
  py::array array = to_array(object, name);
  if (!array.dtype().equal(py::reinterpret_borrow<py::object>(Class<T>::dtype)) || array.ndim() != 1) {
    const std::string type = Class<T>::name;
    type_error(std::string(name) + " must be a " + type + " or an array of shape (n,) of " + type + ".dtype");
  }
  if (array.flags() & py::array::c_style) return array;
  return py::module_::import("numpy").attr("ascontiguousarray")(array);
}

template <class T>
py::array new_structs(size_t count) {
  const std::vector<py::ssize_t> shape{static_cast<py::ssize_t>(count)};
  return py::array(py::reinterpret_borrow<py::dtype>(Class<T>::dtype), shape);
}

template <class T>
py::array struct_results(py::handle out, size_t count, const char* name) {
  if (out.is_none()) return new_structs<T>(count);
  if (py::isinstance<py::array>(out)) {
    py::array array = py::reinterpret_borrow<py::array>(out);
    if (array.dtype().equal(py::reinterpret_borrow<py::object>(Class<T>::dtype)) && array.ndim() == 1 &&
        static_cast<size_t>(array.size()) == count && array.flags() & py::array::c_style && array.writeable()) {
      return array;
    }
  }
  type_error(std::string(name) + " must be a writable array in one piece of " + Class<T>::name + ".dtype, shape (" +
             std::to_string(count) + ",)");
}

// A list of the library. It may grow between two calls.
template <class T, class Call>
py::object list(Call&& call) {
  size_t count = 0, capacity = 16;
  std::vector<T> entries;
  do {
    capacity = std::max(capacity, count + count / 8);
    entries.resize(capacity);
    check(without_gil([&] { return call(entries.data(), capacity, &count); }));
  } while (count > capacity);
  if constexpr (Doubles<T>::value) {
    auto shape = Doubles<T>::shape();
    shape.insert(shape.begin(), static_cast<py::ssize_t>(count));
    return py::array_t<double>(shape, reinterpret_cast<const double*>(entries.data()));
  } else {
    py::array array = new_structs<T>(count);
    std::memcpy(array.mutable_data(), entries.data(), count * sizeof(T));
    return array;
  }
}

// An array that lives as long as a handle: a read-only view that has a reference to it.
template <class T, class H>
py::object kept(const T* entries, size_t count, int width, H* handle) {
  if (!entries) return py::none();
  using E = std::conditional_t<std::is_same_v<T, fs_vec3>, double, T>;
  if constexpr (std::is_same_v<T, fs_vec3>) width = 3;
  const py::capsule keeper(retained(handle), [](void* kept) { Kind<H>::give_back(static_cast<H*>(kept)); });
  std::vector<py::ssize_t> shape{static_cast<py::ssize_t>(count)};
  if (width > 1) shape.push_back(width);
  py::array_t<E> array(shape, reinterpret_cast<const E*>(entries), keeper);
  array.attr("flags").attr("writeable") = false;
  return array;
}

// -------------------------------------------------------------------------------------------------------------- waits

// The sentence about a slice, with the timeout of the whole wait.
inline std::string with_timeout(std::string text, double part, double whole) {
  char of_part[32], of_whole[32];
  snprintf(of_part, sizeof of_part, "%g s", part);
  snprintf(of_whole, sizeof of_whole, "%g s", whole);
  const size_t at = text.find(of_part);
  return at == std::string::npos ? text : text.replace(at, strlen(of_part), of_whole);
}

// A wait in slices: `call` waits for so long and gives its status; `done` says whether there is nothing to wait for any
// more. Each slice is a call of its own, so another thread or a signal's handler can close the handle.
template <class T, class Call, class Done>
void wait_in_slices(Handle<T>& handle, double timeout, Call&& call, Done&& done) {
  using clock = std::chrono::steady_clock;
  const auto start = clock::now();
  for (double rest = timeout;;) {
    const double now = rest > 0.1 ? 0.1 : rest;
    fs_status status;
    {
      const Use<T> use(handle);
      status = without_gil([&] { return call(use, now); });
      if (status < 0 && status != FS_ERROR_TIMEOUT) check(status);
    }
    rest = timeout - std::chrono::duration<double>(clock::now() - start).count();
    if (done(status)) return;
    if (!(rest > 0)) {
      if (status < 0) raise(status, with_timeout(fs_last_error(), now, timeout));
      return;
    }
    check_signals();
  }
}

// A call that makes a handle and cannot be cut into slices runs in a thread of its own. After Ctrl-C that thread gives
// back what it has made.
template <class T>
py::object make_in_thread(std::function<fs_status(T**)> call) {
  struct Work {
    std::mutex mutex;
    std::condition_variable changed;
    bool done = false, given_up = false;
    fs_status status = FS_OK;
    std::string text;
    T* made = nullptr;
  };
  const auto work = std::make_shared<Work>();
  std::thread([work, call = std::move(call)] {
    T* made = nullptr;
    const fs_status status = call(&made);
    std::unique_lock lock(work->mutex);
    work->status = status;
    if (status < 0) work->text = fs_last_error();
    work->done = true;
    if (work->given_up) {
      lock.unlock();
      if (status >= 0) Kind<T>::give_back(made);
      return;
    }
    work->made = made;
    work->changed.notify_all();
  }).detach();
  for (;;) {
    const bool done = without_gil([&] {
      std::unique_lock lock(work->mutex);
      return work->changed.wait_for(lock, slice, [&] { return work->done; });
    });
    if (done) break;
    try {
      check_signals();
    } catch (...) {
      std::unique_lock lock(work->mutex);
      work->given_up = true;
      T* made = work->done && work->status >= 0 ? work->made : nullptr;
      lock.unlock();
      if (made) Kind<T>::give_back(made);
      throw;
    }
  }
  if (work->status < 0) raise(work->status, work->text);
  return new_handle(work->made);
}

// Builds the search tree in such a thread, which has a reference of its own: so the shape can be closed meanwhile.
inline py::object build(Handle<fs_shape>& shape) {
  const Use<fs_shape> use(shape);
  make_in_thread<fs_shape>([kept = retained(static_cast<fs_shape*>(use))](fs_shape** out) {
    const fs_status status = fs_shape_build(kept);
    if (status < 0) fs_shape_destroy(kept);
    else *out = kept;
    return status;
  });
  return py::none();
}

// Steps a servo a few ticks at a time, so that it can be closed and Ctrl-C is heard. What the last tick says counts.
inline void step(Handle<fs_servo>& servo, uint64_t ticks) {
  using clock = std::chrono::steady_clock;
  do {
    const Use<fs_servo> use(servo);
    const fs_status status = without_gil([&] {
      const auto end = clock::now() + slice;
      fs_status last;
      do {
        const uint64_t some = std::min<uint64_t>(ticks, 64);
        last = fs_servo_step(use, some);
        ticks -= some;
      } while (ticks > 0 && (last >= 0 || last == FS_ERROR_DISCONNECTED) && !servo.closing() && clock::now() < end);
      return last;
    });
    if (status < 0 && (ticks == 0 || status != FS_ERROR_DISCONNECTED)) check(status);
    check_signals();
  } while (ticks > 0);
}

// ------------------------------------------------------------------------------------------------------------ classes

template <class T>
py::class_<Handle<T>> handle_class(py::module_& module, const char* name, const char* doc) {
  using H = Handle<T>;
  py::class_<H> made(module, name, doc, py::module_local());
  handle_type<T> = reinterpret_cast<PyTypeObject*>(made.ptr());
  const auto as_self = [](const py::object& self) -> H& { return as_handle<T>(self, "self"); };
  const auto taken = [](const py::object& other) { return std::make_unique<H>(as_handle<T>(other, "other").take()); };
  const auto closed = [as_self](const py::object& self) { return as_self(self).closed(); };
  const auto hash = [as_self](const py::object& self) { return reinterpret_cast<intptr_t>(as_self(self).address()); };
  made.def(py::init(taken), py::arg("other"))
      .def("close", [as_self](const py::object& self) { as_self(self).close(); },
           "Refuses later calls, waits for calls under way in other threads, and gives the handle back. A second close "
           "does nothing.")
      .def_property_readonly("closed", closed, "Whether close() was called.")
      .def("__enter__", [](py::object self) { return self; })
      .def("__exit__", [as_self](const py::object& self, const py::args&) { as_self(self).close(); })
      .def("__eq__", [as_self](const py::object& self, const py::object& other) {
        const H* with = made_of<H>(other, handle_type<T>);
        return with && with->address() && as_self(self).address() == with->address();
      })
      .def("__hash__", hash);
  return made;
}

}  // namespace forceserver_python
