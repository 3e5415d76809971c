// Structs, alone and in arrays.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "arrays.h"
#include "handle.h"

namespace forceserver_python {

// How a field is read and written: what its type in C says.
struct FieldType {
  py::object (*get)(py::handle self, void* at);
  void (*put)(void* at, py::handle value, const char* name);
  bool (*same)(const void* a, const void* b);
};

// A field of a struct of the headers, as the generator says it.
struct Field {
  const char* name;
  const char* unit;
  const char* doc;
  size_t offset;  // within the struct
  const FieldType& type;
  const Enum* bits = nullptr;  // of an integer that holds bits
  PyGetSetDef definition = {};

  py::object get(py::handle self) const;
  void put(const struct Struct& self, py::handle value) const;
  void* place(const Struct& self) const;
};

// A pointer to a handle within a struct.
struct HandleField {
  size_t offset;
  const Kind& kind;
};

// A struct of the headers, as the generator says it.
struct StructClass {
  const char* name;
  size_t size;  // bytes
  void (*set_defaults)(void* at);
  std::span<const HandleField> handles;  // a box has a reference to each
  std::span<Field> fields;
  PyTypeObject* type = nullptr;  // in Python
  PyObject* dtype = nullptr;     // of arrays

  void retain(void* value) const {
    for (const HandleField& handle : handles) {
      void*& at = *reinterpret_cast<void**>(static_cast<char*>(value) + handle.offset);
      if (at) at = handle.kind.retain(at);
    }
  }
  void give_back(void* value) const {
    for (const HandleField& handle : handles) {
      handle.kind.give_back(*reinterpret_cast<void**>(static_cast<char*>(value) + handle.offset));
    }
  }
};
template <class T>
inline StructClass class_of;

template <class T>
T default_of() {
  T value;
  class_of<T>.set_defaults(&value);
  return value;
}

// A struct of one's own.
template <class T>
struct Box {
  T value;

  explicit Box(const T& from) : value(from) { class_of<T>.retain(&value); }
  Box(const Box& other) : Box(other.value) {}
  Box& operator=(const Box&) = delete;
  ~Box() { class_of<T>.give_back(&value); }
};

// A struct as Python sees it: the whole of a box, or a part of it that keeps the box alive. One that is constant cannot be
// changed, nor can a part of it.
struct Struct {
  const StructClass& of;
  std::shared_ptr<void> box;
  void* at;
  bool constant = false;

  static Struct make(const StructClass& of, const void* from) {
    Struct made = with_room(of);
    std::memcpy(made.at, from, of.size);
    of.retain(made.at);
    return made;
  }
  static Struct with_defaults(const StructClass& of) {
    Struct made = with_room(of);
    of.set_defaults(made.at);
    return made;
  }

