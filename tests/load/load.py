"""The library can be loaded while a program runs, as plug-ins and foreign runtimes do, and a force is felt there.

load.py tls LIBRARY                       its thread-local memory is small enough for any process
load.py c LIBRARY INCLUDE C_COMPILER      a C program that only opens it
load.py python LIBRARY                    Python, through ctypes
load.py java LIBRARY INCLUDE C_COMPILER   Java, through System.load; 77 (skipped) without a JDK

Python and Java also check the locked memory: a servo locks what its ticks use, and unlocks it afterwards.
"""
import ctypes
import os
import pathlib
import shutil
import struct
import subprocess
import sys
import tempfile
import time

SKIPPED = 77
MOST_TLS = 512  # bytes; the loader keeps about 1.6 kB for all libraries that come at run time

SCENE = """{"forceserver": "scene", "version": 1, "objects": [{"name": "wall", "primitive": "plane",
  "back": {"kind": "linear_increasing", "sense": "attractive", "gain": 500, "limit": 10}}]}"""


def locked():
    """kB of this process that are locked in memory."""
    for line in pathlib.Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmLck:"):
            return int(line.split()[1])
    return 0


def tell_locked(before, during, after):
    print(f"locked memory: {before} kB before, {during} kB while the servo runs, {after} kB after")
    return before == after


def run(*command, **options):
    result = subprocess.run([str(part) for part in command], text=True, capture_output=True, **options)
    print(f"$ {' '.join(str(part) for part in command)}\n{result.stdout}{result.stderr}")
    return result.returncode == 0


def tls(library):
    """The size of the segment PT_TLS (7), and the flag DF_STATIC_TLS (0x10) of the entry DT_FLAGS (30)."""
    data = pathlib.Path(library).read_bytes()
    if data[:6] != b"\x7fELF\x02\x01":
        print("not a little-endian ELF file of 64 bits: not looked at")
        return SKIPPED
    table, = struct.unpack_from("<Q", data, 32)
    size, count = struct.unpack_from("<HH", data, 54)
    bytes_of_thread, is_static = 0, False
    for i in range(count):
        kind, _, offset, _, _, in_file, in_memory, _ = struct.unpack_from("<IIQQQQQQ", data, table + i * size)
        if kind == 7:
            bytes_of_thread = in_memory
        if kind == 2:
            entries = struct.iter_unpack("<qQ", data[offset:offset + in_file])
            is_static = any(tag == 30 and value & 0x10 for tag, value in entries)
    print(f"{bytes_of_thread} bytes for each thread, {'' if is_static else 'not '}in the static block")
    return bytes_of_thread > MOST_TLS


def in_c(library, include, compiler):
    source = pathlib.Path(__file__).with_name("dlopen.c")
    with tempfile.TemporaryDirectory() as folder:
        program = pathlib.Path(folder) / "program"
        return not (run(compiler, "-std=gnu99", "-Wall", "-Wextra", f"-I{include}", source, "-o", program, "-ldl", "-lm")
                    and run(program, library))


def in_python(library):
    fs = ctypes.CDLL(library)
    fs.fs_last_error.restype = ctypes.c_char_p

    def check(status):
        if status < 0:
            sys.exit(fs.fs_last_error().decode())

    scene, device, servo = ctypes.c_void_p(), ctypes.c_void_p(), ctypes.c_void_p()
    sent = (ctypes.c_double * 6)()  # fs_wrench: force and torque
    before = locked()
    with tempfile.NamedTemporaryFile("w", suffix=".json") as file:
        file.write(SCENE)
        file.flush()
        check(fs.fs_scene_create(ctypes.byref(scene)))
        check(fs.fs_scene_load(scene, file.name.encode()))
    check(fs.fs_device_open(b"sim:?hold=0,0,-0.02", ctypes.byref(device)))
    check(fs.fs_servo_start(scene, device, None, ctypes.byref(servo)))
    end = time.monotonic() + 60
    while not sent[2] > 1 and time.monotonic() < end:
        time.sleep(0.01)
        fs.fs_servo_set_enabled(servo, ctypes.c_bool(True))  # a machine that is too slow stops the force
        fs.fs_scene_get_hand(scene, None, None, ctypes.byref(sent))
    during = locked()
    fs.fs_servo_stop(servo)
    fs.fs_device_close(device)
    fs.fs_scene_destroy(scene)
    print(f"{sent[2]:.2f} N")
    return not (tell_locked(before, during, locked()) and sent[2] > 1)


