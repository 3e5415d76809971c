"""Programs and libraries of different versions work together, in one process and over the wire, linked and by dlopen.

versions.py headers FOLDER OFFSET    writes headers whose growing structs have one field less (OFFSET -1) or more (1)
versions.py table FILE older|later   writes lib/base/struct_sizes.cpp as of a library that knows one field less of each struct
                                     (older), or whose first version had one field less (later)
versions.py run C_COMPILER FOLDER LIBRARY OLDER LATER
                                     builds versions.c with each kind of headers and runs it with the three libraries

One field less: the last declarations of the struct, until its size is a multiple of 8. All of this is made from the
description of the headers, so a struct that begins to grow is tested, too.
"""
import os
import pathlib
import re
import shutil
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "bindings/description"), str(ROOT / "lib/base")]
import description
import make_struct_sizes

GROWING = [struct for struct in description.load()["structs"] if struct["growing"]]
FIRST_SIZES = [f"-DFIRST_{struct['name']}={struct['first_size']}" for struct in GROWING]


def last_fields(struct):
    """The names of the last fields, and the size without them."""
    fields = list(struct["fields"])
    names = [fields.pop()["name"]]
    while (fields[-1]["offset"] + fields[-1]["size"]) % 8:
        names.append(fields.pop()["name"])
    return names, fields[-1]["offset"] + fields[-1]["size"]


def declared(statement):
    """The names that a declaration declares."""
    if function := re.search(r"\(\*(\w+)\)\(", statement):
        return [function[1]]
    return [re.match(r"\W*(\w+)", part.split()[-1])[1] for part in statement.split(",")]


def with_less(struct, body):
    names, _ = last_fields(struct)
    kept = []
    for statement in filter(str.strip, re.sub(r"/\*.*?\*/", "", body, flags=re.S).split(";")):
        gone = [name in names for name in declared(statement)]
        if any(gone) and not all(gone):  # "double a, b" without b
            type_, several = statement.split(maxsplit=1)
            statement = f" {type_} " + ",".join(one for one, is_gone in zip(several.split(","), gone) if not is_gone)
        if not all(gone):
            kept.append(statement + ";")
    return "".join(kept) + "\n"


def is_table(struct):
    return any(field["type"] == "function" for field in struct["fields"])


def with_more(struct, body):
    return body + ("  void (*added)(void);\n" if is_table(struct) else "  double added;\n")


def headers(folder, offset):
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(ROOT / "include/forceserver", folder / "forceserver")
    changed = []
    for file in sorted((folder / "forceserver").glob("*.h")):
        text = file.read_text()
        for struct in GROWING:
            def change(match):
                changed.append(struct["name"])
                return match[1] + (with_less if offset < 0 else with_more)(struct, match[2]) + match[3]
            name = struct["name"]
            text = re.sub(rf"(typedef struct {name} \{{)(.*?)(\}} {name};)", change, text, flags=re.S)
        file.write_text(text)
    if sorted(changed) != sorted(struct["name"] for struct in GROWING):
        sys.exit(f"only {changed} were changed")


def table(file, version):
    rows = []
    for struct in GROWING:
        _, less = last_fields(struct)
        knows_all = version == "later" or is_table(struct)  # the simulator comes with the library, so both have the same table
        rows.append((struct["name"], min(less, struct["first_size"]), struct["size"] if knows_all else less, struct["size"]))
    file.write_text(make_struct_sizes.text(rows))


# ------------------------------------------------------------------------------------------------------------------ runs

