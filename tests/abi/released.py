"""The binary interface of each released minor version stays as it is. The folder released/MAJOR.MINOR keeps of that version:
its headers (include), the layout of its structs (layout.c), the functions that its library showed with their version nodes
(symbols), the types of these functions as the debug information has them (types.abi), some of its programs (programs) and of its
scene files (scenes), and the commands and options of the program forceserver (commands).

released.py keep [--again] [LIBRARY]
                               writes the folder of the version of today's headers; with --again also where it is there. LIBRARY:
                               forceserver_described, without it that of build/release
released.py headers C_COMPILER compares today's headers with those that are kept: nothing is gone, nothing means something else
released.py symbols NM LIBRARY each function that a version showed is shown today, with the same version node, and its nodes
                               have no function more
released.py types LIBRARY      the functions still have their types, in the library itself. LIBRARY: forceserver_described
released.py programs C_COMPILER CXX_COMPILER FOLDER LIBRARY
                               the kept programs, built with the kept headers, run with today's library
released.py program PROGRAM    today's program forceserver has the kept commands and options, and can load the kept scene files
"""
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ElementTree

ROOT = pathlib.Path(__file__).resolve().parents[2]
INCLUDE = ROOT / "include"
RELEASED = pathlib.Path(__file__).with_name("released")
DESCRIBED = ROOT / "build/release/tests/abi/libforceserver_described.so"
sys.path[:0] = [str(ROOT / "bindings/description")]
import description
import versions

PROGRAMS = ["tests/abi/versions.c", "examples/c/hello.c", "examples/c/own_loop.c", "examples/c/peg_in_hole.c", "examples/c/driver.c",
            "examples/cpp/hello.cpp"]
SCENES = ["tests/fuzz/corpus/scene_file/all_keys.json", "examples/scenes/room.json", "examples/materials/materials.json",
          "examples/testbed/hazards.json"]


def kept():
    folders = sorted(folder for folder in RELEASED.iterdir() if folder.is_dir())
    if not folders:
        sys.exit("no version is kept: this test sees nothing")
    return folders


# --------------------------------------------------------------------------------------------------------------- headers

def layout(described):
    """Assertions that every later version of the headers must pass. Fields named reserved may become something else."""
    growing = {struct["name"] for struct in described["structs"] if struct["growing"]}
    out = []
    for struct in described["structs"]:
        out.append(f"{'GROWING' if struct['name'] in growing else 'STRUCT'}({struct['name']}, {struct['size']});")
        out += [f"FIELD({struct['name']}, {field['name']}, {field['offset']}, {field['size']});"
                for field in struct["fields"] if not field["name"].startswith("reserved")]
    for enum in described["enums"]:
        if enum["name"]:
            out.append(f"STRUCT({enum['name']}, 4);")
        out += [f"VALUE({value['name']}, {value['value']});" for value in enum["values"]]
    out += [f"VALUE({constant['name']}, {constant['value']});" for constant in described["constants"]
            if isinstance(constant["value"], int) and not constant["name"].startswith("FS_VERSION_")]
    return """/* The binary interface of this version on 64-bit machines: later headers must compile with it. */
#include <stddef.h>
#include <stdint.h>
#include <forceserver/forceserver.h>
#include <forceserver/driver.h>

#define STRUCT(type, size) _Static_assert(sizeof(type) == (size), #type)
#define GROWING(type, size) _Static_assert(sizeof(type) >= (size), #type)
#define FIELD(type, field, offset, size) \\
  _Static_assert(offsetof(type, field) == (offset) && sizeof(((type *)0)->field) == (size), #type "." #field)
#define VALUE(name, value) _Static_assert((name) == (value), #name)

#if UINTPTR_MAX == UINT64_MAX
""" + "\n".join(out) + "\n#endif\n"


def normal(text):
    return re.sub(r" ?(\W) ?", r"\1", " ".join(text.split()))


def declared(folder):
    """What the headers of a folder declare, as texts without comments: each function with its parameters, each field with its
    type."""
    out = set()
    for file in sorted((folder / "forceserver").glob("*.h")):
        text = re.sub(r"/\*.*?\*/", " ", file.read_text(), flags=re.S)
        text = re.sub(r"^\s*#(?:[^\n]*\\\n)*[^\n]*$", "", text, flags=re.M)
        for name, body in re.findall(r"typedef struct (\w+) \{(.*?)\n\} \1;", text, flags=re.S):
            for field in filter(str.strip, body.split(";")):
                for one in several(field):
                    out.add(f"{name}: {one}")
        text = re.sub(r"typedef (?:struct|enum) (?:\w+ )?\{.*?\n\} \w+;|enum \{.*?\};", "", text, flags=re.S)
        for match in re.finditer(r"(?:FS_API|static inline)\s([^;{]*)", text):
            out.add(normal(match[1]))
        for match in re.finditer(r"typedef [^;]*;|FS_DEFINE_INIT\(\w+\)", text):
            out.add(normal(match[0]))
    return out


