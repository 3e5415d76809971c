"""Writes the layer forceserver._core and its type stub from the description of the public headers.

generate.py DESCRIPTION OUTPUT_FOLDER: writes module.cpp, functions.cpp, scene.cpp and _core.pyi there. CMake runs it whenever the description
changes.
The headers in core/ have what the generated code is made of. What no rule gives stands in tables, here and in generator/.
"""

import json
import pathlib
import sys

from generator.functions import Functions
from generator.names import DOUBLES, camel, indented, raw

BASES = {
    "INVALID": "ValueError",
    "PARSE": "ValueError",
    "NOT_FOUND": "KeyError",
    "UNSUPPORTED": "NotImplementedError",
    "MEMORY": "MemoryError",
    "TIMEOUT": "TimeoutError",
    "IO": "OSError",
    "DISCONNECTED": "ConnectionError",
    "DENIED": "PermissionError",
}
IN_PACKAGE = {"fs_scene_connect": "fs.connect", "fs_evaluate": "Tool.evaluate", "fs_evaluate_field": "Scene.evaluate"}


class Generator(Functions):
    def run(self):
        """The generated files, by name. The C++ is cut into files that take about as long to compile."""
        self.stubs_of = {None: []} | {handle: [] for handle in self.handles}
        self.bodies = {None: []} | {handle: [] for handle in self.handles}
        self.added = {None: []} | {handle: [] for handle in self.handles}
        self.add_enums()
        self.add_handles()
        self.add_structs()
        for function in self.functions:
            if not self.is_for_binding(function):
                self.add_function(function)
        # What the package takes as it is: all but the handles, most of which it has classes of its own for.
        self.public = (
            ["Error", "NoFileError"]
            + [name for name, _, _ in self.exceptions()]
            + [item["python"] for item in self.d["enums"]]
            + [camel(name) for name in self.structs if name not in DOUBLES]
            + [self.python_name(f) for f in self.functions if not self.self_of(f) and not self.is_for_binding(f)]
            + [c["name"][3:] for c in self.d["constants"]]
        )
        scene = "fs_scene"
        others = [handle for handle in self.bodies if handle != scene]
        files = {
            "module.cpp": self.module(),
            "functions.cpp": self.source(
                [body for handle in others for body in self.bodies[handle]],
                "add_functions",
                [line for handle in others for line in self.added[handle]],
            ),
            "scene.cpp": self.source(self.bodies[scene], "add_scene_functions", self.added[scene]),
            "_core.pyi": self.stub_text(),
        }
        return {name: "\n".join(lines) + "\n" for name, lines in files.items()}

    def names_in_errors(self):
        """What the sentences of errors call a function."""
        for function in self.functions:
            name, owner = function["name"], self.self_of(function)
            if not self.is_for_binding(function):
                shown = (camel(owner) if owner else "fs") + "." + self.python_name(function)
                yield name, IN_PACKAGE.get(name, shown)

    def error_lines(self):
        yield "void add_names() {"
        names = ", ".join(f'{{"{name}", "{shown}"}}' for name, shown in self.names_in_errors())
        yield f"  errors.names = {{{names}}};"
        yield "}"
        yield "void add_errors(py::module_& module) {"
        yield '  errors.base = PyErr_NewExceptionWithDoc("forceserver.Error",'
        yield '      "A call of the library failed: the sentence says why, and status is its Status.", nullptr, nullptr);'
        yield '  module.attr("Error") = py::reinterpret_borrow<py::object>(errors.base);'
        yield '  const py::object sentence = py::module_::import("builtins").attr("BaseException").attr("__str__");'
        for python, name, comment in self.exceptions():
            value = next(v for n, v, _ in self.enums["fs_status"]["members"] if n == name)
            base = f", py::handle(PyExc_{BASES[name]})" if name in BASES else ""
            yield "  {"
            yield f"    const py::tuple bases = py::make_tuple(py::handle(errors.base){base});"
            yield "    py::dict members;"
            yield f'    members["status"] = enum_of<fs_status>.to_python({value});'
            yield '    members["__str__"] = sentence;'
            doc = raw(" ".join(comment.split()))
            yield f'    PyObject* made = PyErr_NewExceptionWithDoc("forceserver.{python}", {doc}, bases.ptr(), members.ptr());'
            yield "    if (!made) throw py::error_already_set();"
            yield f"    errors.classes.push_back({{{value}, made}});"
            yield f'    module.attr("{python}") = py::reinterpret_borrow<py::object>(made);'
            yield "  }"
        yield '  const py::object not_found = module.attr("NotFoundError");'
        yield "  const py::tuple bases = py::make_tuple(not_found, py::handle(PyExc_FileNotFoundError));"
        yield '  errors.no_file ='
        yield '      PyErr_NewExceptionWithDoc("forceserver.NoFileError", "There is no such file.", bases.ptr(), nullptr);'
        yield "  if (!errors.no_file) throw py::error_already_set();"
        yield '  module.attr("NoFileError") = py::reinterpret_borrow<py::object>(errors.no_file);'
        yield "}"

    @staticmethod
    def function(name, lines):
        """A function that adds something to the module."""
        yield f"void {name}([[maybe_unused]] py::module_& module) {{"
        yield from (indented(line, "  ") if 'R"doc(' not in line else line for line in lines)
        yield "}"

    def source(self, bodies, name, lines):
        """A file with functions, and one that adds what is made of them to the module."""
        yield "// Generated from the description of the headers by generate.py."
        yield '#include "core.h"\n'
        yield "namespace forceserver_python {\n"
        for body in bodies:
            yield body + "\n"
        yield from self.function(name, lines)
        yield "\n}  // namespace forceserver_python"

    def module(self):
        yield "// Generated from the description of the headers by generate.py."
        yield '#include "core.h"'
        yield '#include "core/classes.h"\n'
        yield "namespace forceserver_python {\nnamespace {\n"
        yield from self.function("add_types", self.cpp)
        yield ""
        yield from self.error_lines()
        yield "\nvoid add_constants(py::module_& module) {"
        for c in self.d["constants"]:
            yield f'  module.attr("{c["name"][3:]}") = {c["value"]};'
        yield "  py::dict parts;"
        for field, bit in self.parts().items():
            yield f'  parts["{field}"] = {bit};'
        yield '  module.attr("PARTS") = parts;'
        yield "  py::list all;"
        names = ", ".join(f'"{name}"' for name in self.public)
        yield f"  for (const char* name : {{{names}}}) all.append(name);"
        yield '  module.attr("__all__") = all;'
        yield "}"
        yield "\n}  // namespace\n}  // namespace forceserver_python\n"
        yield "PYBIND11_MODULE(_core, module) {"
        yield "  using namespace forceserver_python;"
        yield '  module.doc() = "The C functions of forceserver, generated from its headers.";'
        yield "  pybind11::options options;"
        yield "  options.disable_function_signatures();"
        yield "  pthread_atfork(nullptr, nullptr, [] { ++forks; });"
        yield "  add_types(module);"
        yield "  add_names();"
        yield "  add_errors(module);"
        yield "  add_functions(module);"
        yield "  add_scene_functions(module);"
        yield "  add_constants(module);"
        yield '  py::module_::import("atexit").attr("register")(py::cpp_function(Handle::close_all));'
        yield "}"

    def stub_text(self):
        yield "# Generated from the description of the headers by generate.py."
        yield "import builtins"
        yield "from collections.abc import Sequence"
        yield "from enum import IntEnum, IntFlag"
        yield "from os import PathLike"
        yield "from typing import Any, ClassVar, Literal, Protocol, Self, TypedDict, Unpack, overload\n"
        yield "import numpy as np"
        yield "from numpy.typing import ArrayLike, NDArray\n"
        yield f"__all__ = {json.dumps(self.public)}\n"
        yield "Array = NDArray[np.float64]"
        yield "Indices = NDArray[np.uint32]"
        yield "Structs = NDArray[np.void]"
        yield "Rows = np.recarray[Any, np.dtype[np.record]]  # structs with names: a field is also an attribute\n"
        yield "class Rotation(Protocol):\n    def as_quat(self) -> Any: ...\n"
        yield "class Error(Exception):\n    status: ClassVar[Status]\n"
        for python, name, _ in self.exceptions():
            yield f"class {python}(Error{', builtins.' + BASES[name] if name in BASES else ''}): ...\n"
        yield "class NoFileError(NotFoundError, builtins.FileNotFoundError): ...\n"
        yield from self.stub
        for handle in self.handles:
            name = camel(handle)
            yield f"class {name}:"
            yield f"    def __init__(self, other: {name}) -> None: ..."
            yield "    def close(self) -> None: ..."
            yield "    @property\n    def closed(self) -> bool: ..."
            yield "    def __enter__(self) -> Self: ..."
            yield "    def __exit__(self, *args: object) -> None: ..."
            yield "\n".join(self.stubs_of[handle])
            yield ""
        yield from self.stubs_of[None]
        for c in self.d["constants"]:
            yield f"{c['name'][3:]}: {type(c['value']).__name__}"
        yield "PARTS: dict[str, int]  # the fs_part bit of each field of Object"

def main():
    description = json.loads((pathlib.Path(sys.argv[1])).read_text())
    folder = pathlib.Path(sys.argv[2])
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in Generator(description).run().items():
        (folder / name).write_text(text)


main()
