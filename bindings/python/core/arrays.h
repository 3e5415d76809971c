// Arrays of numbers that come in and go out.
#pragma once

#include <cstring>

#include <pybind11/numpy.h>

#include "values.h"

namespace forceserver_python {

inline std::string shape_text(const py::array& array) { return text_of(array.attr("shape")); }

inline bool has_shape(const py::array& array, const std::vector<py::ssize_t>& shape) {
  return std::equal(shape.begin(), shape.end(), array.shape(), array.shape() + array.ndim());
}

// Any array of numbers, a sequence too.
inline py::array to_array(py::handle value, const char* name) {
  py::object array;
  if (py::isinstance<py::array>(value)) {
    array = py::reinterpret_borrow<py::object>(value);
  } else {
    if (PyUnicode_Check(value.ptr()) || value.is_none()) {
      type_error(std::string(name) + " must be numbers, not " + Py_TYPE(value.ptr())->tp_name);
    }
    try {
      array = py::module_::import("numpy").attr("asarray")(value);
    } catch (py::error_already_set& error) {
      if (!error.matches(PyExc_ValueError)) throw;  // a ragged sequence
      type_error(std::string(name) + ": " + error.what());
    }
  }
  return py::reinterpret_borrow<py::array>(array);
}

// The entries of an array that comes in, as T in one piece: shape (n,) for width 1, else (n, width); a grid: of any shape,
// but for width > 1 the last side is the width. What is no real number is refused, floats are where integers are wanted,
// and integers must be in the range of T.
template <class T>
py::array entries(py::handle value, int width, const char* name, bool is_grid = false) {
  py::array array = to_array(value, name);
  const char kind = array.dtype().kind();
  const auto fail = [&] {
    const std::string wanted = std::is_floating_point_v<T> ? "floats" : "integers";
    type_error(std::string(name) + " must be " + wanted + " of shape (" + (is_grid ? ".." : "n") +
               (width > 1 ? ", " + std::to_string(width)
                : is_grid ? ""
                          : ",") +
               "), not " + text_of(array.dtype()) + " of shape " + shape_text(array));
  };
  const bool empty = array.size() == 0 && array.ndim() <= 2;
  if (kind != 'i' && kind != 'u' && !(kind == 'f' && (std::is_floating_point_v<T> || empty))) fail();
  const py::ssize_t sides = array.ndim(), wanted_sides = width == 1 ? 1 : 2;
  if (!empty && !is_grid && sides != wanted_sides) fail();
  if (!empty && width > 1 && (sides == 0 || array.shape(sides - 1) != width)) fail();
  if constexpr (std::is_integral_v<T>) {
    if (!empty && !py::isinstance<py::array_t<T>>(array)) {
      const py::object low = array.attr("min")(), high = array.attr("max")();
      const bool negative = low < py::int_(0);
      if (negative || high > py::int_(std::numeric_limits<T>::max())) {
        value_error(std::string(name) + ": out of range: " + text_of(negative ? low : high));
      }
    }
  }
  return py::array_t<T, py::array::c_style | py::array::forcecast>(array);  // MemoryError
}

// The shape of the results for such entries: theirs.
inline std::vector<py::ssize_t> result_shape(const py::array& entries, int width) {
  if (entries.size() == 0 && width > 1 && (entries.ndim() == 0 || entries.shape(entries.ndim() - 1) != width)) return {0, width};
  return {entries.shape(), entries.shape() + entries.ndim()};
}

// Where results go: the caller's array, which must be right as it is, or a new one.
template <class T>
py::array results(py::handle out, const std::vector<py::ssize_t>& shape, const char* name) {
  if (out.is_none()) return py::array_t<T>(shape);
  const auto fail = [&](const std::string& why) {
    py::tuple wanted(shape.size());
    for (size_t i = 0; i < shape.size(); ++i) wanted[i] = shape[i];
    type_error(std::string(name) + " must be a C-contiguous, writable array of " + text_of(py::dtype::of<T>()) + ", shape " +
               text_of(wanted) + ": " + why);
  };
  if (!py::isinstance<py::array>(out)) fail("it is no numpy array");
  py::array array = py::reinterpret_borrow<py::array>(out);
  if (!py::isinstance<py::array_t<T>>(out)) fail("it has " + text_of(array.dtype()));
  if (!has_shape(array, shape)) {
    fail("it has shape " + shape_text(array));
  }
  if (!(array.flags() & py::array::c_style) || reinterpret_cast<uintptr_t>(array.data()) % alignof(T) != 0) {
    fail("it is not C-contiguous");
  }
  if (!array.writeable()) fail("it is read-only");
  return array;
}

// What is read must not be what is written: but for the very same array, each entry of which is read before it is written.
inline void keep_apart(const py::array& in, const char* in_name, const py::array& out, const char* out_name) {
  const auto* a = static_cast<const char*>(in.data());
  const auto* b = static_cast<const char*>(out.data());
  if (a + in.nbytes() <= b || b + out.nbytes() <= a) return;
  if (a == b && in.nbytes() == out.nbytes()) return;
  value_error(std::string(in_name) + " and " + out_name + " overlap: give two separate arrays, or the same one twice");
}

// One vector, quaternion or matrix: a sequence or array of real numbers.
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
    type_error(std::string(name) + " must be numbers of shape " + text_of(wanted) + ", not " + text_of(array.dtype()) +
               " of shape " + shape_text(array));
  }
  const py::array_t<double, py::array::c_style | py::array::forcecast> doubles(array);
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

}  // namespace forceserver_python
