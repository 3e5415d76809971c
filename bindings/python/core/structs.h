// Structs, alone and in arrays.
#pragma once

#include <functional>

#include <pybind11/eval.h>

#include "arrays.h"
#include "handle.h"

namespace forceserver_python {

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

}  // namespace forceserver_python