def several(field):
    """"double a, b[2]" as "double a" and "double b[2]". What is reserved may change."""
    if "(" in field:
        return [normal(field)]
    first, *rest = field.split(",")
    type_ = re.sub(r"\w+\s*(\[\w+\]\s*)*$", "", first.strip()).rstrip("* ")
    fields = [normal(first)] + [normal(f"{type_} {other}") for other in rest]
    return [one for one in fields if not re.search(r"\breserved", one)]


def headers(compiler):
    bad = 0
    today = declared(INCLUDE)
    for folder in kept():
        before = declared(folder / "include")
        for text in sorted(before - today):
            bad += 1
            print(f"{folder.name} has it, and today's headers do not: {text}")
        result = subprocess.run([compiler, "-std=c11", "-Wall", "-Wextra", "-pedantic", "-Werror", f"-I{INCLUDE}", "-fsyntax-only",
                                 folder / "layout.c"], text=True, capture_output=True)
        if result.returncode:
            bad += 1
            print(f"the layout of {folder.name} is not kept:\n{result.stderr}")
        print(f"{folder.name}: {len(before)} declarations and {(folder / 'layout.c').read_text().count(');')} assertions")
    constants = {constant["name"]: constant["value"] for constant in description.load()["constants"]}
    version = f"{constants['FS_VERSION_MAJOR']}.{constants['FS_VERSION_MINOR']}"
    if not (RELEASED / version).is_dir():
        bad += 1
        print(f"nothing is kept of version {version}: run python3 tests/abi/released.py keep")
    return bad


# --------------------------------------------------------------------------------------------------------------- library

def symbols_of(nm, library):
    """ "fs_version@@FORCESERVER_1" and so on. Without the line of each node itself, which is absolute."""
    output = subprocess.run([nm, "-D", "--defined-only", library], check=True, text=True, capture_output=True).stdout
    return {line.split()[-1] for line in output.splitlines() if line.split()[-2] != "A"}


def symbols(nm, library):
    bad, shown = 0, symbols_of(nm, library)
    for folder in kept():
        before = set((folder / "symbols").read_text().split())
        for name in sorted(before - shown):
            bad += 1
            print(f"{folder.name} shows {name}, and this library does not")
        nodes = {name.split("@@")[1] for name in before}
        for name in sorted(name for name in shown - before if name.split("@@")[1] in nodes):
            bad += 1
            print(f"{name} was added to a node of {folder.name}, which is kept: name it in the node of the next release")
        print(f"{folder.name}: {len(before)} functions")
    return bad


def write_types(library, file):
    subprocess.run(["abidw", "--exported-interfaces-only", "--drop-private-types", "--headers-dir", INCLUDE / "forceserver",
                    "--no-corpus-path", "--no-comp-dir-path", "--no-show-locs", "--out-file", file, library], check=True)


def signatures(file):
    """Each function with the names of the types that it returns and takes."""
    tree = ElementTree.parse(file)
    nodes = {node.get("id"): node for node in tree.iter() if node.get("id") and node.tag != "elf-symbol"}

    def name(key):
        node = nodes[key]
        if node.tag == "pointer-type-def":
            return name(node.get("type-id")) + "*"
        if node.tag == "qualified-type-def":
            return name(node.get("type-id")) + " const" * (node.get("const") == "yes")
        if node.tag == "array-type-def":
            return name(node.get("type-id")) + "[]"
        return node.get("name") or node.tag

    out = {}
    for function in tree.iter("function-decl"):
        if function.get("elf-symbol-id"):
            parameters = [name(part.get("type-id")) for part in function.findall("parameter")]
            out[function.get("name")] = f"{name(function.find('return').get('type-id'))} ({', '.join(parameters)})"
    return out


def types(library):
    if not shutil.which("abidiff"):
        print("abidiff is missing (Debian: abigail-tools); not tried")
        sys.exit(77)
    bad = 0
    with tempfile.TemporaryDirectory() as folder:
        today_file = pathlib.Path(folder) / "today.abi"
        write_types(library, today_file)
        today = signatures(today_file)
        for version in kept():
            before = signatures(version / "types.abi")
            for function, signature in sorted(before.items()):
                if today.get(function) != signature:
                    bad += 1
                    print(f"{function} was {signature} in {version.name}, and is {today.get(function)}")
            result = subprocess.run(["abidiff", "--no-added-syms", version / "types.abi", today_file], text=True, capture_output=True)
            incompatible, failed = 8, 3  # bits of its exit status: removed; an error of the tool. 4 is set by what grew, too
            if result.returncode & (incompatible | failed):
                bad += 1
                print(f"abidiff with {version.name} ends with {result.returncode}:\n{result.stdout}{result.stderr}")
            print(f"{version.name}: {len(before)} functions with their types; abidiff ends with {result.returncode}")
            bad += not before
    return bad


# -------------------------------------------------------------------------------------------------------------- programs

def run_kept(file, library):
    result = subprocess.run([file], env=os.environ | {"LD_LIBRARY_PATH": str(library)}, text=True, capture_output=True, timeout=120)
    if result.returncode or not result.stdout:
        sys.exit(f"{file.name} ends with {result.returncode}: {result.stdout}{result.stderr}")
    print(f"{file.name}: {result.stdout.splitlines()[-1]}")


