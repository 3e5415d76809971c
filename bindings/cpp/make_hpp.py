"""Writes include/forceserver/forceserver.hpp from the description of the public headers: for each handle a class that gives
it back, and for each function that returns a status a method that throws.

make_hpp.py          writes forceserver.hpp
make_hpp.py --check  only says whether it would be the same
"""
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "bindings/description"))
import description

BEGIN = """\
// forceserver.hpp - the C functions for C++17 and later: handles that give themselves back, and errors as exceptions. Written
// by bindings/cpp/make_hpp.py from the C headers, whose comments hold here.
//
//     using namespace forceserver;
//     Scene scene = Scene::create();
//     fs_object spring = fs_object_init("spring", FS_PRIMITIVE_POINT);
//     spring.front = fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, 200, 0, 5);
//     scene.object_set(spring);
//     Device device = Device::open("sim:");
//     Servo servo = Servo::start(scene, device);
//
// A method is the function of its name: scene.get_time() calls fs_scene_get_time, scene.object_set(o) calls fs_object_set. What a
// function writes to `out` the method returns. Where nothing may be thrown, as in a loop of your own in real time, call the C
// function: fs_evaluate(tool.get(), ..).
// A class is a std::unique_ptr of the C handle, and is empty until a static function makes one. As with a pointer, what it points
// at can be changed through a const one.
#ifndef FORCESERVER_FORCESERVER_HPP
#define FORCESERVER_FORCESERVER_HPP

#include <cstddef>
#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <forceserver/forceserver.h>

namespace forceserver {

// A call that failed; what() is fs_last_error().
class Error : public std::runtime_error {
 public:
  explicit Error(fs_status status) : std::runtime_error(fs_last_error()), status_(status) {}
  Error(fs_status status, const std::string& text) : std::runtime_error(text), status_(status) {}
  fs_status status() const noexcept { return status_; }

 private:
  fs_status status_;
};

inline void throw_on_error(fs_status status) {
  if (status < 0) throw Error(status);
}

// To the C functions a string ends at its first byte 0.
inline const char* c_string(const std::string& text, const char* name) {
  if (text.find('\\0') != std::string::npos) throw Error(FS_ERROR_INVALID, std::string(name) + " has a byte 0, must be without");
  return text.c_str();
}

template <auto give_back>
struct GiveBack {
  template <class T>
  void operator()(T* handle) const noexcept {
    give_back(handle);
  }
};

// What Scene::object_get returns: an fs_object with its shape and curves, which it gives back.
class Object : public fs_object {
 public:
  Object() : fs_object(fs_object_init("", FS_PRIMITIVE_POINT)) {}
  Object(Object&& other) noexcept : Object() { std::swap(static_cast<fs_object&>(*this), static_cast<fs_object&>(other)); }
  Object& operator=(Object&& other) noexcept {
    std::swap(static_cast<fs_object&>(*this), static_cast<fs_object&>(other));
    return *this;
  }
  ~Object() { fs_object_release(this); }
};

// A whole list, also where it grows meanwhile. f(out, capacity, count) calls the C function.
template <class T, class F>
std::vector<T> list_of(F&& f) {
  std::vector<T> out(64);
  for (std::size_t count = 0;; out.resize(count + 64)) {
    throw_on_error(f(out.data(), out.size(), &count));
    if (count > out.size()) continue;
    out.resize(count);
    return out;
  }
}
"""
END = """\

// A group of changes, open from here on: commit() makes all of them felt from one tick on, and where it is not called the
// destructor takes them back. A group belongs to its thread, and its scene must outlive it.
class Group {
 public:
  explicit Group(const Scene& scene) : scene_(scene.get()) { throw_on_error(fs_scene_begin(scene_)); }
  Group(const Group&) = delete;
  Group& operator=(const Group&) = delete;
  ~Group() {
    if (scene_) fs_scene_cancel(scene_);
  }
  void commit() {
    throw_on_error(fs_scene_commit(scene_));
    scene_ = nullptr;
  }

 private:
  fs_scene* scene_;
};

}  // namespace forceserver

#endif
"""
OF_POINTERS = {"get", "reset", "release", "swap"}  # std::unique_ptr has functions of these names


def bare(type_):
    return re.sub(r"\bconst\b", "", type_).replace("*", "").strip()


