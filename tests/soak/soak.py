"""The soak of tests/soak/run: starts the programs of soak.cpp, disturbs them, and prints a table at the end.
   soak.py PROGRAM [--ticks N] [--seconds S] [--seed N] [--beside]"""

import argparse
import errno
import glob
import json
import os
import random
import re
import select
import shutil
import signal
import subprocess
import sys
import tempfile
import time

megabyte = 1 << 20
patience = 180  # s, for whatever must come, on a machine that is busy with other things too


class Child:
    """A process that is told lines and answers lines; its errors are kept in a file."""

    def __init__(self, folder, name, words, environment=None):
        self.name = name
        self.errors = open(os.path.join(folder, name + ".errors"), "w+")
        self.process = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self.errors,
                                        env={**os.environ, **(environment or {})})
        children.append(self)
        self.read = b""

    def say(self, line):
        try:
            self.process.stdin.write(line.encode() + b"\n")
            self.process.stdin.flush()
        except (BrokenPipeError, ValueError):
            pass  # it has ended, which whoever waits for it finds out

    def hear(self, seconds=patience):
        """Its next line; None when it has ended, or none has come in time."""
        end = time.monotonic() + seconds
        while b"\n" not in self.read:
            ready, _, _ = select.select([self.process.stdout], [], [], max(0, end - time.monotonic()))
            got = os.read(self.process.stdout.fileno(), 1 << 16) if ready else b""
            if not got:
                return None
            self.read += got
        line, self.read = self.read.split(b"\n", 1)
        return line.decode()

    def ask(self, line, seconds=patience):
        self.say(line)
        return self.hear(seconds)

    def lines(self):
        """Its lines up to one with a full stop alone."""
        all_lines = []
        while (line := self.hear()) not in (".", None):
            all_lines.append(line)
        return all_lines

    def has_ended(self):
        return self.process.poll() is not None

    def wait(self):
        try:
            return self.process.wait(patience)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
            return "ended by the soak, as it did not end"

    def error(self):
        self.errors.seek(0)
        return self.errors.read().strip()

    def forget(self):
        """It has ended and been judged."""
        for file in (self.process.stdin, self.process.stdout, self.errors):
            try:
                file.close()
            except BrokenPipeError:
                pass
        os.remove(self.errors.name)
        children.remove(self)


children = []


def end_all():
    for child in children:
        if not child.has_ended():
            child.process.send_signal(signal.SIGCONT)
            child.process.kill()
        child.process.wait()


class Table:
    """Rows of words; a row with a verdict that is false, or any failure, fails the soak."""

    def __init__(self):
        self.rows, self.failures = [], []

    def add(self, what, value, must="", holds=True):
        self.rows.append((what, value, must, "" if not must else "holds" if holds else "FAILS"))
        if not holds:
            self.failures.append(f"{what}: {value}, must be: {must}")

    def fail(self, sentence):
        self.failures.append(sentence)
        print("FAILED:", sentence, flush=True)

    def show(self):
        head = ("", "measured", "must be", "verdict")
        widths = [max(len(row[i]) for row in [head, *self.rows]) for i in range(4)]
        for row in (head, *self.rows):
            print("  ".join(word.ljust(width) for word, width in zip(row, widths)).rstrip())


class Holdings:
    """What soak.cpp tells that a process holds: bytes that are resident and in use by the heap, descriptors and threads."""

    def __init__(self, words):
        self.resident, self.heap, self.descriptors, self.threads = (int(word) for word in words.split()[2:])

    def describe(self):
        return (f"RSS {self.resident / megabyte:.1f} MB, heap {self.heap / megabyte:.2f} MB, {self.descriptors} descriptors, "
                f"{self.threads} threads")


class FullDisk:
    """A folder on a full disk: a small tmpfs where a mount is allowed (tests/soak/run then has a name space of its own)."""

    def __init__(self, folder):
        self.folder = os.path.join(folder, "full")
        os.mkdir(self.folder)
        self.why_not = None
        if not os.environ.get("SOAK_MAY_MOUNT"):
            self.why_not = "a mount is not allowed here"
            return
        mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64k", "none", self.folder], stderr=subprocess.PIPE, text=True)
        if mounted.returncode:
            self.why_not = mounted.stderr.strip()
            return
        with open(os.path.join(self.folder, "filler"), "wb", buffering=0) as file:
            try:
                while True:
                    file.write(b"0" * 4096)
            except OSError as error:
                if error.errno != errno.ENOSPC:
                    raise

    def remains(self):
        return [name for name in os.listdir(self.folder) if name != "filler"]