 private:
  static Struct with_room(const StructClass& of) {
    std::shared_ptr<void> box(std::memset(::operator new(of.size), 0, of.size), [&of](void* value) {
      of.give_back(value);
      ::operator delete(value);
    });
    void* const at = box.get();
    return {of, std::move(box), at, false};
  }
};

// The old handles go, those of `from` come.
inline void assign(const StructClass& of, void* to, const void* from) {
  const Struct old = Struct::make(of, from);  // in case that `from` is a part of what goes
  std::swap_ranges(static_cast<char*>(to), static_cast<char*>(to) + of.size, static_cast<char*>(old.at));
}

inline Struct* if_struct(py::handle object, const StructClass& of) { return made_of<Struct>(object, of.type); }
template <class T>
T* if_struct(py::handle object) {
  Struct* const made = if_struct(object, class_of<T>);
  return made ? static_cast<T*>(made->at) : nullptr;
}

inline Struct& as_struct(py::handle object, const StructClass& of, const char* name) {
  if (Struct* made = if_struct(object, of)) return *made;
  type_error(std::string(name) + " must be a " + of.name + ", not " + Py_TYPE(object.ptr())->tp_name);
}
template <class T>
T* as_struct(py::handle object, const char* name) {
  return static_cast<T*>(as_struct(object, class_of<T>, name).at);
}

inline py::object new_struct(Struct value) { return new_object(value.of.type, std::make_unique<Struct>(std::move(value))); }
// What a call has filled. Its handles are retained; `filled` is then released by the caller.
template <class T>
py::object new_struct(const T& filled) {
  return new_struct(Struct::make(class_of<T>, &filled));
}

[[noreturn]] inline void refuse_constant(const char* name) {
  raise(PyExc_AttributeError, std::string("this ") + name + " is a copy: set it as a whole, or use change(..)");
}

// The class of all structs.
inline PyTypeObject* struct_base = nullptr;

inline Struct& self_struct(py::handle self) {
  if (Struct* made = made_of<Struct>(self, struct_base)) return *made;
  type_error("self must be a " + text_of(py::type::of(self).attr("__name__")));
}

inline void* Field::place(const Struct& self) const { return static_cast<char*>(self.at) + offset; }
inline py::object Field::get(py::handle self) const {
  void* const at = place(self_struct(self));
  return bits ? bits->to_python(*static_cast<uint32_t*>(at)) : type.get(self, at);
}
inline void Field::put(const Struct& self, py::handle value) const {
  if (bits) *static_cast<uint32_t*>(place(self)) = static_cast<uint32_t>(bits->from_python(value, name));
  else type.put(place(self), value, name);
}

inline bool same_struct(const StructClass& of, const void* a, const void* b) {
  const auto at = [](const void* value, const Field& field) { return static_cast<const char*>(value) + field.offset; };
  return std::all_of(of.fields.begin(), of.fields.end(), [&](const Field& f) { return f.type.same(at(a, f), at(b, f)); });
}

template <class M>
bool same_value(const M& a, const M& b) {
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
    return same_struct(class_of<M>, &a, &b);
  }
}

// A view of numbers within a struct.
inline py::object view_of(py::handle self, std::vector<py::ssize_t> shape, double* numbers) {
  py::array_t<double> array(std::move(shape), numbers, self);
  if (self_struct(self).constant) array.attr("flags").attr("writeable") = false;
  return array;
}

template <class M>
py::object get_value(py::handle self, M& member) {
  if constexpr (std::is_same_v<M, double> || std::is_same_v<M, bool>) {
    return py::cast(member);
  } else if constexpr (std::is_integral_v<M>) {
    return py::int_(member);
  } else if constexpr (std::is_enum_v<M>) {
    return enum_of<M>.to_python(static_cast<int>(member));
  } else if constexpr (Doubles<M>::value) {
    return view_of(self, Doubles<M>::shape(), reinterpret_cast<double*>(&member));
  } else if constexpr (std::is_pointer_v<M>) {
    return new_handle(retained(member));
  } else if constexpr (std::is_array_v<M>) {
    using E = std::remove_extent_t<M>;
    if constexpr (std::is_same_v<E, char>) {
      return text_to_python(member, strnlen(member, sizeof member));
    } else if constexpr (std::is_integral_v<E>) {
      py::tuple numbers(std::extent_v<M>);
      for (size_t i = 0; i < std::extent_v<M>; ++i) numbers[i] = py::int_(member[i]);
      return py::object(numbers);
    } else {
      static_assert(Doubles<E>::value);
      auto shape = Doubles<E>::shape();
      shape.insert(shape.begin(), std::extent_v<M>);
      return view_of(self, shape, reinterpret_cast<double*>(&member[0]));
    }
  } else {
    const Struct& whole = self_struct(self);
    return new_struct(Struct{class_of<M>, whole.box, &member, whole.constant});
  }
}

template <class M>
void put_value(M& member, py::handle object, const char* field_name) {
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
    give_back(std::exchange(member, fresh));
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
    assign(class_of<M>, &member, as_struct<M>(object, field_name));
  }
}

template <class M>
inline constexpr FieldType field_type = {
    [](py::handle self, void* at) { return get_value(self, *static_cast<M*>(at)); },
    [](void* at, py::handle value, const char* name) { put_value(*static_cast<M*>(at), value, name); },
    [](const void* a, const void* b) { return same_value(*static_cast<const M*>(a), *static_cast<const M*>(b)); }};

