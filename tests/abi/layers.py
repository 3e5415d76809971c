"""The layers of the library: a file may include files of lower layers only, never of its neighbours or of higher ones.

layers.py PROJECT_FOLDER
"""
import pathlib
import re
import sys

# From the lowest up. The public headers lie below all.
LAYERS = [["base"], ["math", "ipc"], ["law", "shape", "driver"], ["field"], ["scene", "transfer"], ["budget"], ["file", "client", "servo"], ["server"],
          ["api"]]
LAYER = {folder: number for number, folders in enumerate(LAYERS) for folder in folders}
# Those outside of it, with all that they may use beside the public headers and their own files.
# Simulator and registration are in the library; the other devices are modules, and link only what is public: of base they include
# headers that need no source file.
OUTSIDE = {"device": {"math", "base/clock.h", "base/decimal_point.h", "base/futex.h", "base/seqlock.h", "base/shortened.h"}, "device/sim": {"base", "math", "device"}, "device/builtin.cpp": {"driver", "device/sim"},
           "program": set()}

root = pathlib.Path(sys.argv[1])
problems = []
edges = set()


def folder_of(path):
    """The folder under lib/, or a name of OUTSIDE."""
    parts = path.relative_to(root).parts
    if parts[:2] == ("lib", "program"):
        return "program"
    if parts[0] != "device":
        return parts[1]
    return "/".join(parts[:2]) if "/".join(parts[:2]) in OUTSIDE else "device"


def check(file):
    here = folder_of(file)
    if here not in LAYER and here not in OUTSIDE:
        problems.append(f"{file}: lib/{here} is in no layer")
        return
    for number, line in enumerate(file.read_text().splitlines(), 1):
        match = re.match(r'\s*#\s*include\s*([<"])([^>"]+)[>"]', line)
        if not match:
            continue
        name, place = match[2], f"{file.relative_to(root)}:{number}"
        if name.startswith("forceserver/"):
            continue
        candidates = [root / "lib" / name, root / name]
        if match[1] == '"':
            candidates.insert(0, file.parent / name)
        target = next((c.resolve() for c in candidates if c.is_file()), None)
        if target is None:
            if match[1] == '"':
                problems.append(f"{place}: {name} is not there")
            continue  # of the system
        if not target.is_relative_to(root / "lib") and not target.is_relative_to(root / "device"):
            problems.append(f"{place}: {name} is neither in lib nor in device")
            continue
        there = folder_of(target)
        edges.add((here, there))
        if there == here:
            continue
        if here in OUTSIDE:
            good = there in OUTSIDE[here] or name in OUTSIDE[here]
        else:
            good = there in LAYER and LAYER[there] < LAYER[here]
        if not good:
            problems.append(f"{place}: {here} may not include {there} ({name})")


root = root.resolve()
files = [f for top in ["lib", "device"] for f in sorted((root / top).rglob("*")) if f.suffix in {".h", ".cpp"}]
for f in files:
    check(f)
if not files or not edges:
    problems.append("no includes were found: this test sees nothing")
ways = {edge for edge in edges if edge[0] != edge[1]}
print("\n".join(problems) or f"{len(files)} files; {len(ways)} ways between folders, all of them down")
sys.exit(bool(problems))
