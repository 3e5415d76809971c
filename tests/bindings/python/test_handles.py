"""Destruction and collection in every order, closing, forks, signals, and the end of the interpreter."""

import gc
import itertools
import os
import resource
import threading
import time

import numpy as np
import pytest

import forceserver as fs


def everything():
    scene = fs.Scene()
    scene["a"] = fs.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], front=fs.Custom("d", limit=1))
    device = fs.Device("sim:?path=figure8")
    servo = fs.Servo(scene, device)
    return {
        "scene": scene,
        "device": device,
        "tool": fs.Tool(scene),
        "servo": servo,
        "server": fs.Server(servo, f"shm:order-{os.getpid()}"),
    }


USES = {"scene": fs.Scene.get_time, "device": fs.Device.read, "tool": fs.Tool.reset, "servo": fs.Servo.get_record}


@pytest.mark.parametrize("close", [True, False], ids=["closed", "collected"])
def test_every_order_of_destruction(close, request):
    orders = list(itertools.permutations(["scene", "device", "tool", "servo", "server"]))
    for order in orders if request.config.getoption("--all") else orders[::12]:
        all = everything()
        for name in order:
            one = all.pop(name)
            if close:
                one.close()
                assert one.closed
                one.close()
                if name in USES:  # a server has no calls
                    with pytest.raises(fs.StateError, match="closed"):
                        USES[name](one)
            del one
            gc.collect()


def test_what_was_closed_is_refused_as_an_argument(scene):
    device = fs.Device("sim:")
    device.close()
    with pytest.raises(fs.StateError):
        scene.servo_start(device)
    with pytest.raises(TypeError):
        scene.servo_start(None)
    with pytest.raises(TypeError):
        scene.servo_start(scene)
    with fs.Device("sim:") as again:
        servo = scene.servo_start(again)
        servo.close()


def test_a_servo_that_is_collected_stops(scene):
    device = fs.Device("sim:?path=figure8")
    servo = fs.Servo(scene, device)
    with pytest.raises(fs.StateError):
        device.read()
    del servo
    gc.collect()
    device.read()
    servo = fs.Servo(scene, device)
    circle = [servo]
    circle.append(circle)
    del servo, circle
    gc.collect()
    device.read()


def memory():
    return int(open("/proc/self/statm").read().split()[1]) * resource.getpagesize()


def test_the_pages_of_the_host_are_not_locked(run):
    """A servo locks what its ticks use, about 5 MB, and not the pages of its host: neither those in use, nor those that it
    has reserved, nor those that it maps later."""
    told = run("""
        import mmap, pathlib, time
        import numpy as np
        import forceserver as fs
        def tell():
            lines = pathlib.Path("/proc/self/status").read_text().splitlines()
            fields = dict(line.split(":") for line in lines)
            print(*(int(fields[key].split()[0]) for key in ("VmRSS", "VmLck")), end=" ")
        size = 64 << 20
        used, reserved = np.ones(size, np.uint8), mmap.mmap(-1, size)
        scene = fs.Scene()
        scene["wall"] = fs.Wall(point=(0, 0, 0), normal=(0, 0, 1), stiffness=500, limit=10)
        device = fs.Device("sim:?hold=0,0,-0.02")
        tell()
        with fs.Servo(scene, device) as servo:
            later = mmap.mmap(-1, size)
            while not scene.hand().sent.force[2] > 1:
                time.sleep(0.01)
                servo.set_enabled(True)  # a machine that is too slow stops the force
            tell()
        tell()
    """)
    kb = [int(number) for number in told.split()]
    print(f"memory before, during and after a servo: {kb[0::2]} kB, of which are locked: {kb[1::2]} kB")
    assert kb[0] > 80_000
    assert kb[2] - kb[0] < 24_000 and kb[4] - kb[0] < 24_000
    assert kb[3] - kb[1] < 16_000 and kb[5] == kb[1]


