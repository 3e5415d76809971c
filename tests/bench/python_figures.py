"""python_figures.py PEER ROOT: the rows of the table in README.md; tests/bench/python runs it."""

import ctypes
import os
import pathlib
import statistics
import subprocess
import sys
import tempfile
import time

import numpy as np

import forceserver as fs

PEER, ROOT = ctypes.CDLL(sys.argv[1]), pathlib.Path(sys.argv[2])
for name in ("batch", "single", "field", "move"):
    getattr(PEER, f"peer_{name}").restype = ctypes.c_double
ROUNDS = 15


def clocked(work, count):
    """ns of each of count."""
    start = time.perf_counter()
    work()
    return (time.perf_counter() - start) * 1e9 / count


def at(array):
    return ctypes.c_void_p(array.ctypes.data)


def row(name, python, c):
    """Rounds of both, in turn; medians, and the ratio of the rates in the median round."""
    pairs = [(c(), python()) for _ in range(ROUNDS)]
    of_c, of_python = (statistics.median(values) for values in zip(*pairs))
    ratio = statistics.median(a / b for a, b in pairs)
    print(f"| {name} | {of_c:.0f} | {of_python:.0f} | {ratio:.2f} |", flush=True)


def repeated(call, count=20000):
    def loop():
        for _ in range(count):
            call()

    return lambda: clocked(loop, count)


def figures(objects):
    scene = fs.Scene()
    random = np.random.default_rng(1)
    for i in range(objects):
        scene[f"{i}"] = fs.Point(position=random.uniform(-0.1, 0.1, 3), front=fs.LinearIncreasing(200, limit=5))
    with tempfile.TemporaryDirectory() as folder:
        scene.save(folder + "/scene.json")
        assert PEER.peer_load((folder + "/scene.json").encode()) == 0
    tool, count = fs.Tool(scene), 100_000 if objects == 1 else 20_000
    states, responses = np.zeros(count, fs.State.dtype), np.zeros(count, fs.Response.dtype)
    states["pose"]["position"] = random.uniform(-0.1, 0.1, (count, 3))
    positions, forces = np.ascontiguousarray(states["pose"]["position"]), np.zeros((count, 3))
    what = "one object" if objects == 1 else f"{objects} objects"
    row(
        f"tool.evaluate, {count} states, {what}",
        lambda: clocked(lambda: tool.evaluate(states, responses), count),
        lambda: PEER.peer_batch(at(states), at(responses), ctypes.c_size_t(count)),
    )
    row(
        f"scene.evaluate, {count} positions, {what}",
        lambda: clocked(lambda: scene.evaluate(positions, forces), count),
        lambda: PEER.peer_field(at(positions), at(forces), ctypes.c_size_t(count)),
    )
    if objects > 1:
        return
    state, response = fs.State(pose=fs.Pose(position=(0.01, 0, 0))), fs.Response()
    position, force, evaluate = state.pose.position, response.wrench.force, tool.evaluate
    single = lambda: PEER.peer_single(at(np.asarray(state)), at(np.asarray(response)), ctypes.c_size_t(20000))  # noqa: E731

    def with_numbers():
        position[0] = 0.02
        evaluate(state, response)
        return force[0]

    row("tool.evaluate(state, response), kept", repeated(lambda: evaluate(state, response)), single)
    row("tool.evaluate(state, out=response), kept", repeated(lambda: evaluate(state, out=response)), single)
    row("tool.evaluate(state), a new response", repeated(lambda: evaluate(state)), single)
    row("the same, with one number in and one out, by kept views", repeated(with_numbers), single)
    row("an empty Python function (no call of the library)", repeated(lambda: None), single)
    one, pose, still = scene["0"], fs.Pose(orientation=(1, 0, 0, 0)), fs.Twist()
    moves = lambda: PEER.peer_move(ctypes.c_size_t(5000))  # noqa: E731
    row('scene.object_move("0", pose, twist, 0)', repeated(lambda: scene.object_move("0", pose, still, 0), 5000), moves)
    row(
        'scene["0"].move(position, orientation)',
        repeated(lambda: one.move((0, 0, 0), (1, 0, 0, 0), twist=still), 5000),
        moves,
    )


def import_time():
    code = "import numpy, time; t = time.perf_counter(); import forceserver; print(time.perf_counter() - t)"
    times = [
        float(subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout)
        for _ in range(15)
    ]
    return statistics.median(times)


def lines(*paths):
    return sum(len(path.read_text().splitlines()) for path in paths)


print(
    f"{os.cpu_count()} processors, load {os.getloadavg()[0]:.1f}, Python {sys.version.split()[0]}, NumPy {np.__version__}\n"
)
print("| ns each, median of 15 rounds in turn | C | Python | rate, of C's |\n|---|---|---|---|")
figures(1)
figures(100)
package, source = pathlib.Path(fs.__file__).parent, ROOT / "bindings" / "python"
generated = next((ROOT / "build" / "python" / "wheel").glob("**/generated/core.cpp"))
print(f"\nimport forceserver, beyond NumPy's: {1e3 * import_time():.1f} ms")
print(
    "sizes, kB: "
    + ", ".join(
        f"{path.name.split('.')[0]} {path.stat().st_size / 1e3:.0f}"
        for path in [*package.glob("*.so*"), package / "bin" / "forceserver"]
    )
)
print(
    f"lines by hand: core.h {lines(source / 'core.h')}, generate.py {lines(source / 'generate.py')}, the facade "
    f"{lines(*(source / 'forceserver').glob('*.py'))}; generated: core.cpp {lines(generated)}, "
    f"_core.pyi {lines(generated.with_name('_core.pyi'))}"
)
