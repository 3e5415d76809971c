"""A ball of honey with a radius of 30 mm: it resists motion with 20 N s/m, 5 N at most, and does nothing to a hand at
rest. The damping of an object acts where its profile gives a force: here a force too small to be felt."""

from recipe import finish, rounded

import forceserver as fs


def feel_moving(tool, where, x, speed):
    hand = fs.State()
    hand.pose.position = (x, 0, 0)
    hand.twist.linear = (0, speed, 0)
    force = [f"{rounded(value):5.2f}" for value in tool.evaluate(hand).wrench.force]
    print(f"{where:26} {speed:4.1f} m/s   ({', '.join(force)}) N")


scene = fs.Scene()
scene["honey"] = fs.Point(front=fs.Constant(1e-6, limit=5, reach=0.03), damping=20)  # the limit is for both
tool = fs.Tool(scene)
feel_moving(tool, "inside, at rest", 0.01, 0)
feel_moving(tool, "inside, slowly", 0.01, 0.1)
feel_moving(tool, "inside, back", 0.01, -0.1)
feel_moving(tool, "inside, fast: the limit", 0.01, 1)
feel_moving(tool, "outside, slowly", 0.04, 0.1)
finish(scene)
