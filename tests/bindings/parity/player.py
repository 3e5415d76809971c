"""Plays the scenario through the Python package; player.cpp has the rest of what there is to say."""

import contextlib
import json
import os
import pathlib
import sys

import numpy as np

import forceserver as fs


class Cancelled(Exception):
    pass


class Player:
    def __init__(self, scenario, connected, folder, stack):
        self.scenario, self.connected, self.folder, self.stack = scenario, connected, pathlib.Path(folder), stack
        self.places = scenario["places"]
        self.shapes, self.curves, self.surfaces, self.given = {}, {}, {}, []
        self.scene, self.servo = stack.enter_context(fs.Scene()), None
        self.since = 0
        self.scenes = {}  # connected: the server's own, and that of another client
        self.device = stack.enter_context(fs.Device(scenario["device"]))
        if connected:
            self.start()
            endpoint = f"shm:parity-{os.getpid()}"
            stack.enter_context(fs.Server(self.servo, endpoint))
            self.scenes["server"] = self.scene
            self.scene = stack.enter_context(fs.connect(endpoint, "player"))
            self.scenes["other"] = stack.enter_context(fs.connect(endpoint, "other"))

    def start(self):
        servo = fs.Servo(self.scene, self.device, mode="virtual", fade=self.scenario["fade"], max_stiffness=-1)
        self.servo = self.stack.enter_context(servo)

    def play(self, steps, prefix=""):
        for i, step in enumerate(steps):
            if "only" in step and (step["only"] == "connected") != self.connected:
                continue
            place, status, own = f"{prefix}{i}", "OK", self.scene
            self.scene = self.scenes.get(step.get("by"), own)
            try:
                if step["do"] == "group":
                    with contextlib.suppress(Cancelled), self.scene.change():
                        self.play(step["steps"], place + ".")
                        if not step["commit"]:
                            raise Cancelled
                    self.given = []
                else:
                    self.given = []
                    self.run(step)
            except fs.Error as error:
                status, self.given = "ERROR_" + error.status.name, []
            self.scene = own
            print("\t".join([place, "'" + status, *self.given]))

    def give(self, *values):
        for value in values:
            if isinstance(value, str):
                self.given.append("'" + value)
            else:
                self.given += [float(number).hex() for number in np.ravel(value)]

    def give_pose(self, pose):
        self.give(pose.position, pose.orientation)

    def give_two(self, pair):  # a twist or a wrench
        self.give(*((pair.linear, pair.angular) if isinstance(pair, fs.Twist) else (pair.force, pair.torque)))

    def give_profile(self, p):
        self.give(int(p.kind), int(p.sense), p.gain, p.offset, p.width, p.limit, p.reach)

    @staticmethod
    def pose(p):
        position = p.get("position", [0, 0, 0])
        if "z" in p:
            return fs.pose_from_z(position, p["z"])
        return fs.Pose(position=position, orientation=p.get("orientation", [1, 0, 0, 0]))

    @staticmethod
    def twist(t):
        return fs.Twist(linear=t[0], angular=t[1])

    def profile(self, p):
        return fs.Profile(**{**p, **({"curve": self.curves[p["curve"]]} if "curve" in p else {})})

    def object(self, o):
        made = fs.Wall(*o["wall"]) if "wall" in o else fs.Object(primitive=o.get("primitive", "point"))
        made.name = o["name"]
        for name, value in o.items():
            if name in ("front", "back"):
                value = self.profile(value)
            elif name in ("pose", "twist"):
                value = getattr(self, name)(value)
            elif name == "shape":
                value = self.shapes[value]
            elif name == "surface":
                value = self.surfaces[value]
            elif name == "solid":
                name, value = "contact", fs.Contact(keep="front", stiffness=value, limit=10)
            if name != "wall":
                setattr(made, name, value)
        return made

    def run(self, step):
        getattr(self, "do_" + step["do"])(**{k: v for k, v in step.items() if k not in ("do", "by", "only", "status", "gives")})

    def do_time(self, at):
        if self.connected:
            self.servo.step(round((at - self.scene.time) * 1000))
        else:
            self.scene.set_time(at)
        self.give(self.scene.time)

    def do_shape(self, name, points=None, triangles=None, closed=False, file=None, scale=1):
        if file:
            shape = fs.shape_load(self.folder / file, scale)
        elif triangles:
            shape = fs.shape_create_mesh(points, np.array(triangles, np.uint32))
        else:
            shape = fs.shape_create_polyline(points, closed)
        self.shapes[name] = shape
        info = shape.get_info()
        self.give(int(info.primitive), info.closed, info.open_edges, info.lower, info.upper)
        self.give(*(f"{part:016x}" for part in info.content))

    def do_build(self, name):
        self.shapes[name].build()
        self.give(self.shapes[name].get_info().built, self.shapes[name].get_progress())

    def do_curve(self, name, expression=None, table=None, step=None):
        self.curves[name] = fs.curve_create_table(table, step) if table else fs.curve_create_expression(expression)

    def do_surface(self, name, static, dynamic, distance, impact=0, heights=None, columns=1, width=0, expression=None, rows=1):
        texture = {}
        if expression:
            texture = {"heights": expression, "count": (columns, rows), "width": width}
        elif heights:
            texture = {"heights": [heights[i : i + columns] for i in range(0, len(heights), columns)], "width": width, "repeats": True}
        self.surfaces[name] = fs.surface(
            static_friction=static, dynamic_friction=dynamic, slip_distance=distance, impact=impact, **texture
        )

    def do_profile(self, profile, t, distances, max_stiffness=0):
        self.give(fs.intensity(self.profile(profile), distances, t, max_stiffness=max_stiffness))

    def do_law(self, object, max_stiffness, t, distances):
        self.give(fs.law(self.object(object), distances, t, max_stiffness=max_stiffness))

    def do_set(self, object):
        made = self.object(object)
        self.scene[made.name] = made

    def do_change(self, object, parts):
        self.scene.object_change(self.object(object), sum(fs.Part[part.upper()] for part in parts))

    def do_move(self, name, pose, twist=None, time=0):
        self.scene.object_move(name, self.pose(pose), twist and self.twist(twist), time)

    def do_remove(self, name):
        del self.scene[name]

    def do_evaluate(self, time, name=None, positions=None):
        self.give(self.scene.evaluate(positions or self.places, name=name, time=time))

    def do_tool(self, pose, twist, time, points=None):
        tool = fs.Tool(self.scene, points)
        for place in self.places:
            state = fs.State(pose=self.pose({**pose, "position": place}), twist=self.twist(twist), time=time)
            response = tool.evaluate(state)
            self.give_two(response.wrench)
            stiffness = np.reshape(response.stiffness, (3, 3))
            self.give(response.felt_count, stiffness[0, 0], stiffness[0, 1], stiffness[2, 2])
        tool.reset()

    def do_get(self, name):
        o = self.scene[name].object
        self.give(o.name, int(o.primitive))
        self.give_pose(o.pose)
        self.give_two(o.twist)
        self.give(o.lifetime)
        self.give_profile(o.front)
        self.give_profile(o.back)
        self.give(o.damping, o.tool_points, o.enabled)
        if o.shape:
            self.give(o.shape.get_points())
            triangles = o.shape.get_triangles()
            if triangles is not None:
                self.give(triangles)
        if curve := o.front.curve:
            expression = curve.get_expression()
            table, step = curve.get_table()
            self.give(*([expression] if expression else [table]), step)

        if o.surface:
            settings = o.surface.get_settings()
            self.give(settings.static_friction, settings.dynamic_friction, settings.slip_distance)
            heights = o.surface.get_heights()
            self.give(*([] if heights is None else heights), settings.column_width)
            self.give(settings.impact_gain, settings.impact_frequency, settings.impact_decay)

    def do_motions(self, client=None):
        for m in self.scene.get_motions(client):
            self.give(m["name"], m["primitive"], m["pose"]["position"], m["pose"]["orientation"])
            self.give(m["twist"]["linear"], m["twist"]["angular"], m["horizon"])
            moves = np.zeros(1, fs.Motion.dtype)
            for part in ("pose", "twist", "time", "horizon"):
                moves[part] = m[part]
            (soon,) = fs.motion_at(moves, m["time"] + 0.03)
            self.give(soon["position"], soon["orientation"])

    def do_motions_since(self, client=None):
        for m in self.scene.get_motions_since(client, self.since):
            self.give(m["name"], m["pose"]["position"], m["pose"]["orientation"])
            self.since = int(m["motion_revision"])

    def give_report(self, r):
        self.give(r.name, r.primitive, r.state, r.weight, r.stiffness_wanted)
        self.give(r.stiffness_applied, r.distance, r.point, r.wrench.force, r.wrench.torque)

    def do_reports(self):
        for r in sorted(self.scene.get_reports(), key=lambda r: r.name):
            self.give_report(r)

    def do_report(self, name):
        self.give_report(self.scene.get_report(name))

    def do_clear(self):
        self.scene.clear()

    def do_accuracy(self, newtons):
        self.scene.set_accuracy(newtons)

    def do_max_stiffness(self, stiffness):
        self.scene.set_max_stiffness(stiffness)

    def do_events(self, drain=False):
        events = sorted(self.scene.events(timeout=0), key=lambda e: (e.kind, e.name))
        for e in events if not drain else []:
            value = float(e.value == os.getpid()) if e.kind == fs.EventKind.CLIENT else e.value
            self.give(int(e.kind), int(e.status), value, e.name, e.text)

    def do_clients(self):
        for c in self.scene.get_clients():
            self.give(c["name"], c["process"] == os.getpid(), c["objects"], c["force_limit"])
            self.give(c["wrench"]["force"], c["wrench"]["torque"], c["refused"], c["limited"], c["shape_bytes"])

    def do_frame(self, pose, scale, force_scale):
        self.scene.set_frame(fs.Frame(pose=self.pose(pose), scale=scale, force_scale=force_scale))

    def do_get_frame(self, client=None):
        frame = self.scene.get_frame(client)
        self.give_pose(frame.pose)
        self.give(frame.scale, frame.force_scale)
        there = fs.frame_to_device(frame, frame.pose)
        self.give_pose(there)
        self.give_pose(fs.frame_to_scene(frame, there))

    def do_get_points(self):
        self.give(self.scene.get_tool())

    def do_points(self, points):
        self.scene.set_tool(np.reshape(points, (-1, 3)))

    def do_radius(self, radius):
        self.scene.set_tool_radius(radius)
        self.give(self.scene.get_tool_radius())

    def do_clutch(self, held):
        self.scene.set_clutch(held)

    def do_view(self, client=None):
        view = self.scene.get_view(client)
        self.give_pose(view.frame.pose)
        self.give(view.frame.scale, view.frame.force_scale)
        self.give_pose(view.tool)
        self.give(view.held, view.point_radius, view.points[: view.point_count])

    def do_views(self):
        for each in self.scene.get_views():
            view = each["view"]
            self.give(each["name"])
            self.give(view["frame"]["pose"]["position"], view["frame"]["pose"]["orientation"])
            self.give(view["frame"]["scale"], view["frame"]["force_scale"])
            self.give(view["tool"]["position"], view["tool"]["orientation"])
            self.give(view["held"], view["point_radius"], view["points"][: view["point_count"]])

    def do_servo(self):
        if not self.connected:
            self.start()

    def do_settle(self):
        for scene in [self.scene, *self.scenes.values()]:
            for patience in range(10000):
                self.servo.step(10)
                with contextlib.suppress(fs.TimeoutError):
                    scene.sync(1e-3)
                    break
        self.servo.step(5000)

    def do_enable(self, enabled):
        self.servo.set_enabled(enabled)

    def do_record(self):
        record = self.servo.record
        self.give(len(record))
        for tick in record[-3:]:
            for pair in (tick["state"]["pose"], tick["response"]["wrench"], tick["sent"]):
                self.give(*(pair[name] for name in pair.dtype.names))
            self.give(tick["device"], tick["faults"])

    def do_scene_record(self):
        record = self.scene.get_record(0)
        self.give(len(record))
        newest = self.scene.get_record(record[-1]["number"] - 3)
        self.give(len(newest))
        for each in newest:
            tick = each["tick"]
            for pair in (tick["state"]["pose"], tick["response"]["wrench"], tick["sent"]):
                self.give(*(pair[name] for name in pair.dtype.names))
            self.give(each["number"] - newest[0]["number"])

    def do_stats(self):
        t = self.scene.get_servo_stats()
        self.give(int(t.realtime), int(t.faults), int(t.protections_off), t.max_stiffness, t.damping)
        self.give(t.misses, t.device_errors, t.approximated, t.enabled, t.ticks > 5000, t.energy > 0)

    def do_stop_force(self):
        self.scene.stop_force()

    def do_resume_force(self):
        self.scene.resume_force()

    def do_device(self, opened=False):
        d = self.device.get_info() if opened else self.scene.get_device_info()
        self.give(d.name, d.serial, d.force_axes, d.torque_axes, d.workspace_radius, d.workspace_height)
        self.give(d.workspace_angle, d.force_max, d.torque_max, d.resolution, d.rate, d.delay, d.damping, d.mass)
        self.give(d.link_rate, d.controller_rate, d.controller_delay, d.controller_damping, d.watchdog)

    def do_devices(self):
        self.give(*(entry.label for entry in fs.devices() if entry.uri == "sim:"))

    def do_device_read(self):
        state = self.device.read()
        self.give_pose(state.pose)
        self.give(int(state.flags))

    def do_device_write(self, force):
        self.device.write(fs.Wrench(force=force))

    def do_device_control(self, request):
        self.give(self.device.control(request).text)

    def do_drivers(self):
        for driver in fs.drivers():
            if driver.scheme == "sim":
                self.give(driver.path, driver.trouble)

    def do_state_reason(self, flags):
        self.give(fs.state_reason(flags))

    def do_driver(self, file):
        fs.driver_load(file)

    def do_hand(self):
        hand = self.scene.hand()
        self.give_pose(hand.state.pose)
        self.give_two(hand.response.wrench)
        self.give_two(hand.sent)

    def do_save(self, file):
        self.scene.save(self.folder / file)

    def do_load(self, file):
        self.scene.load(self.folder / file)


with open(sys.argv[1]) as scenario_file:
    scenario = json.load(scenario_file)
with contextlib.ExitStack() as stack:
    Player(scenario, sys.argv[2] == "connected", sys.argv[3], stack).play(scenario["steps"])
