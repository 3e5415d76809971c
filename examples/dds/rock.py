"""A program without forceserver that publishes a force-object: a rock that circles about the centre of the room.

    pip install cyclonedds
    python rock.py --room main                       every hand of the room feels the rock; Ctrl-C ends
    python rock.py --edit lab:app/spring             it also moves the object "spring" of the client "app" at site lab
"""
import argparse
import math
import time

from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.pub import DataWriter, Publisher
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader, Subscriber
from cyclonedds.topic import Topic
from cyclonedds.util import duration

from forceserver_types import (Answer, Contact, Curve, Edit, EditedObject, ForceObject, Hand, Motions, Moved, Pose, Profile, Reports, Shape,
                               Status, Twist, Vec3)

MESH, CUSTOM, REPULSIVE, KEEP_FRONT, PART_POSE = 3, 7, 1, 1, 1  # fs_primitive, fs_profile_kind, fs_sense, fs_keep, fs_part

# As the bridge does it on `lo`: without multicast, each program of this machine has a port that the others can work out.
ON_THIS_MACHINE = """<CycloneDDS><Domain>
  <General><Interfaces><NetworkInterface name="lo"/></Interfaces><AllowMulticast>false</AllowMulticast></General>
  <Discovery><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>100</MaxAutoParticipantIndex>
    <Peers><Peer address="127.0.0.1"/></Peers></Discovery>
</Domain></CycloneDDS>"""
ON_A_NETWORK = '<CycloneDDS><Domain><General><Interfaces><NetworkInterface name="{}"/></Interfaces></General></Domain></CycloneDDS>'

# How topics are sent (forceserver.idl).
NOW = Policy.Reliability.Reliable(0)
STATE = Qos(NOW, Policy.Durability.TransientLocal, Policy.History.KeepLast(1))
LIVELY = Qos(Policy.Liveliness.Automatic(duration(seconds=1)), Policy.WriterDataLifecycle(autodispose=False), base=STATE)
STREAM = Qos(Policy.Reliability.BestEffort, Policy.History.KeepLast(1))
REQUEST = Qos(NOW, Policy.Durability.Volatile, Policy.History.KeepAll)


class Room:
    """The topics of a room."""

    def __init__(self, name, domain, interface):
        self.domain = Domain(domain, ON_THIS_MACHINE if interface == "lo" else ON_A_NETWORK.format(interface))
        self.participant = DomainParticipant(domain)
        partition = Qos(Policy.Partition([name]))
        self.publisher = Publisher(self.participant, qos=partition)
        self.subscriber = Subscriber(self.participant, qos=partition)

    def writer(self, topic, struct, qos):
        return DataWriter(self.publisher, Topic(self.participant, "forceserver1/" + topic, struct), qos=qos)

    def reader(self, topic, struct, qos):
        return DataReader(self.subscriber, Topic(self.participant, "forceserver1/" + topic, struct), qos=qos)


def newest(reader):
    """Of each site the newest sample that has come, if any."""
    return {sample.site: sample for sample in reader.take(64) if sample.sample_info.valid_data}


def make_rock(site, session):
    """An octahedron, solid, with a field that pushes 2..4 N at its surface and throbs twice a second."""
    r = 0.012
    points = [Vec3(r), Vec3(-r), Vec3(0, r), Vec3(0, -r), Vec3(0, 0, r), Vec3(0, 0, -r)]
    triangles = [0, 2, 4, 2, 1, 4, 1, 3, 4, 3, 0, 4, 2, 0, 5, 1, 2, 5, 3, 1, 5, 0, 3, 5]
    # Keys are unlike those of other programs, and change with the content.
    shape = Shape(content=site + "-octahedron", primitive=MESH, points=points, triangles=triangles)
    curve = Curve(content=site + "-throb", expression="(3 + sin(12*t))*exp(-d/0.01)")
    rock = ForceObject(site=site, client="rock.py", name="rock", session=session, primitive=MESH, form=shape.content,
                       front=Profile(kind=CUSTOM, sense=REPULSIVE, gain=1, limit=4, reach=0.05, curve=curve.content),
                       solid=Contact(keep=KEEP_FRONT, stiffness=500, limit=4))
    return shape, curve, rock