def test_create_and_destroy_keeps_memory_flat(request, spring):
    count = 1_000_000 if request.config.getoption("--all") else 100_000
    points, triangles = np.eye(3), np.array([[0, 1, 2]])

    def some(n):
        for i in range(n):
            scene = fs.Scene()
            scene["a"] = spring
            tool = fs.Tool(scene)
            tool.evaluate(fs.State())
            if i % 10 == 0:
                scene["b"] = fs.Mesh(points, triangles, front=fs.Custom([1.0, 2.0], step=1, limit=1))
                assert scene["b"].object.shape.get_points().shape == (3, 3)

    some(count // 10)
    before = memory()
    some(count - count // 10)
    assert memory() - before < 2_000_000


def test_errors_keep_memory_flat(scene, spring):
    def some(n):
        for _ in range(n):
            for wrong in (
                lambda: scene.get_report("nix"),
                lambda: fs.Profile(gain="x"),
                lambda: scene.evaluate(np.zeros((3, 3)), np.zeros(3)),
                lambda: fs.Custom("3*(", limit=1),
            ):
                with pytest.raises((fs.Error, TypeError)):
                    wrong()

    some(500)
    before = memory()
    some(3000)
    assert memory() - before < 2_000_000


def test_closing_while_others_call():
    for _ in range(10):
        scene = fs.Scene()
        scene["a"] = fs.Point(front=fs.Constant(1, limit=1))
        tool = fs.Tool(scene)
        positions, states = np.random.default_rng(0).uniform(-1, 1, (20000, 3)), np.zeros(20000, fs.State.dtype)
        errors = []

        def until_closed(work):
            try:
                while True:
                    work()
            except fs.StateError as error:
                assert "closed" in str(error)
            except BaseException as error:
                errors.append(error)

        threads = [
            threading.Thread(target=until_closed, args=(work,))
            for work in (
                lambda: scene.evaluate(positions),
                lambda: tool.evaluate(states),
                lambda: tool.evaluate(fs.State()),
                lambda: scene.get_reports(),
                lambda: scene.next_event(100),
                lambda: scene.object_set(fs.Object(name="b")),
            )
        ]
        for thread in threads:
            thread.start()
        time.sleep(0.03)
        closers = [threading.Thread(target=one.close) for one in (scene, scene, tool, tool)]
        for thread in closers:
            thread.start()
        for thread in threads + closers:
            thread.join(60)
            assert not thread.is_alive()
        assert errors == []


def test_closing_a_servo_that_steps(scene):
    servo = fs.Servo(scene, mode="virtual")
    ended = []

    def steps():
        with pytest.raises(fs.StateError):
            servo.step(10**15)
        ended.append(1)

    thread = threading.Thread(target=steps)
    thread.start()
    time.sleep(0.2)
    servo.close()
    thread.join(60)
    assert ended == [1]


INTERRUPTED = {
    "next_event": "scene.next_event(1000)",
    "events": "list(scene.events())",
    "sync": "servo = fs.Servo(scene, mode='virtual'); scene['a'] = fs.Point(); scene.sync(1000)",
    "connect": "fs.connect('shm:nobody-there?timeout=1000', 'me')",
    "step": "fs.Servo(scene, mode='virtual').step(10**15)",
}


@pytest.mark.parametrize("wait", INTERRUPTED)
def test_ctrl_c_ends_a_wait(run, wait):
    run(f"""
        import os, signal, threading, time
        import forceserver as fs
        scene = fs.Scene()
        threading.Timer(0.4, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
        start = time.monotonic()
        try:
            {INTERRUPTED[wait]}
        except KeyboardInterrupt:
            assert time.monotonic() - start < 20
            scene["c"] = fs.Point()  # the scene is as good as before
        else:
            raise SystemExit("nothing was raised")
    """)


def test_ctrl_c_ends_the_wait_for_a_mesh(run):
    out = run("""
        import os, signal, threading, time
        import numpy as np
        import forceserver as fs
        side = 1000
        x, y = (grid.ravel() for grid in np.meshgrid(np.arange(side), np.arange(side)))
        points = np.column_stack([x, y, np.sin(x * y)]).astype(float)
        corners = np.arange(side * (side - 1)).reshape(side - 1, side)[:, :-1].ravel()
        triangles = np.concatenate([corners[:, None] + [0, 1, side], corners[:, None] + [1, side + 1, side]])
        shape = fs.shape_create_mesh(points, triangles.astype(np.uint32))
        signal.setitimer(signal.ITIMER_REAL, 0.05)
        signal.signal(signal.SIGALRM, signal.default_int_handler)
        try:
            shape.build()
        except KeyboardInterrupt:
            assert not shape.get_info().built
            while not shape.get_info().built:  # what was begun goes on
                time.sleep(0.01)
            shape.build()
            print("built")
    """)
    assert out == "built"


def test_ctrl_c_ends_the_wait_for_a_device(run, slow_driver):
    run(f"""
        import signal
        import forceserver as fs
        fs.driver_load("{slow_driver}")
        signal.signal(signal.SIGALRM, signal.default_int_handler)
        signal.setitimer(signal.ITIMER_REAL, 0.2)
        try:
            fs.Device("slow:")
        except KeyboardInterrupt:
            fs.Device("sim:").close()
        else:
            raise SystemExit("nothing was raised")
    """)


@pytest.mark.parametrize(
    "end",
    [
        "pass",
        "raise SystemExit(0)",
        "sys.exit()",
        "threading.Thread(target=lambda: servo.step(1), daemon=True)",
        "gc.disable(); circle = [servo]; circle.append(circle); del servo, circle",
        "threading.Thread(target=lambda: scene.next_event(1000), daemon=True).start(); time.sleep(0.1)",
    ],
)
@pytest.mark.parametrize("mode", ["thread", "virtual"])
def test_exit_with_a_servo_stops_it(run, end, mode):
    out = run(f"""
        import atexit, gc, sys, threading, time
        def last():  # registered first, so it runs after that of forceserver
            print(device.read().pose is not None)  # StateError while a servo has the device
        atexit.register(last)
        import forceserver as fs
        scene = fs.Scene()
        scene["a"] = fs.Point(front=fs.Constant(2, limit=2))
        device = fs.Device("sim:?path=figure8")
        servo = fs.Servo(scene, device, mode="{mode}")
        {end}
    """)
    assert out == "True"


def test_exit_while_a_daemon_thread_steps(run):
    out = run("""
        import atexit, threading, time
        atexit.register(lambda: print(device.read().pose is not None))
        import forceserver as fs
        scene, device = fs.Scene(), fs.Device("sim:")
        servo = fs.Servo(scene, device, mode="virtual")
        threading.Thread(target=lambda: servo.step(10**15), daemon=True).start()
        time.sleep(0.2)
    """)
    assert out == "True"


def test_fork(run):
    out = run("""
        import os, threading, time
        import numpy as np
        import forceserver as fs
        scene = fs.Scene()
        scene["a"] = fs.Point(front=fs.LinearIncreasing(200, limit=5))
        tool, servo = fs.Tool(scene), fs.Servo(scene, fs.Device("sim:"))
        stop, busy = threading.Event(), fs.Scene()
        busy["a"] = fs.Point(front=fs.LinearIncreasing(200, limit=5))
        def work():
            while not stop.is_set():
                busy.evaluate(np.zeros((100000, 3)))
        def group():
            with scene.change():
                held.set()
                stop.wait()
        held = threading.Event()
        threads = [threading.Thread(target=work), threading.Thread(target=group)]
        for thread in threads: thread.start()
        held.wait()
        time.sleep(0.05)
        pid = os.fork()
        if pid == 0:
            assert tool.evaluate(fs.State(pose=fs.Pose(position=(0.01, 0, 0)))).wrench.force[0] < 0
            scene["b"] = fs.Point()          # the group of the parent's thread is not the child's
            try: busy.get_reports()          # it may or may not have been in a call just then
            except fs.StateError: pass
            own = fs.Scene()
            own["x"] = fs.Point()
            try: servo.get_record()
            except fs.Error: pass
            servo.close(); scene.close(); tool.close(); busy.close()
            print("child", flush=True)
            os._exit(0)
        assert os.waitpid(pid, 0)[1] == 0
        stop.set()
        for thread in threads: thread.join()
        assert list(scene) == ["a"]
        pid = os.fork()
        if pid == 0:
            raise SystemExit(0)              # the ordinary end, with all that the child has of the parent
        assert os.waitpid(pid, 0)[1] == 0
        before = servo.stats.ticks
        while servo.stats.ticks == before:   # the parent's goes on
            time.sleep(0.01)
        print("parent")
    """)
    assert out == "child\nparent"


def test_a_call_in_a_signal_handler_may_close(run):
    run("""
        import signal
        import forceserver as fs
        scene = fs.Scene()
        signal.signal(signal.SIGALRM, lambda *_: scene.close())
        signal.setitimer(signal.ITIMER_REAL, 0.2)
        try: scene.next_event(1000)
        except fs.StateError: pass
    """)