class RealTime:
    """A server for some time, with clients that come, go and are killed, and all that may happen to it."""

    def __init__(self, program, folder, seconds, seed, beside, table):
        self.program, self.folder, self.seconds, self.beside, self.table = program, folder, seconds, beside, table
        self.random = random.Random(seed)
        self.seed = seed
        self.endpoint = f"shm:soak-{os.getpid()}"
        self.counts = dict.fromkeys(("came", "left", "killed", "dropped", "unplugged", "suspended", "clock", "full", "stopped"), 0)
        self.guests, self.leaving, self.residents = {}, [], []
        self.resident = []  # bytes, of the server at each look
        self.looks = []
        self.disk = FullDisk(folder)
        self.clock_file = os.path.join(folder, "clock")
        # Clients: those that come and go, and those that stay to the end.
        self.most_guests, self.most_residents = (8, 4) if beside else (24, 8)

    def begin(self):
        environment = {}
        self.fake_time = next(iter(glob.glob("/usr/lib/*/faketime/libfaketime.so.1")), None)
        if self.fake_time:
            self.set_clock(0)
            environment = {"LD_PRELOAD": self.fake_time, "FAKETIME_TIMESTAMP_FILE": self.clock_file, "FAKETIME_CACHE_DURATION": "1",
                           "DONT_FAKE_MONOTONIC": "1"}
        priority = "-1" if self.beside else "80"
        self.server = Child(self.folder, "server", [self.program, "server", self.endpoint, str(self.seed), priority], environment)
        if self.server.hear() != "ready":
            self.table.fail(f"the server does not start: {self.server.error()}")
            return False
        self.observer = Child(self.folder, "observer", [self.program, "observer", self.endpoint])
        if self.observer.hear() != "connected":
            self.table.fail(f"the observer does not connect: {self.observer.error()}")
            return False
        self.cyclictest = None
        if not self.beside and shutil.which("cyclictest"):
            is_granted = "FIFO" in json.loads(self.observer.ask("look"))["realtime"]
            words = ["cyclictest", "-q", "-t1", "-i1000", "-h1000", f"-D{int(self.seconds)}s", *(["-p80"] if is_granted else [])]
            self.cyclictest = Child(self.folder, "cyclictest", words)
        self.residents = [self.start_client(f"resident{i}") for i in range(self.most_residents)]
        return True

    def start_client(self, name):
        self.counts["came"] += 1
        return Child(self.folder, name, [self.program, "client", self.endpoint, name, str(self.random.getrandbits(32))])

    # ---- What happens.

    def set_clock(self, offset):  # s
        self.offset = offset
        with open(self.clock_file + ".new", "w") as file:
            file.write(f"{offset:+d}s\n")
        os.rename(self.clock_file + ".new", self.clock_file)

    def jump(self):
        wrong = int(self.server.ask("clock")) - self.offset - time.time()
        if abs(wrong) > 10:
            self.table.fail(f"the server's CLOCK_REALTIME should be {self.offset} s wrong, and is by {wrong:.0f} s more")
        years = 20 if self.counts["clock"] % 2 == 0 else 0  # then a time of 32 bits has run over, in 2038
        self.set_clock(years * 31_556_952 + self.random.choice((-1, 1)) * self.random.randrange(100_000))
        self.counts["clock"] += 1

    def unplug(self):
        self.server.say(f"unplug {self.random.uniform(0.05, 4)}")
        self.counts["unplugged"] += 1

    def suspend(self):
        self.server.process.send_signal(signal.SIGSTOP)
        time.sleep(2)
        self.server.process.send_signal(signal.SIGCONT)
        self.counts["suspended"] += 1

    def stop(self):
        for command in ("stop", "resume"):
            if (status := self.observer.ask(command)) != "FS_OK":
                self.table.fail(f"{command}: {status}")
            time.sleep(self.random.uniform(0, 0.5))
        self.counts["stopped"] += 1

    def save(self):
        for child in (self.server, self.observer):
            status = child.ask("save " + os.path.join(self.disk.folder, child.name + ".json"))
            if status != "FS_ERROR_IO":
                self.table.fail(f"the {child.name} saves to a full disk: {status}")
        if self.disk.remains():
            self.table.fail(f"a save to a full disk leaves {self.disk.remains()}")
        self.counts["full"] += 1

    def let_guests_come_and_go(self, time_now):
        if len(self.guests) < self.most_guests:
            name = f"guest{self.counts['came']}"
            self.guests[name] = (self.start_client(name), time_now + self.random.expovariate(1 / 15))
        for name, (guest, until) in list(self.guests.items()):
            if guest.has_ended():
                self.judge(guest)
                del self.guests[name]
            elif time_now > until:
                self.send_away(guest, self.random.random() < 0.5)
                del self.guests[name]
        for guest in list(self.leaving):
            if guest.has_ended():
                self.judge(guest)
                self.leaving.remove(guest)

    def send_away(self, guest, is_kill):
        if is_kill:
            guest.process.kill()
            self.counts["killed"] += 1
        else:
            guest.say("leave")
        self.leaving.append(guest)

    def judge(self, client):
        """Of a client that has ended."""
        status = client.wait()
        if status == 0:
            self.counts["left"] += 1
        elif status == 3:  # disconnected by the server, because it takes too long
            self.counts["dropped"] += 1
        elif status != -signal.SIGKILL:
            self.table.fail(f"{client.name} ends with {status}: {client.error()}")
        client.forget()

    def send_all_guests_away(self):
        for guest, _ in self.guests.values():
            self.send_away(guest, self.random.random() < 0.5)
        self.guests.clear()
        for guest in self.leaving:
            self.judge(guest)
        self.leaving.clear()

    # ---- What is seen.

    def look(self):
        answer = self.observer.ask("look")
        if answer is None:
            self.table.fail(f"the server does not answer: {self.observer.error()} {self.server.error()}")
            return False
        self.looks.append(json.loads(answer))
        with open(f"/proc/{self.server.process.pid}/statm") as file:
            self.resident.append(int(file.read().split()[1]) * os.sysconf("SC_PAGESIZE"))
        return True

    def quiet_holdings(self):
        """Of the server when only the residents are there. Its threads need memory for moments: the least of 10 s counts."""
        self.send_all_guests_away()
        seen = []
        for _ in range(20):
            time.sleep(0.5)
            seen.append(Holdings(self.server.ask("holdings")))
        return min(seen, key=lambda holdings: (holdings.descriptors, holdings.threads, holdings.heap))

    def run(self):
        if not self.begin():
            return
        start = now = time.monotonic()
        share = self.seconds / 5  # so that all happens in a short run, too
        happenings = [(min(60, share), self.unplug), (min(90, share), self.suspend), (min(45, share), self.stop)]
        if self.fake_time:
            happenings.append((min(20, share), self.jump))
        if not self.disk.why_not:
            happenings.append((min(30, share), self.save))
        due = [start + every * self.random.uniform(0.5, 1) for every, _ in happenings]
        self.first = None
        next_look = now
        while now < start + self.seconds:
            for i, (every, happen) in enumerate(happenings):
                if now >= due[i]:
                    due[i] = now + every * self.random.uniform(0.5, 1.5)
                    happen()
            self.let_guests_come_and_go(now)
            if now >= next_look:
                next_look = now + 0.5
                if self.server.has_ended() or not self.look():
                    self.table.fail(f"the server has ended with {self.server.process.poll()}: {self.server.error()}")
                    return
                for resident in list(self.residents):
                    if resident.has_ended():
                        self.residents.remove(resident)
                        if resident.process.poll() != 3 or not self.beside:
                            self.table.fail(f"{resident.name} has ended with {resident.process.poll()}: {resident.error()}")
                        self.judge(resident)
            if not self.first and now - start > min(60, self.seconds / 3):
                self.first = self.quiet_holdings()
            time.sleep(0.1)
            now = time.monotonic()
        self.finish()

    def finish(self):
        table, counts = self.table, self.counts
        last = self.quiet_holdings()
        wanted = []
        for resident in self.residents:
            resident.say("freeze")
        for resident in self.residents:
            if resident.hear() != "connected":
                table.fail(f"{resident.name} did not connect")
            wanted += resident.lines()
        for _ in range(120):  # an object of a client that has just been lost may still be there
            self.observer.say("list")
            there = self.observer.lines()
            clients = sorted(line.split()[1] for line in there if line.startswith("client "))
            objects = sorted(line for line in there if line.startswith("object ") and not line.startswith("object server/"))
            if objects == sorted(wanted):
                break
            time.sleep(0.5)
        if objects != sorted(wanted):
            for line in sorted(set(wanted) ^ set(objects))[:6]:
                print("  differs:", line, "as the client left it" if line in wanted else "as the server has it")
        names = sorted(["server", "observer", *(resident.name for resident in self.residents)])
        self.look()
        latched = self.server.ask("latched")
        for resident in self.residents:
            resident.say("leave")
            self.judge(resident)
        self.observer.say("leave")
        self.observer.wait()
        self.server.say("leave")
        status = self.server.wait()

        begin, end, minute = self.looks[1], self.looks[-1], self.looks[1]["time"] + min(60, self.seconds / 3)
        first_age = min(look["age"] for look in self.looks if look["time"] <= minute)
        last_age = min(look["age"] for look in self.looks if look["time"] >= end["time"] - min(60, self.seconds / 3))
        elapsed = end["time"] - begin["time"]
        counted = (end["ticks"] + end["misses"] - begin["ticks"] - begin["misses"]) * 1e-3
        table.add("clients", f"{counts['came']} came, {counts['left']} left, {counts['killed']} were killed")
        table.add("clients that the server dropped", str(counts["dropped"]), "" if self.beside else "0",
                  self.beside or not counts["dropped"])
        happened = [("device unplugged", "unplugged", ""), ("force stopped and resumed", "stopped", ""),
                    ("server suspended for 2 s", "suspended", ""),
                    ("CLOCK_REALTIME set", "clock", "" if self.fake_time else "faketime is missing"),
                    ("saved to a full disk, by server and client", "full", self.disk.why_not)]
        for what, key, why_not in happened:
            if why_not:
                table.add(what, f"not, {why_not}")
            else:
                table.add(what, f"{counts[key]} times", "at least once", counts[key] > 0)
        half = len(self.resident) // 2
        early, late = max(self.resident[:half]), max(self.resident[half:])
        bound = early * 1.2 + 64 * megabyte  # threads of the server need that much for moments
        table.add("server, residents only, first minute", self.first.describe())
        table.add("server, residents only, end", last.describe(), "heap +4 MB at most, the rest as before",
                  last.heap <= self.first.heap + 4 * megabyte and
                  (last.descriptors, last.threads) == (self.first.descriptors, self.first.threads))
        table.add("most RSS in the first half, in the second", f"{early / megabyte:.1f} MB, {late / megabyte:.1f} MB",
                  f"at most {bound / megabyte:.1f} MB", late <= bound)
        drift, most_drift = abs(last_age - first_age), 1 if self.beside else 0.01
        table.add("drift of the scene's clock", f"{1e6 * drift:.0f} us", f"below {1e3 * most_drift:.0f} ms", drift < most_drift)
        table.add("ticks and misses against the clock", f"{1e3 * (counted - elapsed):+.1f} ms of {elapsed:.0f} s")
        table.add("ticks missed", f"{end['misses']} of {end['ticks'] + end['misses']}, about {2000 * counts['suspended']} of them "
                                  f"suspended; {end['realtime']}")
        table.add("late; time of a tick, 99 of 100 (last 10 s)", f"{1e6 * end['late_p99']:.0f} us; {1e6 * end['compute_p99']:.0f} us")
        table.add("cyclictest", self.cyclictest_figures())
        table.add("latched faults, cleared", str(latched))
        table.add("largest step of the force", f"{end['largest_step']:.3f} N/ms, of {end['largest_force']:.2f} N at most",
                  "at most 1.5 N/ms, the guard's", end["above"] == 0)
        table.add("steps to 0 by fault, stop or unplugging", f"{end['cuts']}, the largest of {end['largest_cut']:.2f} N/ms")
        table.add("ticks seen, not seen", f"{end['seen']}, {end['unseen']}", "some, and some force in them",
                  end["seen"] > 0 and end["largest_force"] > 0)
        table.add("clients at the end", str(len(clients)), "those that stayed", clients == names)
        table.add("objects at the end", str(len(objects)), "as these left them",
                  objects == sorted(wanted) and wanted != [])
        table.add("server's end", str(status), "0", status == 0)

    def cyclictest_figures(self):
        if not self.cyclictest:
            return "not run beside other work" if self.beside else "not there (Debian: rt-tests)"
        self.cyclictest.process.send_signal(signal.SIGINT)
        output, _ = self.cyclictest.process.communicate()
        output = output.decode()
        total, missed, worst = (re.search(rf"^# {name}: *(\d+)", output, re.M)
                                for name in ("Total", "Histogram Overflows", "Max Latencies"))
        if not (total and missed and worst):
            return f"gave nothing: {self.cyclictest.error() or output[-100:]}"
        return (f"{int(missed[1])} of {int(total[1]) + int(missed[1])} later than a period, at most {int(worst[1])} us")


