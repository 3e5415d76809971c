"""Writes struct_sizes.cpp beside this file from the description of the public headers: the sizes of the structs that grow.

make_struct_sizes.py          writes struct_sizes.cpp
make_struct_sizes.py --check  only says whether it would be the same
"""
import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "bindings/description"))
import description


def text(structs):
    """structs: (name, first size, known size, size) of each. Tests write tables of their own, where less is known."""
    lines = "\n".join(f"SIZES({', '.join(map(str, struct))})" for struct in structs)
    return f"""// Written by make_struct_sizes.py from the description of the public headers.
#include <forceserver/driver.h>
#include <forceserver/server.h>

#include "base/grown.h"

namespace fs {{

#define SIZES(type, first, known, size)                                                   \\
  static_assert((first) <= (known) && (known) <= (size) && (size) == sizeof(type), #type); \\
  template <>                                                                             \\
  const StructSizes& sizes_of<type>() noexcept {{                                          \\
    static constexpr StructSizes sizes{{#type, first, known}};                              \\
    return sizes;                                                                         \\
  }}

{lines}

}}  // namespace fs
"""


def main():
    target = pathlib.Path(__file__).with_name("struct_sizes.cpp")
    growing = [(s["name"], s["first_size"], s["size"], s["size"]) for s in description.load()["structs"] if s["growing"]]
    if sys.argv[1:] == ["--check"]:
        if not target.exists() or target.read_text() != text(growing):
            sys.exit("lib/base/struct_sizes.cpp is not what the headers say: run bindings/description/make")
    else:
        target.write_text(text(growing))


if __name__ == "__main__":
    main()
