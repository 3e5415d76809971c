"""A node of ROS 2 as rmw_cyclonedds would make it, whose types are described otherwise than the bridge's: the names of their fields
differ, which ROS does not compare. For test_bridge_vendors.cpp.

    ros_node.py DOMAIN      publishes poses on /goal, (0.05, 0.01, 0), and prints "wrench FRAME X" of /forceserver/desk/wrench
"""
import sys
import time
from dataclasses import dataclass
from pathlib import Path

from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.annotations import final
from cyclonedds.idl.types import float64, int32, uint32
from cyclonedds.pub import DataWriter
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

sys.path.insert(0, str(Path(__file__).parents[2] / "examples/dds"))
from rock import ON_THIS_MACHINE  # noqa: E402


@dataclass
@final
class Time(IdlStruct, typename="builtin_interfaces.msg.dds_.Time_"):
    s: int32
    ns: uint32


@dataclass
@final
class Header(IdlStruct, typename="std_msgs.msg.dds_.Header_"):
    when: Time
    frame: str


@dataclass
@final
class Three(IdlStruct, typename="geometry_msgs.msg.dds_.Vector3_"):
    a: float64
    b: float64
    c: float64


@dataclass
@final
class Quaternion(IdlStruct, typename="geometry_msgs.msg.dds_.Quaternion_"):
    a: float64
    b: float64
    c: float64
    d: float64


@dataclass
@final
class PoseStamped(IdlStruct, typename="geometry_msgs.msg.dds_.PoseStamped_"):
    head: Header
    p: Three
    q: Quaternion


@dataclass
@final
class WrenchStamped(IdlStruct, typename="geometry_msgs.msg.dds_.WrenchStamped_"):
    head: Header
    force: Three
    torque: Three


domain = int(sys.argv[1])
configured = Domain(domain, ON_THIS_MACHINE)
participant = DomainParticipant(domain)
default = Qos(Policy.Reliability.Reliable(1), Policy.Durability.Volatile, Policy.History.KeepLast(10))
sensor_data = Qos(Policy.Reliability.BestEffort, Policy.Durability.Volatile, Policy.History.KeepLast(5))
wrench = DataReader(participant, Topic(participant, "rt/forceserver/desk/wrench", WrenchStamped), qos=default)
goal = DataWriter(participant, Topic(participant, "rt/goal", PoseStamped), qos=sensor_data)
while True:
    time.sleep(0.05)
    goal.write(PoseStamped(Header(Time(1, 2), "world"), Three(0.05, 0.01, 0), Quaternion(0, 0, 0, 1)))
    for sample in wrench.take(64):
        if sample.sample_info.valid_data:
            print("wrench", sample.head.frame, f"{sample.force.a:.4f}", flush=True)
