"""What the recipes share: they print the force at a place, and save the scene to a file."""

import sys


def rounded(force):
    return 0 if abs(force) < 0.005 else force  # no "-0.00"


def feel(scene, where, x, y, z):
    """Prints what a hand feels that rests at (x, y, z), m."""
    place = [f"{1e3 * value:5.1f}" for value in (x, y, z)]
    force = [f"{rounded(value):5.2f}" for value in scene.evaluate([[x, y, z]])[0]]
    print(f"{where:26} ({', '.join(place)}) mm   ({', '.join(force)}) N")


def finish(scene):
    """Writes the scene to the file that the first argument names, if there is one."""
    if len(sys.argv) > 1:
        scene.save(sys.argv[1])
