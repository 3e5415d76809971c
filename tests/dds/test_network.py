"""The network of namespaces.sh is as bad as it was told to be: three sites, measured with datagrams. For namespaces.sh."""
import json
import socket
import subprocess
import sys
import time

PORT, GROUP = 7000, "239.1.2.3"


def sites_answer():
    """At a site: sends each datagram back to its sender, and says first that it listens."""
    s = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    s.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 21)
    s.bind(("", PORT))
    s.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, socket.inet_aton(GROUP) + socket.inet_aton(sys.argv[2]))
    print("ready", flush=True)
    while True:
        data, sender = s.recvfrom(2000)
        s.sendto(data, sender)


def ask(address, count, rate, wait):
    """At a site: what comes back, as (number, round trip in s, sender), in the order in which it comes."""
    s = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    s.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton(sys.argv[2]))
    s.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 21)
    sent, got, start = [], [], time.monotonic()
    while len(sent) < count or time.monotonic() < start + count / rate + wait:
        next_at = start + (len(sent) / rate if len(sent) < count else count / rate + wait)
        s.settimeout(max(1e-6, next_at - time.monotonic()))
        try:
            data, sender = s.recvfrom(2000)
            number = int(data[:8])
            got.append((number, time.monotonic() - sent[number], sender[0]))
        except TimeoutError:
            pass
        while len(sent) < count and time.monotonic() >= start + len(sent) / rate:
            sent.append(time.monotonic())
            s.sendto(b"%08d" % (len(sent) - 1) + bytes(92), (address, PORT))
    return got


def net(*commands):
    return subprocess.run(["net", *commands], check=True, capture_output=True, text=True).stdout


def from_site_1(address, count=1000, rate=1000, wait=0.3):
    asking = ["at_site", "1", sys.executable, "-B", __file__, "ask", "10.77.0.1", address, str(count), str(rate), str(wait)]
    return json.loads(subprocess.run(asking, check=True, capture_output=True, text=True).stdout)


def check(what, is_good, seen):
    print(f"{'good' if is_good else 'BAD '} {what}: {seen}", flush=True)
    return is_good


def median(got):
    return sorted(t for _, t, _ in got)[len(got) // 2]


def main():
    for site in (2, 3):
        answering = subprocess.Popen(["at_site", str(site), sys.executable, "-B", __file__, "answer", f"10.77.0.{site}"],
                                     stdout=subprocess.PIPE, text=True)
        answering.stdout.readline()
    good = []

    got = from_site_1("10.77.0.2")
    good.append(check("nothing is lost or late by itself", len(got) == 1000 and median(got) < 0.005, f"{median(got):.6f} s"))

    net("clear", "delay 0.010", "loss 0.02")
    got = from_site_1("10.77.0.2", 4000)
    lost = 1 - len(got) / 4000
    good.append(check("10 ms each way", 0.02 <= median(got) < 0.025, f"{median(got):.6f} s"))
    good.append(check("2 % are lost each way", 0.028 < lost < 0.052, f"{lost:.4f}"))
    good.append(check("they come in order", [n for n, _, _ in got] == sorted(n for n, _, _ in got), ""))
    ways = {tuple(line.split()[1:3]): line.split() for line in net("counts").splitlines() if line.startswith("way")}
    there, back = ways["1", "2"], ways["2", "1"]
    frames = int(there[4]) + int(there[7]), int(back[4])
    is_good = 4000 <= frames[0] < 4020 and len(got) <= frames[1] < len(got) + 20
    good.append(check("frames are counted", is_good, frames))
    good.append(check("bytes are counted", 142 * 3800 < int(there[5]) < 142 * 4000, there[5]))  # with 42 of Ethernet, IP and UDP

    net("loss 0", "delay 0", "jitter 0.010")
    trips = sorted(t for _, t, _ in from_site_1("10.77.0.3", 100, 50))[:-5]  # a busy machine holds some of them up
    good.append(check("jitter", trips[0] < 0.006 and 0.012 < trips[-1] < 0.025, f"{trips[0]:.6f} to {trips[-1]:.6f} s"))

    net("jitter 0", "reorder 0.05 1>2")
    got = [n for n, _, _ in from_site_1("10.77.0.2")]
    late = sum(n < m for m, n in zip(got, got[1:]))
    good.append(check("5 % come after those that followed", 25 < late < 80 and len(got) == 1000, late))

    net("reorder 0", "clear")
    got = from_site_1(GROUP, 100)
    senders = {site: sum(sender == site for _, _, sender in got) for site in ("10.77.0.2", "10.77.0.3")}
    good.append(check("a datagram to many reaches all", list(senders.values()) == [100, 100], senders))

    net("cut 2")
    cut, other = from_site_1("10.77.0.2", 100), from_site_1("10.77.0.3", 100)
    net("heal 2")
    healed = from_site_1("10.77.0.2", 100, wait=2)  # site 1 may have to ask anew for the address of its card
    seen = len(cut), len(other), len(healed)
    good.append(check("a site is cut off and healed", seen[:2] == (0, 100) and seen[2] > 0, seen))

    net("cut 1>3")
    seen = len(from_site_1("10.77.0.3", 100)), len(from_site_1("10.77.0.2", 100))
    net("heal")
    good.append(check("a way is cut", seen == (0, 100), seen))

    fates = []
    for _ in range(2):
        from_site_1("10.77.0.2", 1)  # so that nobody asks for addresses after this
        net("seed 7", "loss 0.5 1>2")
        fates.append([n for n, _, _ in from_site_1("10.77.0.2", 100)])
        net("loss 0")
    good.append(check("half is lost one way", 30 < len(fates[0]) < 70, len(fates[0])))
    good.append(check("the same seed loses the same", fates[0] == fates[1], ""))

    refused = [subprocess.run(["net", command], capture_output=True).returncode for command in ("lose 3", "cut 4", "delay x")]
    good.append(check("a command that is none is refused", refused == [1, 1, 1], refused))
    return 0 if all(good) else 1


if len(sys.argv) > 1 and sys.argv[1] == "answer":
    sites_answer()
elif len(sys.argv) > 1:
    json.dump(ask(sys.argv[3], int(sys.argv[4]), float(sys.argv[5]), float(sys.argv[6])), sys.stdout)
else:
    sys.exit(main())
