"""The binary interface as a list of assertions: size of every struct and enum, place of every field, value of every enum.

make_layout.py          writes layout.c beside this file, from the description of the headers
make_layout.py --check  only says whether it would be the same

A difference is right only where the contract lets the interface grow: new fields at the end of a growing struct, new
values, new structs. Whatever stood in layout.c before must stand there still, except for the size of a struct that grew.
"""
import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "bindings/description"))
import description

target = pathlib.Path(__file__).with_name("layout.c")
described = description.load()
asserts = []
for struct in described["structs"]:
    asserts.append(f"STRUCT({struct['name']}, {struct['size']});")
    asserts += [f"FIELD({struct['name']}, {field['name']}, {field['offset']}, {field['size']});" for field in struct["fields"]]
for enum in described["enums"]:
    if enum["name"]:
        asserts.append(f"STRUCT({enum['name']}, 4);")
    asserts += [f"VALUE({value['name']}, {value['value']});" for value in enum["values"]]
asserts += [f"VALUE({constant['name']}, {constant['value']});" for constant in described["constants"]
            if isinstance(constant["value"], int)]

layout = """/* The binary interface on 64-bit machines, made by make_layout.py and kept: what compiles here is the interface that
 * programs were built with. */
#include <stddef.h>
#include <stdint.h>
#include <forceserver/forceserver.h>
#include <forceserver/driver.h>

#define STRUCT(type, size) _Static_assert(sizeof(type) == (size), #type)
#define FIELD(type, field, offset, size) \\
  _Static_assert(offsetof(type, field) == (offset) && sizeof(((type *)0)->field) == (size), #type "." #field)
#define VALUE(name, value) _Static_assert((name) == (value), #name)

#if UINTPTR_MAX == UINT64_MAX
""" + "\n".join(asserts) + "\n#endif\n"

if sys.argv[1:] == ["--check"]:
    kept = target.read_text().splitlines()
    for line in sorted(set(kept) - set(layout.splitlines())):
        print(f"kept, but not so in the headers: {line}")
    for line in sorted(set(layout.splitlines()) - set(kept)):
        print(f"in the headers, but not kept: {line}")
    sys.exit(target.read_text() != layout)
target.write_text(layout)
