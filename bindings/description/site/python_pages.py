"""Writes the pages of the reference of the Python package, for autodoc: which names there are is asked of the package itself.

python_pages.py FOLDER
"""
import inspect
import pathlib
import sys

import forceserver
from forceserver import _core, _objects, _plot, _scene, _table

folder = pathlib.Path(sys.argv[1])
INHERITED = "\n   :inherited-members: pybind11_object, object, tuple"  # the functions of C as methods


def kind(name):
    thing = getattr(_core, name)
    if not inspect.isclass(thing):
        return "functions" if callable(thing) else "constants"
    return "errors" if issubclass(thing, Exception) else "enums" if issubclass(thing, int) else "structs"


def documented(names, options=""):
    for name in names:
        thing = getattr(forceserver, name)
        directive = "autoclass" if inspect.isclass(thing) else "autofunction" if callable(thing) else "autodata"
        yield f".. {directive}:: {name}\n" + (f"   :members:\n   :undoc-members:{options}\n" if directive == "autoclass" else "")


def page(name, title, said, names, options=""):
    body = "\n".join(documented(names, options))
    (folder / f"{name}.md").write_text(f"# {title}\n\n{said}\n\n```{{eval-rst}}\n.. currentmodule:: forceserver\n\n{body}```\n")
    return f"{name}\n"


folder.mkdir(parents=True, exist_ok=True)
core = {of: [] for of in ("structs", "enums", "functions", "errors", "constants")}
for name in _core.__all__:
    core[kind(name)].append(name)
pages = page("scenes", "Scenes, servos and devices", "The handles, with all C functions as their methods.", _scene.__all__, INHERITED)
pages += page("objects", "Objects and profiles", "What is put into a scene.", [*_objects.__all__, "Shape", "Curve", "Surface"])
pages += page("pictures", "Pictures and tables", "", [*_plot.__all__, *_table.__all__])
pages += page("structs", "Structs", "Each is a class with the fields of the C struct. `copy()` gives a copy that shares nothing with it but "
              "shapes, curves and surfaces, and `dtype` is its type in an array of NumPy.", core["structs"],
              "\n   :exclude-members: copy, dtype")
pages += page("enums", "Enums and constants", "", core["enums"] + core["constants"])
pages += page("functions", "Functions", "What belongs to no handle.", core["functions"])
pages += page("errors", "Errors", "Each status has an exception; all of them are `Error`.", core["errors"])
(folder / "index.md").write_text(
    "# The Python package\n\nWhat `import forceserver as fs` gives. [forceserver for Python](../../bindings/python/index.md) shows how it "
    "is used.\n\n"
    f"```{{toctree}}\n{pages}```\n\n```{{eval-rst}}\n.. automodule:: forceserver\n```\n")
