"""Bridges of several sites in a network that is as bad as networks are: all sites have the same in the end. For namespaces.sh.

test_sites.py PROBE BRIDGE MAKE_KEYS TEST, where TEST is a function below, without "test_".
"""
import json
import os
import pathlib
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time

PROBE, BRIDGE, MAKE_KEYS = sys.argv[1:4]
LEASE, FADE = 1, 0.2  # s, of the bridge and of the servo
bad = 0
all_sites = []


def net(*commands):
    subprocess.run(["net", *commands], check=True, capture_output=True)


def check(what, is_good, seen=""):
    global bad
    bad += not is_good
    print(f"{'good' if is_good else 'BAD '} {what}: {seen}", flush=True)
    return is_good


def start(site, *command, **files):
    return subprocess.Popen(["at_site", str(site), *map(str, command)], text=True, **files)


class Site:
    """A server, its bridge and a client, named puppet, at the site of that number. The servo's rate is low: there are many
    here, and a server disconnects whoever takes longer than a period."""

    def __init__(self, number, *options, name=None):
        self.number, self.name, self.options = number, name or f"n{number}", options or ("--open",)
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
        self.server = start(number, PROBE, "server", "s", "sim:?hold=0,0,0&encoder=ideal", 200, **pipes)
        self.server.stdout.readline()
        self.puppet = start(number, PROBE, "puppet", "shm:s", "puppet", **pipes)
        self.start_bridge()
        all_sites.append(self)

    def start_bridge(self):
        self.said = pathlib.Path(os.environ["NET_FOLDER"], f"bridge{self.number}")
        with open(self.said, "a") as file:
            self.bridge = start(self.number, BRIDGE, "s", "--site", self.name, "--interface", "eth0", *self.options, stdout=file,
                                stderr=file)

    def end(self):
        self.bridge.terminate()
        return self.bridge.wait()

    def tell(self, command):  # the answer comes later
        self.puppet.stdin.write(command + "\n")
        self.puppet.stdin.flush()

    def answer(self):
        return self.puppet.stdout.readline().strip()

    def do(self, command):
        self.tell(command)
        out = self.answer()
        if out != "ok":
            check(f"{command} at {self.name}", False, out)

    def look(self, owner=None):
        """What the puppet of a site has, as this site knows it: {name: [all that must be the same, start]}."""
        for _ in range(50):
            self.tell(f"look puppet{'' if owner in (None, self) else '@' + owner.name}")
            out = self.answer()
            if out.startswith("{"):
                return json.loads(out)
            time.sleep(0.1)  # something went while it looked
        raise RuntimeError(f"the puppet of {self.name} says \"{out}\", its server has ended with {self.server.poll()}")

    def has_force(self):
        self.tell("force")
        return self.answer() == "on"


class Watch:
    """The least and the newest number of objects that a site has seen of another's puppet."""

    def __init__(self, site, owner):
        self.process = start(site.number, PROBE, "count", "shm:s", f"puppet@{owner.name}", stdin=subprocess.PIPE,
                             stdout=subprocess.PIPE)
        self.least = self.newest = float("inf")
        threading.Thread(target=self.read, daemon=True).start()

    def read(self):
        for line in self.process.stdout:
            self.newest = int(line.split()[1])
            self.least = min(self.least, self.newest)

    def end(self):
        self.process.stdin.close()
        self.process.wait()
        return self.least


def within(seconds, condition):
    """How long it takes until that holds; None: too long."""
    begun = time.monotonic()
    while time.monotonic() < begun + seconds:
        if condition():
            return time.monotonic() - begun
        time.sleep(0.1)
    return None


def difference(sites):
    """Where a site has something else than its owner; empty: nowhere. Ghosts and what is missing count, too."""
    for owner in sites:
        own = {name: text for name, (text, _) in owner.look().items()}
        for site in sites:
            there = {name: text for name, (text, _) in site.look(owner).items()}
            for name in sorted(own.keys() | there.keys()):
                if own.get(name) != there.get(name):
                    return f"{owner.name}/{name} is\n  {own.get(name)}\nand at {site.name}\n  {there.get(name)}"
    return ""


def check_same(what, sites, seconds):
    took = within(seconds, lambda: not difference(sites))
    counts = [len(site.look()) for site in sites]
    return check(what, took is not None, difference(sites) if took is None else f"after {took:.1f} s, {counts} objects")


def hexadecimal(number):
    """As C writes it."""
    return re.sub(r"\.?0*p", "p", float(number).hex())


def finish(sites):
    for site in sites:
        if bad:
            print(f"---- the bridge of {site.name}\n{site.said.read_text()}")
    return 1 if bad else 0


# ------------------------------------------------------------------------------------------------------------ the tests


