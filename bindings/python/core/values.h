// Enums, numbers and strings.
#pragma once

#include <algorithm>
#include <limits>
#include <tuple>

#include "errors.h"

namespace forceserver_python {

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
      if (!flags) return named(value, name);
      long bits = 0;
      for (const py::handle one : value.attr("split")("|")) bits |= named(one.attr("strip")(), name);
      return bits;
    }
    if (!PyLong_Check(value.ptr()) || PyBool_Check(value.ptr())) {
      type_error(std::string(name) + " must be an enum, an int or a name");
    }
    const long number = PyLong_AsLong(value.ptr());
    if (number == -1 && PyErr_Occurred()) throw py::error_already_set();
    if (flags ? number < 0 || number > UINT32_MAX : !PyDict_GetItem(members, value.ptr())) {
      value_error(std::string(name) + " is " + std::to_string(number) + "; use " + names());
    }
    return number;
  }

 private:
  long named(py::handle value, const char* name) const {
    const py::object upper = value.attr("upper")();
    const py::object all = py::reinterpret_borrow<py::object>(type).attr("__members__");
    if (!all.contains(upper)) {
      value_error(std::string(name) + " '" + text_of(value) + "' is unknown; use " + names());
    }
    return PyLong_AsLong(py::object(all[upper]).ptr());
  }
  // 'a', 'b' or 'c'
  std::string names() const {
    std::vector<std::string> all;
    for (const py::handle one : py::reinterpret_borrow<py::object>(type).attr("__members__")) {
      all.push_back("'" + text_of(one.attr("lower")()) + "'");
    }
    std::string text = all[0];
    for (size_t i = 1; i < all.size(); ++i) text += (i + 1 < all.size() ? ", " : " or ") + all[i];
    return text;
  }
};
template <class T>
inline Enum enum_of;  // T: the C enum

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
      if (!PyErr_ExceptionMatches(PyExc_TypeError)) throw py::error_already_set();  // of the value's own __float__
      PyErr_Clear();
      type_error(std::string(name) + " must be a number, not " + Py_TYPE(value.ptr())->tp_name);
    }
    return number;
  } else {
    if (!PyIndex_Check(value.ptr()) || PyBool_Check(value.ptr())) {
      type_error(std::string(name) + " must be an int, not " + Py_TYPE(value.ptr())->tp_name);
    }
    const py::object index = py::reinterpret_steal<py::object>(PyNumber_Index(value.ptr()));
    if (!index) throw py::error_already_set();
    py::detail::make_caster<T> caster;
    if (!caster.load(index, false)) {
      PyErr_Clear();
      value_error(std::string(name) + " is " + text_of(index) + ": out of range");
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
    if (text_.find('\0') != std::string::npos) raise(FS_ERROR_INVALID, std::string(name) + " holds a NUL character");
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
inline py::object text_to_python(const char* text) { return text ? text_to_python(text, strlen(text)) : py::object(py::none()); }

}  // namespace forceserver_python
