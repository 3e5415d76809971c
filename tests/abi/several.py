"""Libraries of two SONAMEs live in one process, and a program that needs more than is installed ends at its start.

several.py map FILE             writes lib/libforceserver.map as of a library with another SONAME
several.py run C_COMPILER FOLDER LIBRARY SECOND
                                SECOND: today's library again, with the SONAME libforceserver.so.2 and that map
"""
import os
import pathlib
import shutil
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]


def write_map(file):
    file.write_text((ROOT / "lib/libforceserver.map").read_text().replace("FORCESERVER_1", "FORCESERVER_2"))


def compile_(compiler, *arguments):
    subprocess.run([compiler, "-std=gnu99", "-Wall", "-Wextra", "-Werror", f"-I{ROOT / 'include'}", *arguments], check=True)


def start(*command, library):
    return subprocess.run(command, env=os.environ | {"LD_LIBRARY_PATH": str(library)}, text=True, capture_output=True, timeout=60)


def program_and_plugin(compiler, folder, first, second):
    source = ROOT / "tests/abi/several.c"
    compile_(compiler, source, "-o", folder / "program", f"-L{first}", "-lforceserver", "-ldl", f"-Wl,-rpath-link,{first}")
    compile_(compiler, "-DPLUGIN", "-fPIC", "-shared", "-fvisibility=hidden", source, "-o", folder / "plugin.so", f"-L{second}",
             "-lforceserver", "-ldl", f"-Wl,-rpath,{second}")
    result = start(folder / "program", folder / "plugin.so", str(os.getpid()), library=first)
    wanted = ["libforceserver.so.1 -1 200", "libforceserver.so.2 -2 100"]
    if result.returncode or result.stdout.splitlines() != wanted:
        print(f"a program and a plug-in with libraries of two SONAMEs: {result.returncode}: {result.stdout}{result.stderr}")
        return 1
    print("; ".join(wanted))
    return 0


def program_that_needs_more(compiler, folder, library):
    """What it is linked with has a function more than the library that is installed."""
    later = folder / "later"
    later.mkdir()
    (folder / "later.c").write_text("const char *fs_version(void) { return 0; }\nint fs_added(void) { return 0; }\n")
    (folder / "later.map").write_text("FORCESERVER_1 { global: fs_version; local: *; };\nFORCESERVER_1.1 { global: fs_added; } FORCESERVER_1;\n")
    compile_(compiler, "-shared", "-fPIC", folder / "later.c", "-o", later / "libforceserver.so", "-Wl,-soname,libforceserver.so.1",
             f"-Wl,--version-script={folder / 'later.map'}")
    (folder / "needs_more.c").write_text("#include <stdio.h>\n#include <forceserver/forceserver.h>\nint fs_added(void);\nint main(int count, char **v)\n"
                                         "{ (void)v; puts(fs_version()); return count > 9 ? fs_added() : 0; }\n")
    compile_(compiler, folder / "needs_more.c", "-o", folder / "needs_more", f"-L{later}", "-lforceserver")
    result = start(folder / "needs_more", library=library)
    if result.returncode == 0 or result.stdout or "version `FORCESERVER_1.1' not found" not in result.stderr:
        print(f"a program that needs more: {result.returncode}: {result.stdout}{result.stderr}")
        return 1
    print(result.stderr.strip())
    return 0


def run(compiler, folder, library, second):
    folder = pathlib.Path(folder)
    shutil.rmtree(folder, ignore_errors=True)
    for name, file, soname in [("first", library, "libforceserver.so.1"), ("second", second, "libforceserver.so.2")]:
        (folder / name).mkdir(parents=True)
        (folder / name / "libforceserver.so").symlink_to(file)
        (folder / name / soname).symlink_to(file)
    return program_and_plugin(compiler, folder, folder / "first", folder / "second") + program_that_needs_more(compiler, folder, folder / "first")


if __name__ == "__main__":
    if sys.argv[1] == "map":
        write_map(pathlib.Path(sys.argv[2]))
    else:
        sys.exit(run(*sys.argv[2:]))
