"""Every piece of code on every page (*.md) and in the comments of the headers is compiled or run by a test: by this one, or by
one that is named here. A piece that nobody checks is a failure.

- c, cpp: a whole program is compiled, linked and run; what is no whole program is compiled, and run where it makes its own
  scene. Programs of other libraries, "not tried here", are only counted.
- json: `forceserver check` takes a scene; anything else must be JSON.
- sh, and commands that are indented: bash takes them; the programs of this project are called by commands and options that
  they have, and scripts and files of the repository are there.
- python, java, cmake: the tests named below run them.
- Indented text that begins with none of the commands below is taken for a picture or output, and only counted, unless two of its
  lines end with a semicolon or one begins with "$ ".

snippets.py ROOT BUILD_FOLDER C_COMPILER CXX_COMPILER
"""
import collections
import functools
import json
import pathlib
import re
import shlex
import subprocess
import sys
import tempfile
import textwrap

root, build = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
c, cxx = sys.argv[3:5]
sys.path.insert(0, str(root / "bindings/description"))
import comments
from pages import pages

INCLUDE = root / "include"
PROGRAMS = {"forceserver": "lib/program/forceserver", "forceserver-bridge": "bindings/dds/forceserver-bridge",
            "fidel-controller": "device/fidel-controller"}

# Who runs the pieces in Python, Java and CMake: the test, and what it says of the page.
ELSEWHERE = {
    ("README.md", "python"): ("tests/bindings/python/test_package.py", '"README.md"'),
    ("bindings/python/README.md", "python"): ("tests/bindings/python/test_package.py", '"bindings/python/README.md"'),
    ("examples/recipes/README.md", "python"): ("tests/bindings/python/test_package.py", "python_lines(page) == [recipe.read_text()]"),
    ("examples/recipes/README.md", "c"): ("tests/examples/recipes.py", "README.md"),
    ("examples/testbed/virtualrobot/README.md", "python"): ("tests/examples/testbed/test_live.py", '"virtualrobot" / "README.md"'),
    ("bindings/java/README.md", "java"): ("tests/bindings/run_java", "bindings/java/README.md"),
    ("include/forceserver/README.md", "cmake"): ("tests/abi/install.py", 'block(PAGE, "cmake", "cmake_minimum_required")'),
}

# What is there before a piece of C that is no whole program.
BEFORE = """#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>
#include <forceserver/forceserver.h>
#include <forceserver/driver.h>
"""
CHECK = """static void check(fs_status status)
{
  if (status >= 0) return;
  fprintf(stderr, "%s\\n", fs_last_error());
  exit(1);
}
"""
HANDLES = """  fs_scene *scene = NULL; fs_device *device = NULL; fs_servo *servo = NULL; fs_server *server = NULL;
  fs_object scout = fs_object_init("scout", FS_PRIMITIVE_POINT); uint32_t faults = 0;
  (void)scene; (void)device; (void)servo; (void)server; (void)scout; (void)faults;
"""
counts, failures = collections.Counter(), 0


def fail(where, sentence):
    global failures
    failures += 1
    print(f"FAILED: {where}: {sentence}")


def run(where, *command, **options):
    try:
        done = subprocess.run([str(part) for part in command], text=True, capture_output=True, timeout=120, **options)
    except subprocess.TimeoutExpired:
        return fail(where, f"{command[0]} does not end")
    if done.returncode:
        fail(where, f"{pathlib.Path(command[0]).name} ended with {done.returncode}: {done.stdout}{done.stderr}")
    return done.stdout


def pieces(page):
    """The code of a page: the number of its first line, its language ("indented" without a fence), its text and the line before."""
    fence, lines, first, before = None, [], 0, ""
    in_list = after_blank = False
    for number, line in enumerate([*page.read_text().splitlines(), "end"], 1):
        mark = re.match(r"( *)(`{3,}|~{3,})\s*(\S*)", line)
        if fence:
            if line.strip() == fence:
                yield first, language, textwrap.dedent("\n".join(lines)), before
                fence, lines = None, []
            else:
                lines.append(line)
            continue
        if line.strip() and line.startswith(" " * (6 if in_list else 4)) and not mark and (lines or after_blank):
            first = first if lines else number
            lines.append(line)
        elif lines and not line.strip():
            lines.append("")
        else:
            if lines:
                yield first, "indented", textwrap.dedent("\n".join(lines)).strip("\n"), before
                lines = []
            if mark:
                fence, language, first = mark[2], mark[3], number
            elif line.strip():
                in_list = bool(re.match(r" *([-*]|\d+\.) ", line)) or in_list and (line.startswith(" ") or not after_blank)
                before = line
        after_blank = not line.strip()
    if fence:
        fail(page, "a fence is not closed")


