"""Closing within calls and signals, and groups that are ended elsewhere."""

import gc
import os
import threading
import time

import pytest

import forceserver as fs

FORCE = """
    import os, signal, threading, time
    import forceserver as fs
    scene = fs.Scene()
    scene["wall"] = fs.Wall((0, 0, 0), (0, 0, 1), 500, 10)
    device = fs.Device("sim:?hold=0,0,-0.02")
"""


@pytest.mark.parametrize("mode", ["virtual", "caller"])
def test_a_signal_closes_the_servo_that_this_thread_steps(run, mode):
    out = run(FORCE + f"""
    servo = fs.Servo(scene, device, mode="{mode}", fade=0.001, ramp=0.001)
    def handler(*_):
        servo.close()
        device.read()  # the servo has given it back: its force is 0
        print("closed", flush=True)
    signal.signal(signal.SIGALRM, handler)
    signal.setitimer(signal.ITIMER_REAL, 0.3)
    try:
        while True: servo.step(1000)
    except fs.StateError as error:
        assert "closed" in str(error)
    """, timeout=30)
    assert out == "closed"


def test_ctrl_c_while_closing_gives_back_what_another_thread_uses(run):
    run("""
        import signal, threading, time
        import numpy as np
        import forceserver as fs
        import os
        endpoint = f"shm:interrupted-{os.getpid()}"
        servo = fs.Servo(fs.Scene(), mode="virtual", fade=0.001)
        server = fs.Server(servo, endpoint)
        threading.Thread(target=lambda: servo.step(10**15), daemon=True).start()
        big, viewer = fs.connect(endpoint, "big"), fs.connect(endpoint, "viewer")
        for i in range(50): big[f"{i}"] = fs.Point(front=fs.Custom("sin(d)*exp(-d*t)", limit=1))
        begun, positions = threading.Event(), np.random.default_rng(0).uniform(-1, 1, (200000, 3))
        def work():
            begun.set()
            big.evaluate(positions)
        thread = threading.Thread(target=work)
        thread.start()
        begun.wait()
        time.sleep(0.05)
        signal.signal(signal.SIGALRM, signal.default_int_handler)
        signal.setitimer(signal.ITIMER_REAL, 0.05)
        try:
            big.close()
        except KeyboardInterrupt:
            assert thread.is_alive()
        else:
            raise SystemExit("nothing was raised")
        assert big.closed
        assert len(viewer.get_clients()) == 3
        thread.join()
        for patience in range(1000):  # the call's end has given it back
            if len(viewer.get_clients()) == 2: break
            time.sleep(0.01)
        else:
            raise SystemExit("it is still connected")
    """)


def test_a_stray_commit_does_not_free_the_group_of_another_thread(scene, spring):
    stop, errors = threading.Event(), []

    def stray():
        while not stop.is_set():
            for call in (scene.commit, scene.cancel):
                try:
                    call()
                    errors.append("a group of another thread was ended")
                except fs.StateError:
                    pass

    def editor(name):
        try:
            for _ in range(300):
                with scene.change():
                    scene[name] = spring
                    del scene[name]
        except BaseException as error:
            errors.append(error)

    threads = [threading.Thread(target=stray) for _ in range(2)]
    editors = [threading.Thread(target=editor, args=(f"e{i}",)) for i in range(3)]
    for thread in threads + editors:
        thread.start()
    for thread in editors:
        thread.join()
    stop.set()
    for thread in threads:
        thread.join()
    assert errors == []


def test_a_group_in_a_generator_that_another_thread_closes(scene, spring):
    def changes():
        with scene.change():
            scene["a"] = spring
            yield

    generator = changes()
    next(generator)
    thread = threading.Thread(target=generator.close)
    thread.start()
    thread.join()
    assert list(scene) == ["a"]  # the group is still open, as it is this thread's
    scene.cancel()
    assert list(scene) == []
    with scene.change():
        scene["b"] = spring
    assert list(scene) == ["b"]


def test_a_group_that_another_thread_would_commit(scene, spring):
    change, errors = scene.change(), []
    change.__enter__()
    scene["a"] = spring

    def other():
        with scene.change():
            scene["b"] = spring
            try:
                change.__exit__(None, None, None)
            except fs.StateError as error:
                errors.append(str(error))

    thread = threading.Thread(target=other)
    thread.start()
    thread.join()
    assert errors == ["a group can only be committed in the thread that has opened it"]
    scene.commit()
    assert sorted(scene) == ["a", "b"]


def test_a_nested_group_is_refused_by_its_name(scene):
    with scene.change(), pytest.raises(fs.StateError, match=r"scene.change\(\) cannot be nested"), scene.change():
        pass


def test_a_handle_in_use_is_not_taken(scene):
    waiting = threading.Thread(target=lambda: scene.next_event(1))
    waiting.start()
    scene.begin()
    with pytest.raises(fs.StateError, match="in use"):
        fs.Scene(scene)
    scene.cancel()
    waiting.join()
    taken = fs.Scene(scene)
    assert scene.closed and not taken.closed
    taken.close()


def test_a_closed_handle_stays_what_it_was():
    one, other = fs.Scene(), fs.Scene()
    before = hash(one), hash(other)
    names = {one: "one", other: "other"}
    one.close()
    other.close()
    assert (hash(one), hash(other)) == before and names[one] == "one" and one == one and one != other
    with pytest.raises(fs.StateError, match="closed"), one:
        pass


def test_a_server_keeps_its_servo(scene):
    endpoint = f"shm:closing-{os.getpid()}"
    server = fs.Server(fs.Servo(scene), endpoint)
    gc.collect()
    with fs.connect(endpoint, "me") as client:
        assert len(client.get_clients()) == 2
        ticks = scene.get_servo_stats().ticks
        while scene.get_servo_stats().ticks == ticks:
            time.sleep(0.01)
    server.close()


def test_a_servo_tells_why_it_has_no_stats():
    scene = fs.Scene()
    servo = fs.Servo(scene)
    scene.close()
    with pytest.raises(fs.StateError, match="the scene of this servo is closed.*the servo runs on"):
        servo.stats
    servo.close()
    with pytest.raises(fs.StateError, match="this Servo is closed"):
        servo.stats
