// Structs, alone and in arrays.
#pragma once

#include <algorithm>
#include <atomic>
#include <functional>
#include <string>
#include <vector>

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

// A struct as Python sees it: the whole of a box, or a part of it that keeps the box alive. One that is constant cannot be
// changed, nor can a part of it.
template <class T>
struct Struct {
  std::shared_ptr<void> box;
  T* at;
  bool constant = false;

  static Struct make(const T& from) {
    auto box = std::make_shared<Box<T>>(from);
    T* at = &box->value;
    return {std::move(box), at, false};
  }
  void assign(const T& from) {
    Box<T> old(*at), fresh(from);
    std::swap(fresh.value, *at);  // the old handles go with `fresh`
  }
};

template <class T>
Struct<T>& as_struct(py::handle value, const char* name);
template <class T>
Struct<T>* if_struct(py::handle object);

[[noreturn]] inline void refuse_constant(const char* name) {
  raise(PyExc_AttributeError, std::string("this ") + name + " is a copy: set it as a whole, or use change(..)");
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

// The fields of a class, by name, for __init__ and repr.
template <class T>
struct Field {
  const char* name;
  const char* unit;
  std::function<py::object(py::object)> get;
  std::function<void(Struct<T>&, py::handle)> set;
  std::function<bool(const T&, const T&)> same;
};

template <class T>
class Class {
 public:
  static inline PyTypeObject* type = nullptr;
  static inline PyObject* dtype = nullptr;
  static inline const char* name = "";

  // signature: the docstring of __init__, which inspect.signature reads
  Class(py::module_& module, const char* class_name, const char* doc, const char* signature, py::dtype type_of_arrays)
      : class_(module, class_name, doc, py::module_local()) {
    name = class_name;
    type = reinterpret_cast<PyTypeObject*>(class_.ptr());
    if (type_of_arrays.itemsize() != sizeof(T)) value_error(std::string(class_name) + ": its dtype has another size");
    class_.attr("dtype") = type_of_arrays;
    dtype = type_of_arrays.release().ptr();
    const auto init = [](const py::args& more, const py::kwargs& given) {
      if (!more.empty()) type_error(std::string(name) + " takes its fields by name: " + field_names());
      auto made = Struct<T>::make(default_of<T>());
      for (const auto& [key, value] : given) set(made, text_of(key), value);
      return made;
    };
    class_.def(py::init(init), signature);
    const auto copy = [](const py::object& self) { return copied(self, py::none()); };
    class_.def("copy", copy, "copy($self)\n--\n\nA copy that shares nothing with this one but shapes, curves and surfaces.");
    class_.def("__copy__", copy);
    class_.def("__deepcopy__", &Class::copied);
    class_.def("__reduce_ex__", [](const py::object& self, const py::object&) { return reduced(self); });
    class_.def("__reduce__", [](const py::object& self) { return reduced(self); });
    class_.def("__repr__", [](py::object self) { return repr(self); });
    class_.def("__eq__", [](const py::object& self, const py::object& other) -> py::object {
      const Struct<T>* with = if_struct<T>(other);
      if (!with) return py::reinterpret_borrow<py::object>(Py_NotImplemented);
      return py::bool_(same(*as_self(self).at, *with->at));
    });
    class_.attr("__hash__") = py::none();
    class_.def("_constant", [](const py::object& self) {
      const Struct<T>& one = as_self(self);
      return Struct<T>{one.box, one.at, true};
    });
    class_.def_property_readonly("__array_interface__", [](const py::object& object) {
      const Struct<T>& self = as_self(object);
      bool has_handles = false;
      each_handle(*self.at, [&](auto&) { has_handles = true; });
      py::dict interface;
      interface["version"] = 3;
      interface["shape"] = py::tuple(0);
      interface["typestr"] = "|V" + std::to_string(sizeof(T));
      interface["descr"] = py::reinterpret_borrow<py::object>(dtype).attr("descr");
      const bool read_only = has_handles || self.constant;  // pointers are not written
      interface["data"] = py::make_tuple(reinterpret_cast<uintptr_t>(self.at), read_only);
      return interface;
    });
  }

  template <class M>
  void field(const char* field_name, M T::* member, const char* unit, const char* doc) {
    add(
        field_name, unit, doc, [member](const py::object& self) { return get(self, as_self(self).at->*member); },
        [member, field_name](Struct<T>& self, py::handle value) { put(self.at->*member, value, field_name); },
        [member](const T& a, const T& b) { return same_value(a.*member, b.*member); });
  }

  static bool same(const T& a, const T& b) {
    return std::all_of(fields.begin(), fields.end(), [&](const auto& field) { return field.same(a, b); });
  }

  // Bits in an integer.
  void flags(const char* field_name, uint32_t T::* member, const Enum* bits, const char* doc) {
    add(
        field_name, "", doc, [member, bits](const py::object& self) { return bits->to_python(as_self(self).at->*member); },
        [member, bits, field_name](Struct<T>& self, py::handle value) {
          self.at->*member = static_cast<uint32_t>(bits->from_python(value, field_name));
        },
        [member](const T& a, const T& b) { return a.*member == b.*member; });
  }

 private:
  static Struct<T>& as_self(const py::object& self) { return as_struct<T>(self, "self"); }
  static inline std::vector<Field<T>> fields;

  template <class Get, class Set, class Same>
  void add(const char* field_name, const char* unit, const char* doc, Get get, Set set, Same same) {
    fields.push_back({field_name, unit, get, set, same});
    const auto put = [set](const py::object& self, const py::object& value) {
      Struct<T>& one = as_self(self);
      if (one.constant) refuse_constant(name);
      set(one, value);
    };
    class_.def_property(field_name, get, put, doc);
  }

  static void set(Struct<T>& self, const std::string& key, py::handle value) {
    for (const auto& field : fields) {
      if (field.name == key) return field.set(self, value);
    }
    type_error(std::string(name) + " has no field '" + key + "'; it has " + field_names());
  }

  static std::string field_names() {
    std::string text;
    for (const auto& field : fields) text += (text.empty() ? "" : ", ") + std::string(field.name);
    return text;
  }

  // Of the same class, with what a subclass has added. memo: of deepcopy, else None.
  static py::object copied(const py::object& self, const py::object& memo) {
    const py::object its_class = py::type::of(self);
    if (its_class.ptr() == reinterpret_cast<PyObject*>(type)) return py::cast(Struct<T>::make(*as_self(self).at));
    const py::object made = its_class.attr("__new__")(its_class);
    py::handle(reinterpret_cast<PyObject*>(type)).attr("__init__")(made);
    as_self(made).assign(*as_self(self).at);
    const py::object deep = py::module_::import("copy").attr("deepcopy");
    for (const auto& [key, value] : attributes_of(self)) {
      py::setattr(made, key, memo.is_none() ? py::reinterpret_borrow<py::object>(value) : deep(value, memo));
    }
    return made;
  }

  // For pickle.
  static py::object reduced(const py::object& self) {
    py::dict values;
    for (const auto& field : fields) values[field.name] = field.get(self);
    const py::dict more = attributes_of(self);
    const py::object state = more.empty() ? py::object(py::none()) : py::object(py::make_tuple(py::none(), more));
    const py::handle base(reinterpret_cast<PyObject*>(type));
    return py::make_tuple(py::module_::import("forceserver._objects").attr("remake"),
                          py::make_tuple(py::type::of(self), base, values), state);
  }

  template <class M>
  static bool same_value(const M& a, const M& b) {
    if constexpr (std::is_scalar_v<M>) {
      return a == b;
    } else if constexpr (Doubles<M>::value) {
      const auto* x = reinterpret_cast<const double*>(&a);
      return std::equal(x, x + sizeof(M) / sizeof(double), reinterpret_cast<const double*>(&b));
    } else if constexpr (std::is_array_v<M>) {
      using E = std::remove_extent_t<M>;
      if constexpr (std::is_same_v<E, char>) return strncmp(a, b, sizeof(M)) == 0;
      else return std::equal(std::begin(a), std::end(a), std::begin(b), same_value<E>);
    } else {
      return Class<M>::same(a, b);
    }
  }

  // A view of numbers within a struct.
  static py::object view(const py::object& self, std::vector<py::ssize_t> shape, double* numbers) {
    py::array_t<double> array(std::move(shape), numbers, self);
    if (as_self(self).constant) array.attr("flags").attr("writeable") = false;
    return array;
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

  template <class M>
  static py::object get(const py::object& self, M& member) {
    if constexpr (std::is_same_v<M, double> || std::is_same_v<M, bool>) {
      return py::cast(member);
    } else if constexpr (std::is_integral_v<M>) {
      return py::int_(member);
    } else if constexpr (std::is_enum_v<M>) {
      return enum_of<M>.to_python(static_cast<int>(member));
    } else if constexpr (Doubles<M>::value) {
      return view(self, Doubles<M>::shape(), reinterpret_cast<double*>(&member));
    } else if constexpr (std::is_pointer_v<M>) {
      return new_handle(retained(member));
    } else if constexpr (std::is_array_v<M>) {
      using E = std::remove_extent_t<M>;
      if constexpr (std::is_same_v<E, char>) {
        return text_to_python(member, strnlen(member, sizeof member));
      } else if constexpr (std::is_integral_v<E>) {
        py::tuple numbers(std::extent_v<M>);
        for (size_t i = 0; i < std::extent_v<M>; ++i) numbers[i] = py::int_(member[i]);
        return std::move(numbers);
      } else {
        static_assert(Doubles<E>::value);
        auto shape = Doubles<E>::shape();
        shape.insert(shape.begin(), std::extent_v<M>);
        return view(self, shape, reinterpret_cast<double*>(&member[0]));
      }
    } else {
      return py::cast(Struct<M>{as_self(self).box, &member, as_self(self).constant});
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
          raise(FS_ERROR_INVALID, std::string(field_name) + " has " + std::to_string(text.size()) + " bytes, which is too long");
        }
        std::memset(member, 0, sizeof member);
        std::memcpy(member, text.get(), text.size());
      } else if constexpr (std::is_integral_v<E>) {
        const py::tuple numbers(py::reinterpret_borrow<py::object>(object));
        if (numbers.size() != std::extent_v<M>) {
          raise(FS_ERROR_INVALID, std::string(field_name) + " has " + std::to_string(numbers.size()) + " numbers, must have " +
                                      std::to_string(std::extent_v<M>));
        }
        M read;
        for (size_t i = 0; i < numbers.size(); ++i) read[i] = number<E>(numbers[i], field_name);
        std::copy(std::begin(read), std::end(read), member);
      } else {
        auto shape = Doubles<E>::shape();
        shape.insert(shape.begin(), std::extent_v<M>);
        load_doubles(object, reinterpret_cast<double*>(&member[0]), shape, field_name);
      }
    } else {
      Struct<M>{nullptr, &member, false}.assign(*as_struct<M>(object, field_name).at);
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
  type_error(std::string(name) + " must be a " + Class<T>::name + ", not " + Py_TYPE(object.ptr())->tp_name);
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

// A struct that a call changes, except for its handles. The call works on a copy, because it runs without the GIL; the struct
// takes what the copy has become when the call has succeeded.
template <class T>
class Changed {
 public:
  Changed(py::handle object, const char* name) : target_(as_struct<T>(object, name)), copy_(*target_.at) {
    if (target_.constant) refuse_constant(Class<T>::name);
  }
  T* get() { return &copy_.value; }
  void take() { target_.assign(copy_.value); }

 private:
  Struct<T>& target_;
  Box<T> copy_;
};

// What a call has filled. Its handles are retained; `filled` is then released by the caller.
template <class T>
py::object new_struct(const T& filled) {
  return py::cast(Struct<T>::make(filled));
}

// An array of structs that comes in: in one piece, of the class's dtype.
template <class T>
py::array structs(py::handle object, const char* name) {
  const std::string type = Class<T>::name;
  const py::object dtype = py::reinterpret_borrow<py::object>(Class<T>::dtype);
  const auto fail = [&] {
    const bool is_array = py::isinstance<py::array>(object);
    type_error(std::string(name) + " must be a " + type + " or an array of shape (n,) of " + type + ".dtype, not " +
               (is_array ? text_of(object.attr("dtype")) + " of shape " + text_of(object.attr("shape"))
                         : Py_TYPE(object.ptr())->tp_name));
  };
  if (PyUnicode_Check(object.ptr()) || object.is_none()) fail();
  py::object found = py::reinterpret_borrow<py::object>(object);
  if (PyList_Check(object.ptr()) || PyTuple_Check(object.ptr())) {
    found = py::module_::import("numpy").attr("empty")(py::len(object), dtype);
    for (size_t i = 0; i < py::len(object); ++i) {
      as_struct<T>(object[py::int_(i)], name);
      found[py::int_(i)] = py::module_::import("numpy").attr("asarray")(object[py::int_(i)]);
    }
  }
  py::array array = to_array(found, name);
  if (array.ndim() != 1) fail();
  if (!array.dtype().equal(dtype)) {  // in the byte order of another machine, or with gaps
    if (!array.dtype().attr("names").equal(dtype.attr("names"))) fail();
    array = array.attr("astype")(dtype);
  }
  if (array.flags() & py::array::c_style) return array;
  return py::module_::import("numpy").attr("ascontiguousarray")(array);
}

template <class T>
py::array new_structs(size_t count) {
  const std::vector<py::ssize_t> shape{static_cast<py::ssize_t>(count)};
  return py::array(py::reinterpret_borrow<py::dtype>(Class<T>::dtype), shape);
}

// What is listed, for users. Structs with text become a recarray: text is str, and fields are attributes too. Others stay a
// plain array. NumPy itself would need five times as long to copy the columns.
template <class T>
py::object rows(const T* entries, size_t count) {
  struct Part {  // a field of text, or fields without text that follow each other
    std::string name;
    size_t from, to, size;  // bytes
    bool is_text;
  };
  struct Shown {
    PyObject* dtype;  // null: there is no text. Never freed
    std::vector<Part> parts;
  };
  static const Shown shown = [] {
    py::list fields;
    Shown made{};
    size_t to = 0;
    const py::object dtype = py::reinterpret_borrow<py::object>(Class<T>::dtype);
    for (const py::handle name : dtype.attr("names")) {
      py::object type = dtype[name];
      const bool is_text = text_of(type.attr("kind")) == "S";
      const auto size = type.attr("itemsize").cast<size_t>();
      const auto from = py::object(dtype.attr("fields")[name][py::int_(1)]).cast<size_t>();
      Part* const last = made.parts.empty() ? nullptr : &made.parts.back();
      if (last && !last->is_text && !is_text && last->from + last->size == from) {
        last->size += size;
      } else {
        made.parts.push_back({text_of(name), from, to, size, is_text});
      }
      if (is_text) type = py::str("U" + std::to_string(size));
      fields.append(py::make_tuple(name, type));
      to += is_text ? size * sizeof(uint32_t) : size;
    }
    if (std::none_of(made.parts.begin(), made.parts.end(), [](const Part& p) { return p.is_text; })) return made;
    const py::object numpy = py::module_::import("numpy");
    made.dtype = numpy.attr("dtype")(py::make_tuple(numpy.attr("record"), fields)).release().ptr();
    return made;
  }();
  const auto plain = [&] {
    py::array array = new_structs<T>(count);
    std::memcpy(array.mutable_data(), entries, count * sizeof(T));
    return array;
  };
  if (!shown.dtype) return plain();
  const py::object numpy = py::module_::import("numpy");
  py::array out = numpy.attr("zeros")(count, py::reinterpret_borrow<py::object>(shown.dtype));
  const auto width = static_cast<size_t>(out.itemsize());
  for (const Part& part : shown.parts) {
    const auto* from = reinterpret_cast<const unsigned char*>(entries) + part.from;
    auto* to = static_cast<char*>(out.mutable_data()) + part.to;
    bool is_ascii = true;
    for (size_t row = 0; row < count; ++row, from += sizeof(T), to += width) {
      if (!part.is_text) {
        std::memcpy(to, from, part.size);
        continue;
      }
      for (size_t i = 0; i < part.size && from[i]; ++i) {
        const uint32_t character = from[i];
        std::memcpy(to + i * sizeof character, &character, sizeof character);
        is_ascii = is_ascii && character < 128;
      }
    }
    if (is_ascii) continue;
    out[part.name.c_str()] = numpy.attr("char").attr("decode")(plain()[part.name.c_str()], "utf-8", "surrogateescape");
  }
  return out.attr("view")(numpy.attr("recarray"));
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
  type_error(std::string(name) + " must be a C-contiguous, writable array of " + Class<T>::name + ".dtype, shape (" +
             std::to_string(count) + ",)");
}

// A list of the library. It may grow between two calls. Room for as many as last time saves the second call.
template <class T, class Call>
py::object list(Call&& call) {
  static std::atomic<size_t> usual = 16;
  size_t count = 0, capacity = usual;
  std::vector<T> entries;
  do {
    capacity = std::max(capacity, count + count / 8);
    entries.resize(capacity);
    check(without_gil([&] { return call(entries.data(), capacity, &count); }));
  } while (count > capacity);
  usual = std::max<size_t>(16, count + count / 8);
  if constexpr (Doubles<T>::value) {
    auto shape = Doubles<T>::shape();
    shape.insert(shape.begin(), static_cast<py::ssize_t>(count));
    return py::array_t<double>(shape, reinterpret_cast<const double*>(entries.data()));
  } else {
    return rows(entries.data(), count);
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
