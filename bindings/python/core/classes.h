// The classes of all enums, handles and structs, which the module makes when it is imported.
#pragma once

#include <pybind11/eval.h>

#include "structs.h"

namespace forceserver_python {

inline Enum make_enum(py::module_& module, const char* name, const char* doc, bool flags,
                      const std::vector<std::tuple<const char*, long>>& values) {
  py::list items;
  for (const auto& [key, value] : values) items.append(py::make_tuple(key, value));
  const py::module_ enums = py::module_::import("enum");
  const py::object type = enums.attr(flags ? "IntFlag" : "IntEnum")(name, items, py::arg("module") = "forceserver._core");
  // It prints as its name, not as its number; but {value:d} and its like are of the number.
  type.attr("__str__") = enums.attr(flags ? "Flag" : "Enum").attr("__str__");
  type.attr("__format__") = py::cpp_function(
      [](const py::object& self, const std::string& form) -> py::object {
        const bool is_of_number = !form.empty() && std::string("bcdoxXn").find(form.back()) != std::string::npos;
        const py::object shown = is_of_number ? py::object(py::int_(PyLong_AsLong(self.ptr()))) : py::object(py::str(self));
        return shown.attr("__format__")(form);
      },
      py::is_method(type));
  type.attr("__doc__") = doc;
  py::dict members;
  for (const auto& [key, value] : values) members[py::int_(value)] = type.attr(key);
  module.attr(name) = type;
  return {py::object(type).release().ptr(), members.release().ptr(), flags};
}

// What there is to say in the repr of an open handle.
inline std::string several(size_t count, const char* what) {
  return std::to_string(count) + " " + what + (count == 1 ? "" : "s");
}
inline std::string described_shape(void* handle) {
  const auto* shape = static_cast<const fs_shape*>(handle);
  size_t points = 0, triangles = 0;
  fs_shape_get_points(shape, &points);
  const bool is_mesh = fs_shape_get_triangles(shape, &triangles) != nullptr;
  return " of " + several(points, "point") + (is_mesh ? ", " + several(triangles, "triangle") : "");
}
inline std::string described_curve(void* handle) {
  const auto* curve = static_cast<const fs_curve*>(handle);
  if (const char* text = fs_curve_get_expression(curve)) return std::string(" '") + text + "'";
  size_t count = 0;
  double step = 0;
  fs_curve_get_table(curve, &count, &step);
  char said[64];
  snprintf(said, sizeof said, ", a table of %zu forces, one each %g m", count, step);
  return said;
}

// The class of all handles.
inline PyTypeObject* handle_base = nullptr;

inline Handle& self_handle(py::handle self) {
  if (auto* made = made_of<Handle>(self, handle_base)) return *made;
  type_error("self must be a " + text_of(py::type::of(self).attr("__name__")));
}

inline py::object init_handle(const py::handle* given) {
  for (const Kind* kind : kinds) {
    if (!PyType_IsSubtype(Py_TYPE(given[0].ptr()), kind->type) || made_of<Handle>(given[0], handle_base)) continue;
    fill(given[0], std::make_unique<Handle>(as_handle(given[1], *kind, "other").take(), *kind));
  }
  return py::none();
}

inline py::object make_handle_base(py::module_& module) {
  py::class_<Handle> made(module, "_Handle", py::module_local());
  handle_base = reinterpret_cast<PyTypeObject*>(made.ptr());
  info_of<Handle> = py::detail::get_type_info(handle_base);
  Function::add<init_handle>(made, "__init__(self, other)\n--\n\nTakes over what another one has, which is then closed.");
  // What object itself would do for protocols 0 and 1 ends the process: it makes an instance of pybind11's base class.
  const auto refuse = [](const py::object& self, const py::args&) -> py::object {
    type_error("cannot copy or pickle a " + text_of(py::type::of(self).attr("__name__")) + ": it is a handle of this process");
  };
  made.def("__reduce__", refuse).def("__reduce_ex__", refuse);
  made.def(
          "close", [](const py::object& self) { self_handle(self).close(); },
          "close(self)\n--\n\nRefuses later calls, waits for calls under way in other threads, and gives the handle "
          "back. Where this thread itself is in a call, as in a signal's handler, the end of that call gives it back. A "
          "second close does nothing.")
      .def_property_readonly(
          "closed", [](const py::object& self) { return self_handle(self).closed(); }, "Whether close() was called.")
      .def("__enter__",
           [](py::object self) {
             const Handle& handle = self_handle(self);
             if (handle.closed()) raise(FS_ERROR_STATE, std::string("this ") + handle.kind().name + " is closed");
             return self;
           })
      .def("__exit__", [](const py::object& self, const py::args&) { self_handle(self).close(); })
      .def("__eq__",
           [](const py::object& self, const py::object& other) -> py::object {
             const Handle& one = self_handle(self);
             const Handle* with = made_of<Handle>(other, one.kind().type);
             if (!with) return py::reinterpret_borrow<py::object>(Py_NotImplemented);
             return py::bool_(one.equals(*with));
           })
      .def("__hash__", [](const py::object& self) { return reinterpret_cast<intptr_t>(self_handle(self).address()); })
      .def("__repr__", [](const py::object& self) -> std::string {
        Handle& handle = self_handle(self);
        const std::string type = text_of(py::type::of(self).attr("__name__"));
        if (handle.closed() || !handle.belongs_here()) return "<closed forceserver." + type + ">";
        const Use<void> use(handle);
        return "<forceserver." + type + (handle.kind().described ? handle.kind().described(use) : "") + ">";
      });
  return made;
}

inline void add_handle(py::module_& module, const py::object& base, Kind& kind, const char* doc) {
  kind.type = subclass(module, base, kind.name, doc);
  kinds.push_back(&kind);
}

// What a subclass in Python adds to its instances.
inline py::dict attributes_of(const py::object& self) {
  py::dict found;
  if (py::hasattr(self, "__dict__")) found.attr("update")(self.attr("__dict__"));
  for (const py::handle name : py::module_::import("copyreg").attr("_slotnames")(py::type::of(self))) {
    if (py::hasattr(self, name)) found[name] = self.attr(name);
  }
  return found;
}

inline std::string field_names(const StructClass& of) {
  std::string text;
  for (const Field& field : of.fields) text += (text.empty() ? "" : ", ") + std::string(field.name);
  return text;
}

// args: self, and what else was given without a name.
inline void init_struct(py::handle self, const StructClass& of, const py::tuple& args, py::handle given) {
  if (args.size() > 1) type_error(std::string(of.name) + " takes its fields by name: " + field_names(of));
  Struct made = Struct::with_defaults(of);
  for (const auto& [key, value] : py::reinterpret_borrow<py::dict>(given)) {
    const std::string name = text_of(key);
    const auto found = std::find_if(of.fields.begin(), of.fields.end(), [&](const Field& f) { return f.name == name; });
    if (found == of.fields.end()) {
      type_error(std::string(of.name) + " has no field '" + name + "'; it has " + field_names(of));
    }
    found->put(made, value);
  }
  if (Struct* const there = made_of<Struct>(self, struct_base)) assign(of, there->at, made.at);
  else fill(self, std::make_unique<Struct>(std::move(made)));
}

// Of the same class, with what a subclass has added. memo: of deepcopy, else None.
inline py::object copied(const py::object& self, const py::object& memo) {
  const Struct& from = self_struct(self);
  const py::object its_class = py::type::of(self);
  if (its_class.ptr() == reinterpret_cast<PyObject*>(from.of.type)) return new_struct(Struct::make(from.of, from.at));
  const py::object made =
      new_object(reinterpret_cast<PyTypeObject*>(its_class.ptr()), std::make_unique<Struct>(Struct::make(from.of, from.at)));
  const py::object deep = py::module_::import("copy").attr("deepcopy");
  for (const auto& [key, value] : attributes_of(self)) {
    py::setattr(made, key, memo.is_none() ? py::reinterpret_borrow<py::object>(value) : deep(value, memo));
  }
  return made;
}

// For pickle.
inline py::object reduced(const py::object& self) {
  const StructClass& of = self_struct(self).of;
  py::dict values;
  for (const Field& field : of.fields) values[field.name] = field.get(self);
  const py::dict more = attributes_of(self);
  const py::object state = more.empty() ? py::object(py::none()) : py::object(py::make_tuple(py::none(), more));
  const py::handle base(reinterpret_cast<PyObject*>(of.type));
  return py::make_tuple(py::module_::import("forceserver._objects").attr("remake"),
                        py::make_tuple(py::type::of(self), base, values), state);
}

inline std::string repr(const py::object& self) {
  std::string text = py::cast<std::string>(py::type::of(self).attr("__name__")) + "(";
  const char* comma = "";
  for (const Field& field : self_struct(self).of.fields) {
    const py::object value = field.get(self);
    std::string shown;
    if (PyFloat_Check(value.ptr())) {
      char number[32];
      snprintf(number, sizeof number, "%.6g", PyFloat_AS_DOUBLE(value.ptr()));
      shown = number;
    } else if (py::isinstance<py::array>(value)) {
      const py::array array = py::reinterpret_borrow<py::array>(value);
      shown = array.size() > 9 ? "array of shape " + shape_text(array) : text_of(array.attr("tolist")());
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

inline py::object array_interface(const py::object& object) {
  const Struct& self = self_struct(object);
  py::dict interface;
  interface["version"] = 3;
  interface["shape"] = py::tuple(0);
  interface["typestr"] = "|V" + std::to_string(self.of.size);
  interface["descr"] = py::reinterpret_borrow<py::object>(self.of.dtype).attr("descr");
  const bool read_only = !self.of.handles.empty() || self.constant;  // pointers are not written
  interface["data"] = py::make_tuple(reinterpret_cast<uintptr_t>(self.at), read_only);
  return interface;
}

inline py::object make_struct_base(py::module_& module) {
  py::class_<Struct> made(module, "_Struct", py::module_local());
  struct_base = reinterpret_cast<PyTypeObject*>(made.ptr());
  info_of<Struct> = py::detail::get_type_info(struct_base);
  const auto copy = [](const py::object& self) { return copied(self, py::none()); };
  made.def("copy", copy, "copy(self)\n--\n\nA copy that shares nothing with this one but shapes, curves and surfaces.");
  made.def("__copy__", copy);
  made.def("__deepcopy__", copied);
  made.def("__reduce_ex__", [](const py::object& self, const py::object&) { return reduced(self); });
  made.def("__reduce__", reduced);
  made.def("__repr__", repr);
  made.def("__eq__", [](const py::object& self, const py::object& other) -> py::object {
    const Struct& one = self_struct(self);
    const Struct* with = if_struct(other, one.of);
    if (!with) return py::reinterpret_borrow<py::object>(Py_NotImplemented);
    return py::bool_(same_struct(one.of, one.at, with->at));
  });
  made.attr("__hash__") = py::none();
  made.def("_constant", [](const py::object& self) {
    const Struct& one = self_struct(self);
    return new_struct(Struct{one.of, one.box, one.at, true});
  });
  made.def_property_readonly("__array_interface__", array_interface);
  return made;
}

// The attributes of a struct, as Python calls them.
inline PyObject* get_attribute(PyObject* self, void* field) {
  return for_c([&] { return static_cast<const Field*>(field)->get(self); });
}
inline int set_attribute(PyObject* self, PyObject* value, void* of_field) {
  const auto& field = *static_cast<const Field*>(of_field);
  const py::object done = py::reinterpret_steal<py::object>(for_c([&]() -> py::object {
    if (!value) raise(PyExc_AttributeError, std::string(field.name) + " cannot be deleted");
    Struct& one = self_struct(self);
    if (one.constant) refuse_constant(one.of.name);
    field.put(one, value);
    return py::none();
  }));
  return done ? 0 : -1;
}
inline PyObject* call_init(PyObject* capsule, PyObject* args, PyObject* given) {
  return for_c([&]() -> py::object {
    const auto& of = *static_cast<const StructClass*>(PyCapsule_GetPointer(capsule, nullptr));
    const py::tuple all = py::reinterpret_borrow<py::tuple>(args);
    const py::handle self(all.empty() ? Py_None : PyTuple_GET_ITEM(args, 0));
    if (!PyType_IsSubtype(Py_TYPE(self.ptr()), of.type)) {
      type_error(std::string("self must be a ") + of.name);
    }
    const py::dict named = given ? py::reinterpret_borrow<py::dict>(given) : py::dict();
    init_struct(self, of, all, named);
    return py::none();
  });
}

// Makes the class in Python. signature: the docstring of __init__, which inspect.signature reads. dtypes: those of all
// structs before it, by name, beside what numpy has.
inline void add_struct(py::module_& module, const py::object& base, StructClass& of, py::dict& dtypes, const char* dtype,
                       const char* doc, const char* signature) {
  of.type = subclass(module, base, of.name, doc);
  const py::handle made(reinterpret_cast<PyObject*>(of.type));
  py::object type_of_arrays = py::eval(dtype, dtypes);
  if (type_of_arrays.attr("itemsize").cast<size_t>() != of.size)
    value_error(std::string(of.name) + ": its dtype has another size");
  dtypes[of.name] = type_of_arrays;
  made.attr("dtype") = type_of_arrays;
  of.dtype = type_of_arrays.release().ptr();
  auto* const definition = new PyMethodDef{"__init__", reinterpret_cast<PyCFunction>(reinterpret_cast<void (*)()>(call_init)),
                                           METH_VARARGS | METH_KEYWORDS, signature};
  Function::put(made, *definition, py::capsule(&of));
  for (Field& field : of.fields) {
    field.definition = {field.name, get_attribute, set_attribute, *field.doc ? field.doc : nullptr, &field};
    made.attr(field.name) = py::reinterpret_steal<py::object>(PyDescr_NewGetSet(of.type, &field.definition));
  }
}

}  // namespace forceserver_python