def compile_c(where, text, is_whole, folder, language="c"):
    """Compiles a piece of C or C++; runs it if it is a program, or makes its own scene."""
    source, program = folder / f"piece.{language}", folder / "piece"
    functions = re.search(r"(?m)^(static |int |void )[^;=]*\)\s*\{?$", text)
    runs = is_whole or "fs_scene_create(&scene)" in text
    if is_whole:
        pass
    elif functions:
        text = BEFORE + ("" if "void check(" in text else CHECK) + text + "\nint main(void) { return 0; }\n"
        text = text.replace("static ", "__attribute__((unused)) static ")
    else:
        spring = 'fs_object spring = fs_object_init("spring", FS_PRIMITIVE_POINT); (void)spring;\n'
        spring = "" if "fs_object spring" in text else spring
        charge = "double battery_charge(void); double battery_charge(void) { return 1; }\n" if "battery_charge" in text else ""
        text = f"{BEFORE}{CHECK}{charge}int main(void)\n{{\n{HANDLES}  {spring}  {{\n{text}\n  }}\n  return 0;\n}}\n".replace(
            "static void check", "__attribute__((unused)) static void check")
    source.write_text(text)
    compiler = [c, "-std=gnu99"] if language == "c" else [cxx, "-std=c++20"]
    flags = ["-Wall", "-Wextra", "-Werror", f"-I{INCLUDE}", f"-L{build}", "-lforceserver", "-lm", f"-Wl,-rpath,{build}"]
    run(where, *compiler, source, *flags, "-o", program, cwd=folder)
    if runs and program.exists():
        run(where, program, cwd=folder)
    counts[f"{language}: compiled{' and run' if runs else ''}"] += 1
    program.unlink(missing_ok=True)


@functools.cache
def options_of(name, command=()):
    """The commands and options that a program has."""
    help_ = subprocess.run([build / PROGRAMS[name], *command, "--help"], text=True, capture_output=True).stdout
    commands = set()
    if not command and "Each command has its own help" in help_:
        offered = subprocess.run([build / PROGRAMS[name], "--complete", ""], text=True, capture_output=True).stdout
        commands = {line.split("\t")[0] for line in offered.splitlines()}
        if not commands:
            fail(name, "it offers no commands")
    options = set(re.findall(r"(?<![\w-])(--?[a-z][\w-]*)", help_))
    return options, commands


PREFIX = re.compile(r"\w+=.*|sudo|env|time|timeout|setarch|-[a-zA-Z]|\d+")  # what may stand before a command
FOLDERS = ("bindings/", "device/", "examples/", "include/", "lib/", "tests/", ".ci/")


def check_command(where, words):
    """A command line: what this project has of it must be there."""
    while words and PREFIX.fullmatch(words[0]):
        words = words[1:]
    if re.match(r"(\S*/)?python3?$", words[0] if words else ""):
        words = words[2:] if words[1:2] == ["-m"] else words[1:]
    if not words:
        return
    name = pathlib.Path(words[0]).name
    if name in PROGRAMS:
        check_call(where, name, words[1:])
    elif words[0].startswith(FOLDERS) and not re.search(r"[A-Z*$<]{2}|[*$<]", words[0]):
        counts["commands that are scripts of the repository"] += 1
        script = root / words[0]
        if not script.exists():
            return fail(where, f"there is no {words[0]}")
        text = script.read_text(errors="replace") if script.is_file() else ""
        for word in words[1:]:
            is_option = text.startswith("#!") and '"$@"' not in text and re.fullmatch(r"--[a-z][\w-]*(=.*)?", word)
            if is_option and word.partition("=")[0] not in text:
                fail(where, f"{words[0]} has no option {word}")


def check_call(where, name, words):
    """The command and the options of a program of this project."""
    if not (build / PROGRAMS[name]).exists():
        return
    counts["commands of the programs"] += 1
    options, commands = options_of(name)
    if commands and words and not words[0].startswith("-"):
        if words[0] not in commands:
            return fail(where, f"{name} has no command {words[0]}")
        options = options | options_of(name, (words[0],))[0]
    for word in words:
        if re.match(r"--?[a-z]", word) and word.partition("=")[0] not in options:
            fail(where, f"{name} has no option {word} here")


def check_shell(where, text):
    done = subprocess.run(["bash", "-n"], input=text, text=True, capture_output=True)
    if done.returncode:
        fail(where, f"bash does not take it: {done.stderr}")
    counts["sh: blocks that bash takes"] += 1
    text = re.sub(r"(?ms)<< *'?(\w+)'?(.*?)^\1$", r"\2", text)  # without here-documents
    text = re.sub(r"\\\n", " ", text)
    for line in text.splitlines():
        for part in re.split(r"\s(?:\|\||&&|\||;)\s|&$|;$", re.sub(r"\s#.*$|^#.*$", "", line)):
            try:
                words = shlex.split(part)
            except ValueError:
                continue
            check_command(where, words)