def test_loss():
    sites = a, b, c = [Site(n) for n in (1, 2, 3)]
    net("delay 0.3", "jitter 0.02", "loss 0.02", "reorder 0.05", "late 0.02")
    a.do("add 0 200")
    a.do("contents 2")
    b.do("add 0 20")
    check_same("200 objects, a mesh of 2 MB and curves", sites, 40)
    check("they are all there", len(c.look(a)) == 203, len(c.look(a)))
    a.tell("wander 0 50 8")
    b.do("wander 5 5 2")
    # Meanwhile others edit and remove, also what moves.
    for i in range(60, 70):
        b.do(f"gain puppet@n1/s{i} {200 + i}")
        c.do(f"remove puppet@n1/s{i + 10}")
    c.do("gain puppet@n1/s7 307")
    c.do("gain puppet@n2/s3 303")
    b.do("remove 10 5")
    a.answer()
    a.do("remove 100 30")
    a.do("add 300 7")
    check_same("the same after moves, edits and removals", sites, 30)
    own = a.look()
    check("what was removed is gone", len(own) == 203 - 10 - 30 + 7, len(own))
    gains = [(200 + i, f"s{i}") for i in range(60, 70)] + [(307, "s7")]
    check("what was edited is so", all(f" {hexadecimal(gain)} " in own.get(name, [""])[0] for gain, name in gains), gains[-1])
    c.do("stop")
    took = within(10, lambda: not any(site.has_force() for site in sites))
    check("a stop reaches all sites", took is not None, took)
    return finish(sites)


def check_fade(what, site, owner, since):
    watch = within(10, lambda: not site.look(owner))
    took = None if watch is None else time.monotonic() - since
    check(f"{what}: {site.name} lets the objects of {owner.name} fade", took is not None and took < LEASE + FADE + 1.3, took)


def change_all(sites, k):
    """Each site adds, changes, moves and removes."""
    for site in sites:
        site.do(f"add {1000 * k} 10")
        site.do(f"remove {1000 * (k - 1)} 5")
        site.do(f"gain s{1000 * (k - 1) + 6} {100 + k}")
        site.do(f"wander {1000 * (k - 1) + 7} 3 0.3")


def test_cut():
    sites = a, b, c = [Site(n) for n in (1, 2, 3)]
    for site in sites:
        site.do("add 0 10")
    a.do("contents 0.2")
    check_same("all is there", sites, 20)
    between = Watch(b, a)
    net("cut 3")
    begun = time.monotonic()
    for site, owner in ((a, c), (c, a), (b, c), (c, b)):
        check_fade("a site is cut off", site, owner, begun)
    time.sleep(25)
    change_all(sites, 1)
    check_same("the others go on", (a, b), 10)
    time.sleep(max(0, begun + 60 - time.monotonic()))
    net("heal")
    check_same("after a minute", sites, 30)
    check("the others saw nothing of it", between.end() >= 12, between.least)
    for k, way in ((2, "1>2"), (3, "2>1")):
        net(f"cut {way}")
        begun = time.monotonic()
        late, first = (b, a) if way == "1>2" else (a, b)
        check_fade(f"{way} is cut", late, first, begun)
        time.sleep(5)
        change_all(sites, k)
        time.sleep(max(0, begun + 15 - time.monotonic()))
        net("heal")
        check_same(f"after {way} was cut", sites, 30)
    return finish(sites)


def test_clocks():
    # At first the way from site 1 takes longer than the way back, so that the clocks are taken to be 50 ms from where they are.
    net("delay 0.02", "delay 0.12 1>2", "delay 0.12 1>3", "jitter 0.005", "loss 0.02")
    sites = a, b, c = [Site(n) for n in (1, 2, 3)]
    a.do("contents 0.1")
    check_same("all is there", sites, 20)

    def phase(site):
        return site.look(a)["waves"][1] - a.look()["waves"][1] - 1000 * (site.number - 1)

    took = within(5, lambda: 0.03 < phase(b) < 0.07)
    check("they cannot be known better yet", took is not None, phase(b))
    wall = start(1, PROBE, "wall", "shm:s", "50")
    # With 70 ms a motion is over before the next sample comes.
    for delay, rms, part in ((0.02, 0.001, 0.5), (0.07, 0.002, 0.7)):
        net(f"delay {delay}")
        time.sleep(8 if delay == 0.02 else 12)
        following = [start(n, PROBE, "follow", "shm:s", "wall@n1/wall", "8", stdout=subprocess.PIPE) for n in (2, 3)]
        for site, process in zip((b, c), following):
            error = json.loads(process.communicate()[0])
            good = error["looks"] > 1000 and error["rms"] < rms and error["rms"] < part * error["rms_on_arrival"]
            check(f"a wall that moves is followed at {site.name}, {delay} s away", good, error)
    wall.wait()
    for site in (b, c):
        check(f"f(d, t) is in phase at {site.name}", abs(phase(site)) < 0.02, f"{1000 * phase(site):.2f} ms")
    return finish(sites)


