"""The driver of examples/woodenhaptics is built and installed by its own project against an installed forceserver, which then
finds it as a module.

woodenhaptics.py BUILD_FOLDER CMAKE GENERATOR C_COMPILER LIBRARY_FOLDER TEST_PROGRAM
"""
import os
import pathlib
import subprocess
import sys
import tempfile

build, cmake, generator, c, library_folder, test = sys.argv[1:7]
SOURCE = pathlib.Path(__file__).parents[2] / "examples/woodenhaptics"


def run(*command, **options):
    result = subprocess.run([str(part) for part in command], text=True, capture_output=True, **options)
    print(f"$ {' '.join(str(part) for part in command)}\n{result.stdout}{result.stderr}")
    if result.returncode:
        sys.exit(1)
    return result.stdout


def expect(holds, sentence):
    if not holds:
        print(f"FAILED: {sentence}")
        sys.exit(1)


with tempfile.TemporaryDirectory() as temporary:
    folder = pathlib.Path(temporary).resolve()
    prefix = folder / "prefix"
    run(cmake, "--install", build, "--prefix", prefix)
    program, libraries = prefix / "bin/forceserver", prefix / library_folder
    module = libraries / "forceserver/drivers-1/woodenhaptics.so"
    expect(not module.exists(), "the example is installed only by its own project")
    expect("woodenhaptics" not in run(program, "devices", "--why"), "nobody knows the scheme yet")

    run(cmake, "-S", SOURCE, "-B", folder / "build", "-G", generator, f"-DCMAKE_PREFIX_PATH={prefix}", f"-DCMAKE_C_COMPILER={c}",
        "-DCMAKE_C_FLAGS=-Werror")
    run(cmake, "--build", folder / "build")
    run(cmake, "--install", folder / "build")
    expect(module.is_file(), f"the module is {module}")
    expect(str(module) in run(program, "devices", "--why"), "the program finds the module")

    # The test of the program and one of the library, with the installed ones.
    environment = dict(os.environ, LD_LIBRARY_PATH=str(libraries), WOODENHAPTICS_INSTALLED=str(program))
    for case in ["program", "opening"]:
        page = run(test, env=dict(environment, CK_RUN_CASE=case))
        expect("100%: Checks: 1," in page, "all is well with the installed driver")
        expect(case != "program" or str(module) in page, "it is the module that was tested")
