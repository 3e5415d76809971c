"""VirtualRobot: a rover with an arm, simulated with MuJoCo, as a client of the force-server."""