def test_keys():
    folder = tempfile.mkdtemp(dir=os.environ["NET_FOLDER"])
    for authority, names in (("ours", ("n1", "n2", "n3")), ("others", ("n5",))):
        subprocess.run([MAKE_KEYS, f"{folder}/{authority}", *names], check=True, stdout=subprocess.DEVNULL)
    ours = a, b, c = [Site(n, "--security", f"{folder}/ours/n{n}") for n in (1, 2, 3)]
    strangers = [Site(4), Site(5, "--security", f"{folder}/others/n5")]
    sites = [*ours, *strangers]
    for site in sites:
        site.do("add 0 10")
    a.do("contents 0.2")
    check_same("those with keys of the room see each other", ours, 20)
    strangers[0].do("stop")
    strangers[1].do("stop")
    time.sleep(2)
    check("a stranger's stop stops itself only", [s.has_force() for s in sites] == [True] * 3 + [False] * 2)
    for site in sites:
        for owner in sites:
            is_ours = site in ours and owner in ours
            if site is not owner and not is_ours:
                is_told = f"site {owner.name}" in site.said.read_text()
                check(f"{site.name} sees nothing of {owner.name}", not site.look(owner) and not is_told)
    # A way that is gone for longer than DDS waits for a participant, but the way back is not: one site has given up the other.
    # With a third one in the room that one still hears the first, without it only its announcements.
    for k, way in ((1, "1>2"), (2, "2>1")):
        if k == 2:
            c.end()
            ours = a, b
        net(f"cut {way}")
        time.sleep(5)
        change_all(ours, k)
        time.sleep(15)
        net("heal")
        if k == 1:
            # What another removes while the first is away must not come back as a ghost.
            within(30, lambda: "joins the room anew" in a.said.read_text())
            c.do(f"remove {1000 * k} 3")
        check_same(f"after {way} was cut, {len(ours)} sites", ours, 40)
        is_told = ["joins the room anew" in site.said.read_text() for site in ours]
        check("the site that was given up has joined anew", is_told[:2] == [True, k == 2], is_told)
    return finish(sites)


def test_stopped():
    sites = a, b, c = [Site(n) for n in (1, 2, 3)]
    net("delay 0.01", "loss 0.02")
    for site in sites:
        site.do("add 0 10")
    check_same("all is there", sites, 20)
    a.bridge.send_signal(signal.SIGSTOP)
    begun = time.monotonic()
    check_fade("a bridge stands still", b, a, begun)
    change_all(sites, 1)
    time.sleep(max(0, begun + 5 - time.monotonic()))
    a.bridge.send_signal(signal.SIGCONT)
    check_same("after it goes on", sites, 20)
    # A server that does not answer for a while, just when the bridge asks for many objects.
    a.do("add 3000 300")
    time.sleep(0.03)
    a.server.send_signal(signal.SIGSTOP)
    time.sleep(2.5)
    a.server.send_signal(signal.SIGCONT)
    check_same("after a server goes on", sites, 20)
    a.do("remove 3000 300")
    check_same("after that", sites, 20)
    between = Watch(b, a)
    check("a bridge ends", c.end() == 0, c.bridge.returncode)
    c.name = "n1"
    c.start_bridge()
    try:
        code = c.bridge.wait(20)
    except subprocess.TimeoutExpired:
        code = "it runs"
    check("another bridge of the same name ends", code == 2, code)
    check_same("the room is whole", (a, b), 20)
    check("it was all the time", between.end() == 15, between.least)
    if code == 2:
        c.name = "n3"
        c.start_bridge()
        check_same("the third is back under its own name", sites, 20)
    return finish(sites)


def test_names():
    """An application that gives each object a new name."""
    sites = a, b = [Site(n) for n in (1, 2)]
    a.do("add 0 10")
    check_same("all is there", sites, 20)

    def megabytes():
        lines = [pathlib.Path(f"/proc/{site.bridge.pid}/status").read_text() for site in sites]
        return [int(re.search(r"VmRSS:\s+(\d+)", text)[1]) / 1000 for text in lines]

    for k in range(1, 13):
        a.do(f"add {1000 * k} 500")
        good = within(10, lambda: len(b.look(a)) == 510) is not None
        a.do(f"remove {1000 * k} 500")
        good = within(10, lambda: len(b.look(a)) == 10) is not None and good
        if k == 2:
            before = megabytes()
        if not good:
            check(f"500 objects come and go, {k}", False)
    grown = [now - then for now, then in zip(megabytes(), before)]
    check("names that are gone cost no memory", max(grown) < 8, f"{grown[0]:.1f} and {grown[1]:.1f} MB more after 5000 names")
    return finish(sites)


try:
    sys.exit({name: f for name, f in globals().items() if name.startswith("test_")}["test_" + sys.argv[4]]())
except RuntimeError as error:
    check("the test", False, error)
    sys.exit(finish(all_sites))
