// Python classes whose objects hold one class of C++.
#pragma once

#include "errors.h"

namespace forceserver_python {

// The C++ object of a Python object of this class or a subclass; null where it is another, or one whose __init__ has
// failed. (pybind11 itself would make room for the latter and go on with what lies there.)
template <class C>
C* made_of(py::handle object, PyTypeObject* type) {
  if (Py_TYPE(object.ptr()) != type && !PyType_IsSubtype(Py_TYPE(object.ptr()), type)) return nullptr;
  return static_cast<C*>(reinterpret_cast<py::detail::instance*>(object.ptr())->get_value_and_holder().value_ptr());
}

// What pybind11 knows of such a class of C++, which it has only one class of Python for.
template <class C>
inline const py::detail::type_info* info_of = nullptr;

// Gives a Python object that has none its C++ object.
template <class C>
void fill(py::handle object, std::unique_ptr<C> value) {
  auto* const instance = reinterpret_cast<py::detail::instance*>(object.ptr());
  py::detail::value_and_holder(instance, info_of<C>, 0, 0).value_ptr() = value.release();
  info_of<C>->init_instance(instance, nullptr);
}

template <class C>
py::object new_object(PyTypeObject* type, std::unique_ptr<C> value) {
  const auto object = py::reinterpret_steal<py::object>(py::detail::make_new_instance(type));
  if (!object) throw py::error_already_set();
  fill(object, std::move(value));
  return object;
}

// pybind11 wants a C++ class for each Python class, and compiles all its methods anew for it. So there is one class of
// pybind11 for all structs, and one for all handles, with the methods; what users see are subclasses of these, made here.
inline PyTypeObject* subclass(py::module_& module, py::handle base, const char* name, const char* doc) {
  py::dict members;
  members["__slots__"] = py::tuple();
  members["__module__"] = module.attr("__name__");
  members["__doc__"] = doc;
  py::object made = py::type::of(base)(name, py::make_tuple(base), members);
  module.attr(name) = made;
  return reinterpret_cast<PyTypeObject*>(made.release().ptr());
}

}  // namespace forceserver_python
