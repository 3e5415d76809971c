"""A path: it draws the hand to itself, most strongly 10 mm away, with 3 N. On the path and from 20 mm on there is no
force, so the force does not jump when the hand comes or goes."""

from recipe import feel, finish

import forceserver as fs

points = [[-0.06, 0, 0], [0, 0, 0], [0.06, 0, 0.03]]
newtons = [0, 2, 3, 2, 0]  # every 5 mm; smooth in between; the last one also holds beyond
scene = fs.Scene()
scene["path"] = fs.Polyline(points, front=fs.Custom(newtons, step=0.005, limit=3))
feel(scene, "on the path", -0.03, 0, 0)
feel(scene, "5 mm beside it", -0.03, 0.005, 0)
feel(scene, "10 mm below it", -0.03, 0, -0.01)
feel(scene, "30 mm beside it", -0.03, 0.03, 0)
feel(scene, "10 mm past its end", -0.07, 0, 0)
finish(scene)