def put_on_circle(rock, now):
    """Where the rock is at this time, and how fast."""
    radius, turn = 0.03, 1.0  # m, rad/s
    x, y = radius * math.cos(turn * now), radius * math.sin(turn * now)
    rock.place = Pose(Vec3(x, y))
    rock.motion = Twist(Vec3(-turn * y, turn * x))
    rock.time, rock.horizon = now, 0.1


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--room", default="main")
    parser.add_argument("--site", default="rock", help="the name of this program in the room (%(default)s)")
    parser.add_argument("--domain", type=int, default=0)
    parser.add_argument("--interface", default="lo", help="the network interface (%(default)s: this machine only)")
    parser.add_argument("--edit", metavar="SITE:CLIENT/OBJECT", help="an object of another site, to be moved by 10 mm")
    options = parser.parse_args()

    room = Room(options.room, options.domain, options.interface)
    shapes, curves = room.writer("Shape", Shape, LIVELY), room.writer("Curve", Curve, LIVELY)
    objects, motions = room.writer("Object", ForceObject, LIVELY), room.writer("Motions", Motions, STREAM)
    edits, answers = room.writer("Edit", Edit, REQUEST), room.reader("Answer", Answer, REQUEST)
    status, others = room.reader("Status", Status, STATE), room.reader("Object", ForceObject, STATE)
    hands, reports = room.reader("Hand", Hand, STREAM), room.reader("Reports", Reports, STREAM)

    session = time.time_ns()  # another number each time that this program starts
    shape, curve, rock = make_rock(options.site, session)
    rock.revision = rock.change = 1
    rock.start = time.monotonic()
    put_on_circle(rock, time.monotonic())
    shapes.write(shape)
    curves.write(curve)
    objects.write(rock)

    known, to_edit = set(), None
    for number in range(1, 1 << 62):
        time.sleep(0.04)  # 25 times a second
        now = time.monotonic()
        put_on_circle(rock, now)
        rock.revision += 1
        x, y = rock.motion.linear.x, rock.motion.linear.y
        moved = Moved(rock.client, rock.name, rock.revision, rock.place, [x, y, 0, 0, 0, 0], rock.horizon, now)
        motions.write(Motions(options.site, session, number, now, [moved]))

        for site, sample in newest(status).items():
            if site not in known:
                print(f"site {site} is here with {sample.device}, {sample.force_max:.1f} N")
            known.add(site)
        for theirs in others.take(64):
            if theirs.sample_info.valid_data and options.edit == f"{theirs.site}:{theirs.client}/{theirs.name}":
                to_edit, options.edit = theirs, None
        # Nobody hears a request who has not been found yet.
        if to_edit and edits.get_matched_subscriptions() and answers.get_matched_publications():
            wanted = EditedObject(place=to_edit.place)  # what of it counts is told by `parts`
            wanted.place.position.y += 0.01
            edits.write(Edit(to_edit.site, to_edit.client, to_edit.name, asker=options.site, editor=rock.client, number=1,
                             parts=PART_POSE, wanted=wanted))
            to_edit = None
        for answer in answers.take(64):
            if answer.sample_info.valid_data and answer.site == options.site:
                print(f"site {answer.answerer} answers the edit: {answer.text or 'done'}")
        hand, felt = newest(hands), newest(reports)
        if number % 25 == 0:
            for site, sample in hand.items():
                p = sample.place.position
                print(f"the hand of site {site} is at {1000 * p.x:.1f} {1000 * p.y:.1f} {1000 * p.z:.1f} mm")
            for site, sample in felt.items():
                for each in sample.felt:
                    if each.client == f"{rock.client}@{options.site}":
                        print(f"the rock pushes there with {math.hypot(each.force.x, each.force.y, each.force.z):.2f} N")


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:
        pass
