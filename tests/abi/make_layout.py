"""The binary interface as a list of assertions: size of every struct, place of every field, value of every enum.

make_layout.py INCLUDE_FOLDER C_COMPILER          writes layout.c beside this file
make_layout.py INCLUDE_FOLDER C_COMPILER --check  only says whether it would be the same

A difference is right only where the contract lets the interface grow: new fields at the end of a growing struct, new
values, new structs. Every line that was in layout.c before must remain, except the size of a struct that grew.
"""
import pathlib
import re
import subprocess
import sys
import tempfile

from public_headers import headers, without_comments

include, compiler = sys.argv[1:3]
target = pathlib.Path(__file__).with_name("layout.c")


def fields(body):
    """The names of a struct's fields, in their order."""
    depth, declaration, declarations = 0, "", []
    for character in body:
        depth += {"(": 1, ")": -1}.get(character, 0)
        if character == ";" and depth == 0:
            declarations.append(declaration)
            declaration = ""
        else:
            declaration += character
    for declaration in declarations:
        pointer = re.search(r"\(\s*\*\s*(\w+)\s*\)\s*\(", declaration)
        if pointer:
            yield pointer[1]
            continue
        for declarator in declaration.split(","):
            yield re.search(r"(\w+)\s*(\[[^]]*\]\s*)*$", declarator.strip())[1]


structs, values = [], []
for header in headers(include):
    text = without_comments(header.read_text())
    for match in re.finditer(r"typedef struct (\w+) \{(.*?)\}\s*\1;", text, flags=re.S):
        structs.append((match[1], list(fields(match[2]))))
    for match in re.finditer(r"\benum\b\s*\w*\s*\{(.*?)\}", text, flags=re.S):
        values += re.findall(r"\b(FS_\w+)\s*=", match[1])
values += ["FS_VERSION_MAJOR", "FS_VERSION_MINOR", "FS_VERSION_PATCH", "FS_NAME_SIZE", "FS_TOOL_POINTS_MAX"]
assert len(structs) > 10 and len(values) > 50, "the headers were not understood"

includes = "#include <stddef.h>\n#include <stdint.h>\n" + "".join(
    f"#include <forceserver/{name}.h>\n" for name in ["forceserver", "driver"])
probe = includes + "#include <stdio.h>\nint main(void)\n{\n"
for name, members in structs:
    probe += f'  printf("STRUCT({name}, %zu);\\n", sizeof({name}));\n'
    for field in members:
        probe += (f'  printf("FIELD({name}, {field}, %zu, %zu);\\n", offsetof({name}, {field}), '
                  f"sizeof((({name} *)0)->{field}));\n")
for name in values:
    probe += f'  printf("VALUE({name}, %lld);\\n", (long long)({name}));\n'
probe += "  return 0;\n}\n"

with tempfile.TemporaryDirectory() as folder:
    program = pathlib.Path(folder, "probe")
    command = [compiler, "-std=c11", f"-I{include}", "-xc", "-", "-o", program]
    subprocess.run(command, input=probe, text=True, check=True)
    asserts = subprocess.run([program], text=True, capture_output=True, check=True).stdout

layout = f"""/* The binary interface on 64-bit machines, made by make_layout.py from the headers and kept: what compiles
 * here is the interface that programs were built with. */
{includes}
#define STRUCT(type, size) _Static_assert(sizeof(type) == (size), #type)
#define FIELD(type, field, offset, size) \\
  _Static_assert(offsetof(type, field) == (offset) && sizeof(((type *)0)->field) == (size), #type "." #field)
#define VALUE(name, value) _Static_assert((name) == (value), #name)

#if UINTPTR_MAX == UINT64_MAX
{asserts}#endif
"""
if len(sys.argv) > 3 and sys.argv[3] == "--check":
    kept = target.read_text().splitlines()
    for line in sorted(set(kept) - set(layout.splitlines())):
        print(f"kept, but not so in the headers: {line}")
    for line in sorted(set(layout.splitlines()) - set(kept)):
        print(f"in the headers, but not kept: {line}")
    sys.exit(target.read_text() != layout)
target.write_text(layout)
