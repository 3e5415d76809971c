// Functions and methods. pybind11 would compile its code for a call anew for each of them; here it is there once.
#pragma once

#include <cstring>

#include "errors.h"

namespace forceserver_python {

// What a function does. `given`: self, where it has one, then each argument; None for what was left out.
using Body = py::object (*)(const py::handle* given);

class Function {
 public:
  // doc: "name(self, a, b=None)\n--\n\n.." for a method with an argument that must be given and one that need not.
  // before: the name that the last argument had before, which is still taken.
  Function(const char* doc, Body body, _PyCFunctionFastWithKeywords call, const char* before)
      : body_(body), before_(before ? before : "") {
    const char* const bracket = std::strchr(doc, '(');
    const char* const end = std::strstr(bracket, ")\n--");
    name_.assign(doc, bracket);
    for (const char* at = bracket + 1; at < end;) {
      const char* const comma = std::min(end, std::find(at, end, ','));
      const char* const equals = std::find(at, comma, '=');
      const std::string argument(at, equals);
      if (argument == "self") {
        has_self_ = 1;
      } else {
        arguments_.push_back(argument);
        if (equals == comma) required_ = arguments_.size();
      }
      at = comma + (comma < end ? 2 : 0);
    }
    if (arguments_.size() > most) value_error(name_ + " has too many arguments");
    definition_ = {name_.c_str(), reinterpret_cast<PyCFunction>(reinterpret_cast<void (*)()>(call)),
                   METH_FASTCALL | METH_KEYWORDS, doc};
  }

  // Puts it into a class or the module, for good.
  template <Body body>
  static void add(py::handle scope, const char* doc, const char* before = nullptr) {
    auto* const function = new Function(doc, body, call<body>, before);
    of_body<body> = function;
    put(scope, function->definition_, PyType_Check(scope.ptr()) ? scope : nullptr);
  }

  // self: what the function in C is given. Pickle finds a function by it: in that class, or for null in the module.
  static void put(py::handle scope, PyMethodDef& definition, py::handle self) {
    const py::str module("forceserver._core");
    auto made = py::reinterpret_steal<py::object>(PyCFunction_NewEx(&definition, self.ptr(), module.ptr()));
    if (made && PyType_Check(scope.ptr())) made = py::reinterpret_steal<py::object>(PyInstanceMethod_New(made.ptr()));
    if (!made) throw py::error_already_set();
    py::setattr(scope, definition.ml_name, made);
  }

 private:
  static constexpr size_t most = 15;

  template <Body>
  static inline const Function* of_body = nullptr;

  // C gives no data to a function; so there is one for each body.
  template <Body body>
  static PyObject* call(PyObject*, PyObject* const* args, Py_ssize_t count, PyObject* keywords) {
    return of_body<body>->run(args, count, keywords);
  }

  PyObject* run(PyObject* const* args, Py_ssize_t count, PyObject* keywords) const {
    return for_c([&] {
      py::handle given[most + 1];
      sort(args, static_cast<size_t>(count), keywords, given);
      return body_(given);
    });
  }

  // Puts the arguments of a call, and its keywords behind them, into the order of the function.
  void sort(PyObject* const* args, size_t count, PyObject* keywords, py::handle* given) const {
    const size_t wanted = has_self_ + arguments_.size();
    if (count > wanted) {
      type_error(name_ + "() takes " + std::to_string(arguments_.size()) + " arguments, not " +
                 std::to_string(count - has_self_));
    }
    std::copy(args, args + count, given);
    const size_t named = keywords ? static_cast<size_t>(PyTuple_GET_SIZE(keywords)) : 0;
    for (size_t i = 0; i < named; ++i) {
      py::handle& place = given[place_of(PyTuple_GET_ITEM(keywords, i), keywords)];
      if (place) type_error(name_ + "() was given '" + text_of(PyTuple_GET_ITEM(keywords, i)) + "' twice");
      place = args[count + i];
    }
    for (size_t i = count; i < wanted; ++i) {
      if (given[i]) continue;
      if (i >= has_self_ && i < has_self_ + required_) type_error(name_ + "() needs '" + arguments_[i - has_self_] + "'");
      given[i] = Py_None;
    }
  }

  size_t place_of(py::handle keyword, py::handle keywords) const {
    const auto is = [&](py::handle text, const std::string& name) {
      return PyUnicode_CompareWithASCIIString(text.ptr(), name.c_str()) == 0;
    };
    for (size_t i = 0; i < arguments_.size(); ++i) {
      if (is(keyword, arguments_[i])) return has_self_ + i;
    }
    const bool is_before = !before_.empty() && is(keyword, before_);
    if (is_before && std::none_of(keywords.begin(), keywords.end(), [&](py::handle k) { return is(k, arguments_.back()); })) {
      return has_self_ + arguments_.size() - 1;
    }
    type_error(name_ + "() has no argument '" + text_of(keyword) + "'");
  }

  std::string name_;
  std::vector<std::string> arguments_;  // without self
  size_t required_ = 0;                 // so many of them
  size_t has_self_ = 0;                 // 1: yes
  Body body_;
  std::string before_;
  PyMethodDef definition_;
};

}  // namespace forceserver_python