// A struct that goes into a call without the GIL: a copy, with references of its own; null for None where allowed.
template <class T>
class Input {
 public:
  Input(py::handle object, const char* name, bool null) {
    if (!(object.is_none() && null)) box_ = std::make_unique<Box<T>>(*as_struct<T>(object, name));
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
  Changed(py::handle object, const char* name)
      : target_(as_struct(object, class_of<T>, name)), copy_(*static_cast<T*>(target_.at)) {
    if (target_.constant) refuse_constant(target_.of.name);
  }
  T* get() { return &copy_.value; }
  void take() { assign(target_.of, target_.at, &copy_.value); }

 private:
  Struct& target_;
  Box<T> copy_;
};

// An array of structs that comes in: in one piece, of the class's dtype.
inline py::array structs(py::handle object, const StructClass& of, const char* name) {
  const std::string type = of.name;
  const py::object dtype = py::reinterpret_borrow<py::object>(of.dtype);
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
      as_struct(object[py::int_(i)], of, name);
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

inline py::array new_structs(const StructClass& of, size_t count) {
  const std::vector<py::ssize_t> shape{static_cast<py::ssize_t>(count)};
  return py::array(py::reinterpret_borrow<py::dtype>(of.dtype), shape);
}

struct Part {  // a field of text, or fields without text that follow each other
  std::string name;
  size_t from, to, size;  // bytes
  bool is_text;
};
struct Shown {
  PyObject* dtype;  // null: there is no text. Never freed
  std::vector<Part> parts;
};
inline Shown shown_of(const StructClass& of) {
  py::list fields;
  Shown made{};
  size_t to = 0;
  const py::object dtype = py::reinterpret_borrow<py::object>(of.dtype);
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
}

// What is listed, for users. Structs with text become a recarray: text is str, and fields are attributes too. Others stay a
// plain array. NumPy itself would need five times as long to copy the columns.
inline py::object rows(const StructClass& of, const void* entries, size_t count) {
  static std::map<const StructClass*, Shown> of_all;
  const auto found = of_all.find(&of);
  const Shown& shown = found != of_all.end() ? found->second : of_all.emplace(&of, shown_of(of)).first->second;
  const auto plain = [&] {
    py::array array = new_structs(of, count);
    std::memcpy(array.mutable_data(), entries, count * of.size);
    return array;
  };
  if (!shown.dtype) return plain();
  const py::object numpy = py::module_::import("numpy");
  py::array out = numpy.attr("zeros")(count, py::reinterpret_borrow<py::object>(shown.dtype));
  const auto width = static_cast<size_t>(out.itemsize());
  for (const Part& part : shown.parts) {
    const auto* from = static_cast<const unsigned char*>(entries) + part.from;
    auto* to = static_cast<char*>(out.mutable_data()) + part.to;
    bool is_ascii = true;
    for (size_t row = 0; row < count; ++row, from += of.size, to += width) {
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

inline py::array struct_results(py::handle out, const StructClass& of, size_t count, const char* name) {
  if (out.is_none()) return new_structs(of, count);
  if (py::isinstance<py::array>(out)) {
    py::array array = py::reinterpret_borrow<py::array>(out);
    if (array.dtype().equal(py::reinterpret_borrow<py::object>(of.dtype)) && array.ndim() == 1 &&
        static_cast<size_t>(array.size()) == count && array.flags() & py::array::c_style && array.writeable()) {
      return array;
    }
  }
  type_error(std::string(name) + " must be a C-contiguous, writable array of " + of.name + ".dtype, shape (" +
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
    return rows(class_of<T>, entries.data(), count);
  }
}

// An array that lives as long as a handle: a read-only view that has a reference to it.
template <class T, class H>
py::object kept(const T* entries, size_t count, int width, H* handle) {
  if (!entries) return py::none();
  using E = std::conditional_t<std::is_same_v<T, fs_vec3>, double, T>;
  if constexpr (std::is_same_v<T, fs_vec3>) width = 3;
  const py::capsule keeper(retained(handle), [](void* kept) { give_back(static_cast<H*>(kept)); });
  std::vector<py::ssize_t> shape{static_cast<py::ssize_t>(count)};
  if (width > 1) shape.push_back(width);
  py::array_t<E> array(shape, reinterpret_cast<const E*>(entries), keeper);
  array.attr("flags").attr("writeable") = false;
  return array;
}

}  // namespace forceserver_python