class Virtual:
    """The virtual ticks, in a process of its own beside the real time."""

    def __init__(self, program, folder, ticks, seed, table):
        self.program, self.folder, self.ticks, self.table = program, folder, ticks, table
        self.child = Child(folder, "virtual", ["nice", "-n", "10", program, "virtual", str(ticks), str(seed)])

    def finish(self):
        said = {}
        while (line := self.child.hear(86_400)) is not None:
            words = line.split()
            said[words[1] if words[0] == "holdings" else words[0]] = line
        if (status := self.child.wait()) != 0:
            return self.table.fail(f"the virtual ticks end with {status}: {self.child.error()}")
        fresh = subprocess.run([self.program, "golden"], stdout=subprocess.PIPE, text=True).stdout.strip()
        tenth, end = Holdings(said["tenth"]), Holdings(said["end"])
        bound = tenth.resident * 1.1 + 8 * megabyte
        add = self.table.add
        add("virtual ticks", said["virtual"].split(maxsplit=1)[1])
        add("after a tenth of them", tenth.describe())
        add("after all", end.describe(), f"RSS at most {bound / megabyte:.1f} MB, heap +4 MB, the rest as before",
            end.resident <= bound and end.heap <= tenth.heap + 4 * megabyte and
            (end.descriptors, end.threads) == (tenth.descriptors, tenth.threads))
        add("hash of the golden forces", said["golden"].split()[1], "as in a fresh process", said["golden"] == fresh)
        return None


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program")
    parser.add_argument("--ticks", type=float, default=1e8)
    parser.add_argument("--seconds", type=float, default=3600)
    parser.add_argument("--seed", type=int, default=time.time_ns() % 1_000_000)
    parser.add_argument("--beside", action="store_true")
    options = parser.parse_args()
    def interrupt(*_):
        raise KeyboardInterrupt

    stopping = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    for number in stopping:
        signal.signal(number, interrupt)
    table = Table()
    print(f"seed {options.seed}: {options.ticks:.0f} virtual ticks, {options.seconds:.0f} s in real time", flush=True)
    folder = tempfile.mkdtemp(prefix="soak-")
    try:
        virtual = Virtual(options.program, folder, int(options.ticks), options.seed, table) if options.ticks else None
        if options.seconds:
            RealTime(options.program, folder, options.seconds, options.seed, options.beside, table).run()
        if virtual:
            virtual.finish()
    except KeyboardInterrupt:
        print("interrupted")
        return 130
    finally:
        for number in stopping:
            signal.signal(number, signal.SIG_IGN)
        end_all()
        subprocess.run(["umount", os.path.join(folder, "full")], stderr=subprocess.DEVNULL)
        shutil.rmtree(folder, ignore_errors=True)
    table.show()
    for sentence in table.failures:
        print("FAILED:", sentence)
    print("the soak fails" if table.failures else "all holds")
    return 1 if table.failures else 0


sys.exit(main())