def programs(c, cxx, folder, library):
    shutil.rmtree(folder, ignore_errors=True)
    (folder / "present").mkdir(parents=True)
    for name in ["libforceserver.so", "libforceserver.so.1"]:
        (folder / "present" / name).symlink_to(library)
    present = folder / "present"

    def build(name, source, include, *options):
        compiler = [cxx, "-std=c++20"] if source.suffix == ".cpp" else [c, "-std=gnu99"]
        subprocess.run([*compiler, f"-I{include}", source, "-o", folder / name, f"-L{present}", "-lforceserver", "-ldl", "-lm",
                        "-pthread", f"-Wl,-rpath-link,{present}", *options], check=True)
        return folder / name

    today = build("today", ROOT / "tests/abi/versions.c", INCLUDE, "-DPROGRAM=0", *versions.FIRST_SIZES)
    for number, version in enumerate(kept()):
        sources = sorted((version / "programs").iterdir())
        for source in sources:
            if source.name != "versions.c":
                run_kept(build(f"{source.stem}-{version.name}", source, version / "include"), present)
        source = version / "programs/versions.c"
        linked = build(f"versions-{version.name}", source, version / "include", "-DPROGRAM=0")
        found = build(f"versions-{version.name}-dlopen", source, version / "include", "-DPROGRAM=0", "-DBY_DLOPEN")
        for program in [linked, found]:
            versions.local(program, present, "take_all_structs", "last_field_is_kept")
        versions.connected(f"old-{2 * number}", today, present, found, present, versions.EDITS)
        versions.connected(f"old-{2 * number + 1}", linked, present, today, present, versions.EDITS)
    return 0


def commands_of(program):
    """ "run", "run --rate" and so on, as the completion of the shells has them."""
    def offered(*words):
        output = subprocess.run([program, "--complete", *words], check=True, text=True, capture_output=True).stdout
        return [line.split("\t")[0] for line in output.splitlines()]

    commands = offered("")
    return commands + [f"{command} {option}" for command in commands for option in offered(command, "--")]


def program(file):
    bad, today = 0, set(commands_of(file))
    for folder in kept():
        before = (folder / "commands").read_text().splitlines()
        for line in before:
            if line not in today:
                bad += 1
                print(f"{folder.name} has forceserver {line}, and today's program does not")
        scenes = sorted((folder / "scenes").iterdir())
        for scene in scenes:
            result = subprocess.run([file, "check", scene], text=True, capture_output=True)
            if result.returncode not in (0, 1):  # 1: something is odd in it
                bad += 1
                print(f"{scene.name} of {folder.name} is not loaded: {result.stderr}")
        print(f"{folder.name}: {len(before)} commands and options, {len(scenes)} scene files")
        bad += not before or not scenes
    return bad


# ------------------------------------------------------------------------------------------------------------------ keep

def keep(*arguments):
    (library,) = [argument for argument in arguments if argument != "--again"] or [DESCRIBED]
    if not pathlib.Path(library).exists():
        sys.exit(f"there is no {library}: build it, which needs abidw (Debian: abigail-tools)")
    described = description.load()
    constants = {constant["name"]: constant["value"] for constant in described["constants"]}
    folder = RELEASED / f"{constants['FS_VERSION_MAJOR']}.{constants['FS_VERSION_MINOR']}"
    if folder.exists() and "--again" not in arguments:
        sys.exit(f"{folder.name} is kept already, and what is released does not change (include/forceserver/versions.md). If it is "
                 "not released yet: python3 tests/abi/released.py keep --again")
    shutil.rmtree(folder, ignore_errors=True)
    (folder / "programs").mkdir(parents=True)
    shutil.copytree(INCLUDE / "forceserver", folder / "include/forceserver", ignore=shutil.ignore_patterns("*.md"))
    (folder / "layout.c").write_text(layout(described))
    (folder / "symbols").write_text("".join(f"{name}\n" for name in sorted(symbols_of("nm", library))))
    write_types(library, folder / "types.abi")
    for source in PROGRAMS:
        name = pathlib.Path(source).name
        text = (ROOT / source).read_text()
        if name == "versions.c":
            text = "".join(f"#define {size[2:].replace('=', ' ')}\n" for size in versions.FIRST_SIZES) + text
        (folder / "programs" / name).write_text(text)
    (folder / "scenes").mkdir()
    for source in SCENES:
        shutil.copy(ROOT / source, folder / "scenes")
    forceserver = pathlib.Path(library).resolve().parents[2] / "lib/program/forceserver"  # of the same build
    (folder / "commands").write_text("".join(f"{line}\n" for line in commands_of(forceserver)))
    print(f"{folder}: {sum(file.stat().st_size for file in folder.rglob('*') if file.is_file()) // 1000} kB")
    return 0


if __name__ == "__main__":
    command, *arguments = sys.argv[1:]
    if command == "programs":
        arguments[2:] = map(pathlib.Path, arguments[2:])
    sys.exit(bool({"keep": keep, "headers": headers, "symbols": symbols, "types": types, "programs": programs,
                   "program": program}[command](*arguments)))
