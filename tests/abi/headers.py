"""Every public header can be included alone, in C and C++, without a warning; no struct has padding.

headers.py INCLUDE_FOLDER C_COMPILER CXX_COMPILER
"""
import pathlib
import subprocess
import sys

include, c, cxx = sys.argv[1:4]
STRICT = ["-Wall", "-Wextra", "-pedantic", "-Wpadded", "-Werror", f"-I{include}", "-fsyntax-only", "-"]
LANGUAGES = {"C99": [c, "-std=c99", "-xc"], "C11": [c, "-std=c11", "-xc"], "C++17": [cxx, "-std=c++17", "-xc++"],
             "C++20": [cxx, "-std=c++20", "-xc++"]}


def compiles(language, text):
    result = subprocess.run(LANGUAGES[language] + STRICT, input=text, text=True, capture_output=True)
    return result.returncode == 0, result.stderr


failed = False
for language in LANGUAGES:
    for header in sorted(pathlib.Path(include, "forceserver").glob("*.h")):
        # Twice: the second time nothing of it may be left.
        good, errors = compiles(language, f"#include <forceserver/{header.name}>\n" * 2 + "int forceserver_header_test;\n")
        if not good:
            failed = True
            print(f"{header.name} as {language}:\n{errors}")
    if language.startswith("C++"):
        good, errors = compiles(language, '#pragma GCC diagnostic ignored "-Wpadded"\n' + "#include <forceserver/forceserver.hpp>\n" * 2)
        if not good:
            failed = True
            print(f"forceserver.hpp as {language}:\n{errors}")
    # What a generator of bindings sees: a driver can be loaded, not written.
    good, errors = compiles(language, "#define SWIG\n#include <forceserver/driver.h>\n"
                            "fs_status (*forceserver_header_test)(const char *) = fs_driver_load;\n")
    if not good:
        failed = True
        print(f"driver.h for SWIG as {language}:\n{errors}")
    # The test itself can fail: a struct with padding must not pass.
    if compiles(language, "struct s { char a; double b; };\nint forceserver_header_test[sizeof(struct s)];\n")[0]:
        failed = True
        print(f"{language}: a struct with padding was not seen")
sys.exit(failed)