JAVA = r"""
import java.nio.file.*;

public class Felt {
  static native long start(String scene);
  static native double force(long servo);
  static native void stop(long servo);

  static long locked() throws Exception {
    for (String line : Files.readAllLines(Paths.get("/proc/self/status"))) {
      if (line.startsWith("VmLck:")) return Long.parseLong(line.replaceAll("[^0-9]", ""));
    }
    return 0;
  }

  public static void main(String[] arguments) throws Exception {
    System.load(arguments[0]);  // the library, then what makes its functions Java's
    System.load(arguments[1]);
    long before = locked();
    long servo = start(arguments[2]);
    double newtons = 0;
    for (int i = 0; i < 6000 && !(newtons > 1); ++i) {
      Thread.sleep(10);
      byte[][] garbage = new byte[64][4096];  // the collector has something to do
      newtons = force(servo);
    }
    System.gc();
    long during = locked();
    stop(servo);
    System.out.printf("%.2f N%n%d %d %d%n", newtons, before, during, locked());
    System.exit(newtons > 1 ? 0 : 1);
  }
}
"""
SHIM = r"""
#include <jni.h>
#include <stdlib.h>
#include <forceserver/forceserver.h>

struct all {
  fs_scene *scene;
  fs_device *device;
  fs_servo *servo;
};

JNIEXPORT jlong JNICALL Java_Felt_start(JNIEnv *env, jclass type, jstring path)
{
  struct all *all = calloc(1, sizeof *all);
  const char *text = (*env)->GetStringUTFChars(env, path, NULL);
  (void)type;
  if (fs_scene_create(&all->scene) || fs_scene_load(all->scene, text) ||
      fs_device_open("sim:?hold=0,0,-0.02", &all->device) ||
      fs_servo_start(all->scene, all->device, NULL, &all->servo)) {
    (*env)->FatalError(env, fs_last_error());
  }
  (*env)->ReleaseStringUTFChars(env, path, text);
  return (jlong)(size_t)all;
}

JNIEXPORT jdouble JNICALL Java_Felt_force(JNIEnv *env, jclass type, jlong handle)
{
  struct all *all = (struct all *)(size_t)handle;
  fs_wrench sent = {{0, 0, 0}, {0, 0, 0}};
  (void)env, (void)type;
  fs_servo_set_enabled(all->servo, true);
  fs_scene_get_hand(all->scene, NULL, NULL, &sent);
  return sent.force.z;
}

JNIEXPORT void JNICALL Java_Felt_stop(JNIEnv *env, jclass type, jlong handle)
{
  struct all *all = (struct all *)(size_t)handle;
  (void)env, (void)type;
  fs_servo_stop(all->servo);
  fs_device_close(all->device);
  fs_scene_destroy(all->scene);
  free(all);
}
"""


def java_home():
    """Of the JDK on the PATH, or of JAVA_HOME; None: no compiler or no jni.h."""
    compiler = shutil.which("javac")
    homes = [os.environ.get("JAVA_HOME"), pathlib.Path(compiler).resolve().parent.parent if compiler else None]
    for home in homes:
        if home and (pathlib.Path(home) / "bin/javac").exists() and (pathlib.Path(home) / "include/jni.h").exists():
            return pathlib.Path(home)
    return None


def in_java(library, include, compiler):
    home = java_home()
    if not home:
        print("there is no JDK (javac and jni.h): not tried")
        return SKIPPED
    with tempfile.TemporaryDirectory() as temporary:
        folder = pathlib.Path(temporary)
        (folder / "Felt.java").write_text(JAVA)
        (folder / "shim.c").write_text(SHIM)
        (folder / "scene.json").write_text(SCENE)
        shim = folder / "libshim.so"
        if not (run(home / "bin/javac", "-d", folder, folder / "Felt.java") and
                run(compiler, "-shared", "-fPIC", f"-I{include}", f"-I{home}/include", f"-I{home}/include/linux",
                    folder / "shim.c", library, f"-Wl,-rpath,{pathlib.Path(library).parent}", "-o", shim)):
            return 1
        result = subprocess.run([home / "bin/java", "-Xmx64m", "-cp", folder, "Felt", library, shim,
                                 folder / "scene.json"], text=True, capture_output=True)
        print(result.stdout, result.stderr)
        if result.returncode:
            return 1
        return not tell_locked(*(int(word) for word in result.stdout.split()[-3:]))


if __name__ == "__main__":
    sys.exit({"tls": tls, "c": in_c, "python": in_python, "java": in_java}[sys.argv[1]](*sys.argv[2:]))
