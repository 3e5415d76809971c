"""The installed library can be found by CMake and by pkg-config, and a C and a C++ program built with it run; so do
the programs of the front page and of the page for C programs.

install.py BUILD_FOLDER CMAKE GENERATOR C_COMPILER CXX_COMPILER LIBRARY_FOLDER
"""
import os
import pathlib
import re
import signal
import subprocess
import sys
import tempfile
import time

build, cmake, generator, c, cxx, library_folder = sys.argv[1:7]

PROGRAM = r"""
#include <stdio.h>
#include <forceserver/forceserver.h>
#include <forceserver/driver.h>

int main(void)
{
  fs_scene *scene = NULL;
  fs_tool *tool = NULL;
  fs_object spring = fs_object_init("spring", FS_PRIMITIVE_POINT);
  fs_state hand;
  fs_response response;
  memset(&hand, 0, sizeof hand);
  hand.pose.position.x = 0.01;
  spring.front = fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, 200, 0, 3);
  if (fs_scene_create(&scene) || fs_object_set(scene, &spring) || fs_tool_create(scene, NULL, 0, &tool) ||
      fs_evaluate(tool, &hand, &response)) {
    printf("%s\n", fs_last_error());
    return 1;
  }
  printf("forceserver %s: %g N\n", fs_version(), response.wrench.force.x);
  fs_tool_destroy(tool);
  fs_scene_destroy(scene);
  return response.wrench.force.x < -1.99 && response.wrench.force.x > -2.01 ? 0 : 1;
}
"""
PROJECT = """
cmake_minimum_required(VERSION 3.22)
project(user LANGUAGES C CXX)
find_package(forceserver 0.9 REQUIRED)
add_executable(in_c user.c)
add_executable(in_cpp user.cpp)
target_link_libraries(in_c PRIVATE forceserver::forceserver)
target_link_libraries(in_cpp PRIVATE forceserver::forceserver)
"""
ROOT = pathlib.Path(__file__).parents[2]
FRONT, PAGE = ROOT / "README.md", ROOT / "include/forceserver/README.md"


def block(page, language, begin):
    """The first block of code on a page that is in this language and begins like that."""
    return re.search(rf"\n```{language}\n({begin}.*?)```\n", page.read_text(), re.S)[1]


def run(*command, **options):
    result = subprocess.run([str(part) for part in command], text=True, capture_output=True, **options)
    print(f"$ {' '.join(str(part) for part in command)}\n{result.stdout}{result.stderr}")
    if result.returncode:
        sys.exit(1)
    return result.stdout


with tempfile.TemporaryDirectory() as temporary:
    folder = pathlib.Path(temporary)
    prefix = folder / "prefix"
    run(cmake, "--install", build, "--prefix", prefix)

    user = folder / "user"
    user.mkdir()
    for name, text in [("user.c", PROGRAM), ("user.cpp", PROGRAM), ("CMakeLists.txt", PROJECT)]:
        (user / name).write_text(text)
    run(cmake, "-S", user, "-B", user / "build", "-G", generator, f"-DCMAKE_PREFIX_PATH={prefix}",
        f"-DCMAKE_C_COMPILER={c}", f"-DCMAKE_CXX_COMPILER={cxx}")
    run(cmake, "--build", user / "build")
    for program in ["in_c", "in_cpp"]:
        run(user / "build" / program)

    # Each is built by the page's own CMakeLists.txt, and says where the hand is.
    first = block(PAGE, "c", "#include")
    asking = first.replace("int main", block(PAGE, "c", "static void why") + "\nint main").replace(
        "  fs_servo_stop", "  why(scene, device);\n  fs_servo_stop")
    for name, page, source, count in [("front", FRONT, block(FRONT, "c", "#include"), 1), ("page", PAGE, first, 10),
                                      ("why", PAGE, asking, 11)]:
        hello = folder / name
        hello.mkdir()
        (hello / "hello.c").write_text(source)
        (hello / "CMakeLists.txt").write_text(block(PAGE, "cmake", "cmake_minimum_required"))
        run(cmake, "-S", hello, "-B", hello / "build", "-G", generator, f"-DCMAKE_PREFIX_PATH={prefix}",
            f"-DCMAKE_C_COMPILER={c}")
        run(cmake, "--build", hello / "build")
        lines = run(hello / "build" / "hello").splitlines()
        if name == "why" and lines[-1] == "FIDEL (simulated): ready":
            lines[-1] = "the hand is at"
        if len(lines) != count or not all("the hand is at" in line for line in lines):
            print(f"the first program of {page} prints something else")
            sys.exit(1)
    for number in [signal.SIGINT, signal.SIGTERM, signal.SIGHUP]:  # it ends early, and in its own way
        ended = subprocess.Popen([folder / "page/build/hello"], stdout=subprocess.PIPE)
        time.sleep(0.5)
        ended.send_signal(number)
        lines = ended.communicate(timeout=60)[0].splitlines()
        if ended.returncode != 0 or len(lines) >= 10:
            print(f"the first program of {PAGE} ends with {ended.returncode} at signal {number}, after {len(lines)} lines")
            sys.exit(1)

    libraries = prefix / library_folder
    environment = dict(os.environ, PKG_CONFIG_PATH=str(libraries / "pkgconfig"), LD_LIBRARY_PATH=str(libraries))
    flags = run("pkg-config", "--cflags", "--libs", "forceserver", env=environment).split()
    for compiler, source in [([c, "-std=c99"], "user.c"), ([cxx, "-std=c++20"], "user.cpp")]:
        run(*compiler, user / source, *flags, "-o", user / "by_pkg_config")
        run(user / "by_pkg_config", env=environment)