class Writer:
    def __init__(self):
        self.d = description.load()
        self.functions = [f for f in self.d["functions"] if not f["for_c"] and f["header"] != "driver.h"]
        self.handles = [h["name"] for h in self.d["handles"]]
        names = {f["name"]: f for f in self.functions}
        # What an output is before the call: structs that grow have their size in them.
        self.inits = {s["name"] for s in self.d["structs"] if not names.get(s["name"] + "_init", {"parameters": [1]})["parameters"]}

    def class_of(self, handle):
        return "".join(word.capitalize() for word in handle[3:].split("_"))

    def owner(self, function):
        """The class that has this method: that of the handle it makes, or else that of its first parameter; None: no class."""
        made = [bare(p["type"]) for p in function["parameters"] if p["kind"] == "new handle"]
        first = [bare(p["type"]) for p in function["parameters"][:1] if p["kind"] == "handle"]
        return (made or first or [None])[0]

    def name(self, function, owner):
        whole = function["name"][3:]
        name = re.sub(f"^{owner[3:]}_", "", whole) if owner else whole
        return whole if name in OF_POINTERS else name

    def argument(self, p):
        """The parameter of the method, and what the C function is given."""
        name, type_, kind = p["name"], p["type"], p["kind"]
        if kind == "handle":
            return f"const {self.class_of(bare(type_))}& {name}", f"{name}.get()"
        if kind == "string":
            return (f"const char* {name}", name) if p["null"] else (f"const std::string& {name}", f'c_string({name}, "{name}")')
        if kind == "struct" and not p["null"]:
            return f"const {bare(type_)}& {name}", f"&{name}"
        return f"{type_.replace(' *', '*')} {name}", name

    def method(self, function, owner):
        outs = [p for p in function["parameters"] if p["kind"] in ("out struct", "out number", "new handle") and not p["null"]]
        listed = [p for p in function["parameters"] if p["kind"] == "list"]
        result, before, after, parameters, call = "void", [], [], [], []
        is_static = bool(outs and outs[0]["kind"] == "new handle")
        for i, p in enumerate(function["parameters"]):
            if i == 0 and p["kind"] == "handle" and not is_static:
                call.append("get()")
            elif p in outs:
                type_ = bare(p["type"])
                result = "Object" if type_ == "fs_object" else self.class_of(type_) if p["kind"] == "new handle" else type_
                if p["kind"] == "new handle":
                    before, after = [f"{type_}* {p['name']} = nullptr;"], [f"return {result}({p['name']});"]
                else:
                    value = f" = {type_}_init()" if type_ in self.inits else "" if result == "Object" else "{}"
                    before, after = [f"{result} {p['name']}{value};"], [f"return {p['name']};"]
                call.append(f"&{p['name']}")
            elif p["kind"] in ("list", "capacity", "out count"):
                call.append(p["name"])
            else:
                parameter, given = self.argument(p)
                parameters.append([parameter, p["null"] and p["kind"] != "handle"])
                call.append(given)
        for parameter in reversed(parameters):  # what may be null at the end need not be given
            if not parameter[1]:
                break
            parameter[0] += " = nullptr"
        called = f"{function['name']}({', '.join(call)})"
        if listed:
            type_ = bare(listed[0]["type"])
            names = [p["name"] for p in function["parameters"] if p["kind"] in ("list", "capacity", "out count")]
            result = f"std::vector<{type_}>"
            body = [
                f"return list_of<{type_}>([&]({type_}* {names[0]}, std::size_t {names[1]}, std::size_t* {names[2]}) {{",
                f"  return {called};",
                "});",
            ]
        else:
            body = [*before, f"throw_on_error({called});", *after]
        head = f"{'static ' if is_static and owner else 'inline ' if not owner else ''}{result} {self.name(function, owner)}"
        head += f"({', '.join(p for p, _ in parameters)}){' const' if owner and not is_static else ''} {{"
        indent = "  " if owner else ""
        if len(indent + head) > 128:
            cut = head.rindex(", ", 0, 120) + 1
            head = head[:cut] + "\n" + indent + " " * 4 + head[cut:].lstrip()
        if len(body) == 1 and len(indent + head + body[0]) < 126:
            return f"{indent}{head} {body[0]} }}\n"
        return indent + head + "\n" + "".join(f"{indent}  {line}\n" for line in body) + indent + "}\n"

    def text(self):
        out = [BEGIN]
        give_back = {}
        for f in self.functions:
            if re.search("_(destroy|close|stop)$", f["name"]) and f["result"].get("kind") == "nothing":
                give_back[bare(f["parameters"][0]["type"])] = f["name"]
        methods = {handle: [] for handle in [None, *self.handles]}
        for f in self.functions:
            if f["result"].get("kind") == "status":
                owner = self.owner(f)
                methods[owner].append(self.method(f, owner))
        out.append("\n" + "".join(methods[None]))
        comments = {h["name"]: h["comment"] for h in self.d["handles"]}
        for handle in self.handles:
            name, pointer = self.class_of(handle), f"std::unique_ptr<{handle}, GiveBack<{give_back[handle]}>>"
            retain = f"{handle}_retain"
            if any(f["name"] == retain for f in self.functions):
                methods[handle].append(f"  {name} retain() const {{ return {name}({retain}(get())); }}  // one more of the same\n")
            comment = re.sub(f": {give_back[handle]}", "", comments[handle])
            out.append(f"\n// {comment}\nclass {name} : public {pointer} {{\n public:\n  using unique_ptr::unique_ptr;\n")
            out.append("".join(methods[handle]) + "};\n")
        return "".join(out) + END


def main():
    target = ROOT / "include/forceserver/forceserver.hpp"
    text = Writer().text()
    if sys.argv[1:] == ["--check"]:
        if target.read_text() != text:
            sys.exit(f"{target} is not what the headers say: run bindings/description/make")
        return
    target.write_text(text)


if __name__ == "__main__":
    main()
