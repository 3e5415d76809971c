// Errors, signals and the GIL.
#pragma once

#include <cxxabi.h>
#include <unistd.h>
#include <chrono>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <pybind11/pybind11.h>
#include <forceserver/forceserver.h>

namespace forceserver_python {

namespace py = pybind11;

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

}  // namespace forceserver_python