COMMAND = re.compile(r"(\w+\$ +)?(sudo |time )?(\.?\./)*((build|examples|tests|bindings|device)/[\w./-]+|\./[\w./-]+|"
                     r"forceserver(-\w+)?|fidel-controller|cmake|ninja|pip|python3?|mvn|javac?|cd|export|cc|echo|cyclonedds|ros2|for|cat|apt-get|systemctl|ulimit|PATH=\S+)( |$)")
SHELL = ("sh", "bash", "shell")
with tempfile.TemporaryDirectory() as temporary:
    folder = pathlib.Path(temporary)
    (folder / "part.ply").write_text("ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
                                     "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n0.1 0 0\n0 0.1 0\n3 0 1 2\n")

    def check_json(where, text):
        try:
            document = json.loads(text)
        except json.JSONDecodeError as error:
            return fail(where, f"it is not JSON: {error}")
        counts["json"] += 1
        if isinstance(document, dict) and document.get("forceserver") == "scene" and (build / PROGRAMS["forceserver"]).exists():
            (folder / "scene.json").write_text(text)
            done = subprocess.run([build / PROGRAMS["forceserver"], "check", folder / "scene.json"], text=True, capture_output=True)
            if done.returncode > 1:
                fail(where, done.stdout + done.stderr)

    for page in pages(root):
        name = str(page.relative_to(root))
        for number, language, text, before in pieces(page):
            where = f"{name}:{number}"
            scene = re.search(r"(?ms)<< 'END'\n(\{.*?)^ *END$", text)
            if scene:
                check_json(where, scene[1])
            if (name, language) in ELSEWHERE:
                test, said = ELSEWHERE[name, language]
                if said not in (root / test).read_text():
                    fail(where, f"{test} no longer runs it")
                counts[f"{language}: {test}"] += 1
                if language == "python":
                    compile(text, where, "exec")
            elif language in ("c", "cpp"):
                if "not tried here" in before and language == "cpp":
                    counts["of other libraries, not tried"] += 1
                else:
                    compile_c(where, text, "int main(" in text, folder, language)
            elif language == "json":
                check_json(where, text)
            elif language == "console":  # a command behind "$ ", and what it prints
                check_shell(where, "\n".join(re.findall(r"(?m)^\w*\$ +(.*)$", text)))
            elif language in SHELL or language == "" and not re.match(r"[{<]", text):
                check_shell(where, text)
            elif language == "indented":
                lines = [line for line in text.splitlines() if line.strip()]
                if lines and COMMAND.match(lines[0]):
                    check_shell(where, re.sub(r"(?m)^\w+\$ +", "", text))
                elif re.match(r"fs\.", text):
                    compile(text, where, "exec")
                    counts["python: compiled"] += 1
                elif text.lstrip().startswith("{") and text.rstrip().endswith("}"):
                    check_json(where, text)
                elif re.search(r"(?ms);$.*;$|^\$ ", text):
                    fail(where, "nobody checks this code")
                else:
                    counts["pictures, output and formulas"] += 1
            elif language in ("text", "{toctree}", "{eval-rst}"):
                counts["pictures, output and formulas" if language == "text" else "of the site"] += 1
            else:
                fail(where, f"nobody checks code in the language '{language}'")

    # The comments of the headers: what is indented and has statements or JSON. Remarks stand behind a statement.
    for header in sorted((INCLUDE / "forceserver").glob("*.h")):
        text_of = header.read_text()
        for start, _, comment in comments.of_header(header):
            where = f"{header.relative_to(root)}:{text_of.count(chr(10), 0, start) + 1}"
            for kind, *said in comments.blocks(comment):
                if kind != "code":
                    continue
                if said[0].startswith("{"):
                    check_json(where, said[0])
                elif ";" in said[0] and re.search(r"\bfs_\w+\(", said[0]):
                    code = re.sub(r"(?m);[^;\n]*$", ";", said[0])  # without the remarks
                    compile_c(where, code, False, folder)
                    counts["in headers"] += 1
                else:
                    counts["pictures and tables in headers"] += 1

for kind, count in sorted(counts.items()):
    print(f"{count:4d} {kind}")
for kind in ("c: compiled", "c: compiled and run", "json", "commands of the programs", "in headers"):
    if not counts[kind]:
        fail("snippets.py", f"it found none of: {kind}")
if counts["cmake: tests/abi/install.py"] != 1:
    fail("snippets.py", "tests/abi/install.py takes one block of CMake only")
print(f"{failures} failures")
sys.exit(failures > 0)
