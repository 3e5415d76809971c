// Errors, signals and the GIL.
#pragma once

#include <cxxabi.h>
#include <unistd.h>
#include <algorithm>
#include <chrono>
#include <map>
#include <memory>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <forceserver/forceserver.h>
#include <pybind11/pybind11.h>

namespace forceserver_python {

namespace py = pybind11;

// The exception class of each status, filled by the module's initialisation; never freed.
struct Errors {
  PyObject* base = nullptr;
  PyObject* no_file = nullptr;  // of NOT_FOUND, where a call is given a path
  std::vector<std::pair<int, PyObject*>> classes;
  std::map<std::string, std::string> names;  // of the functions, in Python

  // A sentence of the library in the words of Python.
  std::string in_python(const std::string& sentence) const {
    std::string out;
    for (size_t i = 0; i < sentence.size();) {
      size_t end = i;
      while (end < sentence.size() && (isalnum(static_cast<unsigned char>(sentence[end])) || sentence[end] == '_')) ++end;
      const auto found = names.find(sentence.substr(i, end - i));
      end = std::max(end, i + 1);
      out += found == names.end() ? sentence.substr(i, end - i) : found->second;
      i = end;
    }
    return out;
  }

  PyObject* of(int status, bool of_path = false) const {
    if (of_path && status == FS_ERROR_NOT_FOUND) return no_file;
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

[[noreturn]] inline void raise(fs_status status, const std::string& text, bool of_path = false) {
  raise(errors.of(status, of_path), errors.in_python(text));
}
[[noreturn]] inline void type_error(const std::string& text) { raise(PyExc_TypeError, text); }
[[noreturn]] inline void value_error(const std::string& text) { raise(PyExc_ValueError, text); }

// For a function that C calls: what was thrown becomes Python's exception, and the result null.
template <class F>
PyObject* for_c(F&& call) {
  try {
    return call().release().ptr();
  } catch (py::error_already_set& error) {
    error.restore();
  } catch (abi::__forced_unwind&) {  // of a thread that ends
    throw;
  } catch (...) {
    py::detail::try_translate_exceptions();
  }
  return nullptr;
}

// fs_last_error belongs to this thread, so it is still the sentence of the call that has just returned.
inline void check(fs_status status, bool of_path = false) {
  if (status < 0) raise(status, fs_last_error(), of_path);
}

// Ctrl-C and other signals run their Python handlers here.
inline void check_signals() {
  if (PyErr_CheckSignals() != 0) throw py::error_already_set();
}

// str(object); what UTF-8 cannot have is escaped.
inline std::string text_of(py::handle object) {
  const py::str text(object);
  PyObject* bytes = PyUnicode_AsEncodedString(text.ptr(), "utf-8", "backslashreplace");
  if (!bytes) throw py::error_already_set();
  return static_cast<std::string>(py::reinterpret_steal<py::bytes>(bytes));
}

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