class Program:
    """A process that does what it is told, line by line."""

    def __init__(self, file, library, *arguments):
        environment = os.environ | {"LD_LIBRARY_PATH": str(library)}
        self.name = f"{file.name} with {library.name}"
        self.process = subprocess.Popen([file, *arguments], env=environment, text=True, stdin=subprocess.PIPE,
                                        stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        self.expect_ok(arguments[0])

    def expect_ok(self, what):
        answer = self.process.stdout.readline().strip()
        if answer != "ok":
            sys.exit(f"{self.name}: {what}: {answer}{self.process.stdout.read()}")

    def do(self, *lines):
        for line in lines:
            try:
                self.process.stdin.write(line + "\n")
                self.process.stdin.flush()
            except BrokenPipeError:
                pass
            self.expect_ok(line)

    def end(self):
        self.process.stdin.close()
        if self.process.wait(20) != 0:
            sys.exit(f"{self.name}: ended with {self.process.returncode}")


def build(compiler, folder, library):
    """The programs, by the version of their headers."""
    programs = {}
    for name, offset in {"less": -1, "today": 0, "more": 1}.items():
        include = folder / f"include-{name}"
        if offset:
            headers(include, offset)
        else:
            include = ROOT / "include"
        for kind, options in {"linked": [f"-L{library}", "-lforceserver"], "dlopen": ["-DBY_DLOPEN", "-ldl"]}.items():
            file = folder / f"{name}-{kind}"
            subprocess.run([compiler, "-std=gnu99", "-Wall", "-Wextra", "-Werror", f"-DPROGRAM={offset}", f"-I{include}", *FIRST_SIZES,
                            ROOT / "tests/abi/versions.c", "-o", file, *options, "-lm",
                            f"-Wl,-rpath-link,{library}"], check=True)
            programs[name, kind] = file
    return programs


def local(file, library, *lines):
    environment = os.environ | {"LD_LIBRARY_PATH": str(library)}
    result = subprocess.run([file, "local", *lines], env=environment, text=True, capture_output=True)
    if result.returncode or result.stdout.split() != ["ok"] * len(lines):
        sys.exit(f"{file.name} with {library.name}, {lines}: {result.stdout}{result.stderr}")
    print(f"{file.name} in one process with the {library.name} library: {', '.join(lines)}")


def connected(number, server, server_library, client, client_library, steps):
    endpoint = f"shm:versions-{os.getpid()}-{number}"
    owner = Program(server, server_library, "serve", endpoint)
    editor = Program(client, client_library, "connect", endpoint)
    for who, *lines in steps:
        (owner if who == "owner" else editor).do(*lines)
    editor.end()
    owner.end()
    print(f"{client.name} with the {client_library.name} library at a server of the {server_library.name} one: "
          f"{sum(len(step) - 1 for step in steps)} steps")


# An editor that knows less than owner and server edits objects that have the last field set.
EDITS = [("owner", "set_kept"), ("editor", "take_all_lists", "edit_kept", "edit_hold"), ("owner", "both_stay"),
         ("editor", "edit_in_group"), ("owner", "both_stay"), ("editor", "set_plain"), ("owner", "give_last_field"),
         ("editor", "change_plain"), ("owner", "last_field_stays"), ("editor", "set_plain"), ("owner", "last_field_is_gone"),
         ("owner", "take_all_lists")]
# A server that knows less than its client.
OLD_SERVER = [("owner", "set_plain", "take_all_lists"), ("editor", "take_all_lists", "server_refuses_last_field")]
SAME = [("owner", "set_kept"), ("editor", "take_all_lists", "set_plain"), ("owner", "take_all_lists")]


def run(compiler, folder, *libraries):
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    places = {}
    for name, library in zip(["present", "older", "later"], libraries):
        (folder / name).mkdir()
        (folder / name / "libforceserver.so").symlink_to(library)
        (folder / name / "libforceserver.so.1").symlink_to(library)
        places[name] = folder / name
    programs = build(compiler, folder, places["present"])
    for kind in ["linked", "dlopen"]:
        less, today, more = (programs[name, kind] for name in ["less", "today", "more"])
        local(less, places["present"], "smaller_ones_are_refused")
        local(less, places["older"], "take_all_structs")
        local(less, places["later"], "take_all_structs")
        local(today, places["present"], "take_all_structs", "last_field_is_kept")
        local(today, places["older"], "take_all_structs", "last_field_is_refused")
        local(today, places["later"], "take_all_structs", "last_field_is_kept")
        local(more, places["present"], "take_all_structs", "last_field_is_kept")
        local(more, places["older"], "take_all_structs", "last_field_is_refused")
    less, today, more = (programs[name, "linked"] for name in ["less", "today", "more"])
    connected(1, today, places["later"], less, places["later"], EDITS)
    connected(2, today, places["later"], less, places["older"], EDITS)
    connected(3, today, places["later"], today, places["older"], EDITS)
    connected(4, less, places["older"], today, places["later"], OLD_SERVER)
    connected(5, less, places["older"], more, places["later"], OLD_SERVER)
    connected(6, today, places["present"], more, places["present"], SAME)
    connected(7, today, places["present"], programs["more", "dlopen"], places["present"], SAME)
    connected(8, today, places["later"], programs["less", "dlopen"], places["older"], EDITS)


if __name__ == "__main__":
    command, *arguments = sys.argv[1:]
    if command == "headers":
        headers(pathlib.Path(arguments[0]), int(arguments[1]))
    elif command == "table":
        table(pathlib.Path(arguments[0]), arguments[1])
    else:
        run(arguments[0], pathlib.Path(arguments[1]), *map(pathlib.Path, arguments[2:]))
