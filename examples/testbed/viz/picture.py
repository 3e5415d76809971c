"""What VIZ shows: the ground, the rover and its arm, the hand, the force of each client, the hazards of all. x: east, y: north; m."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv
import vtk  # type: ignore[import-untyped]
from virtualrobot.ground import Array, Ground

size = [1000, 640]  # pixels
colours = ("#e41a1c", "#377eb8", "#ff7f00", "#984ea3", "#4daf4a", "#a65628", "#f781bf", "#00ced1")


class NoPicture(Exception):
    """There is neither a display nor another way to draw."""


def can_draw() -> bool:
    """Whether there is OpenGL without a display. Where there is none VTK crashes, so another process tries it."""
    tries = "import pyvista; p = pyvista.Plotter(off_screen=True); p.show(auto_close=False); p.close()"
    return subprocess.run([sys.executable, "-c", tries], capture_output=True).returncode == 0


def transform(position: Array, orientation: Array) -> Array:
    """Of a pose (m; w, x, y, z), shape (4, 4)."""
    w, x, y, z = orientation
    out = np.eye(4)
    out[:3, :3] = [[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                   [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                   [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]]  # fmt: skip
    out[:3, 3] = position
    return out


def along(vector: Array, at: Array, length: float) -> Array:
    """The transform of pv.Arrow, which is along its x axis and 1 long."""
    x = vector / np.linalg.norm(vector)
    aside = np.eye(3)[np.argmin(np.abs(x))]
    y = np.cross(x, aside)
    y /= np.linalg.norm(y)
    out = np.eye(4)
    out[:3, :3] = length * np.stack([x, y, np.cross(x, y)], axis=1)
    out[:3, 3] = at
    return out


def model_of_rover() -> Any:
    """Its middle is between the wheels."""
    parts = [pv.Box((-0.45, 0.45, -0.3, 0.3, 0.23, 0.47))]
    for x in (-0.6, 0, 0.6):
        parts += [pv.Cylinder(center=(x, y, 0), direction=(0, 1, 0), radius=0.18, height=0.18) for y in (-0.52, 0.52)]
    parts += [pv.Box((-0.62, 0.62, y - 0.03, y + 0.03, -0.03, 0.06)) for y in (-0.4, 0.4)]  # rockers, and what holds them
    parts += [pv.Box((-0.05, 0.15, -0.43, 0.43, 0.25, 0.33)), *(pv.Box((0.02, 0.08, y - 0.03, y + 0.03, 0, 0.3)) for y in (-0.4, 0.4))]
    return pv.merge([part.triangulate() for part in parts]).extract_surface(algorithm=None)


class Picture:
    """is_near: of the rover and what is around it; otherwise of the whole map, on which rover, hand and forces are drawn larger."""

    def __init__(self, ground: Ground, *, off_screen: bool, is_near: bool = False) -> None:
        self.metres_a_newton = 0.3 if is_near else 3.0
        self.looked_at = np.zeros(3)
        if not off_screen and not os.environ.get("DISPLAY") and not os.environ.get("WAYLAND_DISPLAY"):
            raise NoPicture("there is no display (DISPLAY is not set); --off-screen FILE draws into a file")
        if off_screen and not can_draw():
            raise NoPicture("nothing here can draw with OpenGL (Debian: libegl1 libgl1-mesa-dri)")
        vtk.vtkLogger.SetStderrVerbosity(vtk.vtkLogger.VERBOSITY_ERROR)  # else it warns that there is no display
        self.plotter: Any = pv.Plotter(off_screen=off_screen, window_size=size, title="VIZ")
        window: Any = self.plotter.render_window
        if not off_screen and "EGL" in window.GetClassName():
            raise NoPicture(f"the display {os.environ.get('DISPLAY')} cannot be opened")
        window.SetMultiSamples(0)  # without a graphics card antialiasing takes three times as long
        points, triangles = ground.mesh()
        self.ground = pv.PolyData.from_regular_faces(points, triangles.astype(int))
        self.ground["height"] = points[:, 2]
        self.ground.compute_normals(cell_normals=False, split_vertices=False, consistent_normals=False, inplace=True)
        look: dict[str, Any] = {"scalars": "height", "cmap": "copper", "show_scalar_bar": False}
        self.ground_actor = self.plotter.add_mesh(self.ground, name="ground", **look)
        self.rover = self.plotter.add_mesh(model_of_rover().scale(1.0 if is_near else 2.0), color="#f0e6c8", name="rover")
        self.arm_line = self.plotter.add_mesh(pv.Line(), color="#d98c21", line_width=5, name="arm")
        # The hand and its forces are drawn over all else, as they are also below the ground.
        self.top = vtk.vtkRenderer()
        self.top.SetLayer(1)
        self.top.InteractiveOff()
        self.top.SetActiveCamera(self.plotter.camera)
        window.SetNumberOfLayers(2)
        window.AddRenderer(self.top)
        self.hand = self._add_to_top(pv.Sphere(radius=0.04 if is_near else 0.6), "white")
        for one in (self.rover, self.arm_line, self.hand):
            one.SetVisibility(False)
        self.arrows: dict[str, Any] = {}
        self.lines: dict[str, Any] = {}
        self.colours: dict[str, str] = {}
        self.trail = self.plotter.add_mesh(pv.Line(), color="#f0e6c8", line_width=2, name="trail")
        self.trail.SetVisibility(False)
        self.chart = pv.Chart2D(size=(0.4, 0.26), loc=(0.01, 0.02), x_label="s", y_label="N at the hand")
        self.chart.background_color = (255, 255, 255, 200)
        self.chart.legend_visible = True
        self.chart.visible = False
        self.plotter.add_chart(self.chart)
        self.curves: dict[str, Any] = {}
        self.words = self.plotter.add_text("", position="upper_left", font_size=9, name="words")
        self.words.prop.background_color, self.words.prop.background_opacity = "white", 0.7
        self.plotter.renderer.add_axes(xlabel="east", ylabel="north", zlabel="", viewport=(0.86, 0.8, 1, 1))
        self.plotter.camera_position = [(0, -1.8 * ground.half[1], 1.9 * ground.half[1]), (0, -0.1 * ground.half[1], 0), (0, 0, 1)]
        if is_near:
            self.plotter.camera_position = [(2.4, -2.8, 2.2), (0.5, 0, 0.3), (0, 0, 1)]
        self.plotter.show(auto_close=False, interactive=False, interactive_update=not off_screen)

    def _add_to_top(self, mesh: Any, colour: str) -> Any:
        actor = pv.Actor(mapper=pv.DataSetMapper(mesh))
        actor.prop.color = colour
        self.top.AddActor(actor)
        return actor

    def look_at(self, place: Array) -> None:
        """Goes along with what is in the middle of the picture, as the person has turned it."""
        by = place - self.looked_at
        camera = self.plotter.camera
        camera.position, camera.focal_point = tuple(camera.position + by), tuple(camera.focal_point + by)
        self.looked_at = place
        self.plotter.renderer.ResetCameraClippingRange()

    def show_rover(self, place: Array | None) -> None:
        """place: its transform."""
        self.rover.SetVisibility(place is not None)
        if place is not None:
            self.rover.user_matrix = place

    def show_arm(self, points: Array) -> None:
        """From the shoulder to the tip; none: there is no arm."""
        self.arm_line.SetVisibility(len(points) > 1)
        if len(points) > 1:
            self.arm_line.mapper.SetInputData(pv.lines_from_points(points))

    def colour_of(self, client: str) -> str:
        return self.colours.setdefault(client, colours[len(self.colours) % len(colours)])

    def show_trail(self, points: Array) -> None:
        """Where the rover has driven."""
        self.trail.SetVisibility(len(points) > 1)
        if len(points) > 1:
            self.trail.mapper.SetInputData(pv.lines_from_points(points + [0, 0, 0.1]))

    def show_history(self, times: Array, newtons: dict[str, Array]) -> None:
        """How hard each client pushed; times: s, the newest is 0."""
        self.chart.visible = bool(newtons)
        for name in self.curves.keys() - newtons.keys():
            self.chart.remove_plot(self.curves.pop(name))
        for name, values in newtons.items():
            if name in self.curves:
                self.curves[name].update(times, values)
            else:
                self.curves[name] = self.chart.line(times, values, color=self.colour_of(name), label=name)

    def show_hand(self, place: Array | None) -> None:
        self.hand.SetVisibility(place is not None)
        if place is not None:
            self.hand.position = place

    def show_forces(self, at: Array | None, forces: dict[str, Array]) -> None:
        """An arrow for each client, at the hand; N at the device."""
        for name, force in forces.items():
            newtons = float(np.linalg.norm(force))
            if name not in self.arrows:
                arrow = pv.Arrow(tip_length=0.25, tip_radius=0.06, shaft_radius=0.025)
                self.arrows[name] = self._add_to_top(arrow, self.colour_of(name))
            self.arrows[name].SetVisibility(at is not None and newtons > 0.02)
            if at is not None and newtons > 0.02:
                self.arrows[name].user_matrix = along(force, at, self.metres_a_newton * newtons)
        for name in self.arrows.keys() - forces.keys():
            self.arrows[name].SetVisibility(False)

    def show_rock(self, name: str, points: Array, triangles: Array) -> None:
        rock = pv.PolyData.from_regular_faces(points, triangles.astype(int))
        self.plotter.add_mesh(rock, color="#73594a", name=name, render=False)

    def remove(self, name: str) -> None:
        self.plotter.remove_actor(name, render=False)

    def show_line(self, name: str, line: Array, colour: str) -> None:
        look: dict[str, Any] = {"color": colour, "line_width": 4, "render": False}
        self.lines[name] = self.plotter.add_mesh(pv.lines_from_points(line), name=f"line {name}", **look)

    def place_line(self, name: str, place: Array) -> None:
        """place: from the line to the map. It is drawn a little higher, so that the ground does not hide it."""
        raised = place.copy()
        raised[2, 3] += 0.05
        self.lines[name].user_matrix = raised

    def remove_line(self, name: str) -> None:
        del self.lines[name]
        self.plotter.remove_actor(f"line {name}", render=False)

    def show_reach(self, name: str, lines: list[Array]) -> None:
        """Up to where a border pushes, as thin lines; none takes them away."""
        self.plotter.remove_actor(f"reach {name}", render=False)
        if lines:
            whole = pv.merge([pv.lines_from_points(line + [0, 0, 0.05]) for line in lines])
            self.plotter.add_mesh(whole, color="white", opacity=0.5, line_width=1, name=f"reach {name}", render=False)

    def show_words(self, text: str) -> None:
        self.words.SetText(2, text)

    def go_on(self) -> None:
        """Draws, and takes what the person does."""
        self.plotter.update(1, force_redraw=True)

    @property
    def is_closed(self) -> bool:
        """By q, or with its window."""
        return bool(self.plotter.iren.interactor.GetDone())

    def colours_seen(self) -> int:
        self.plotter.render()
        image = self.plotter.screenshot(return_img=True)
        return len(np.unique(image.reshape(-1, 3), axis=0))

    def save(self, path: Path) -> None:
        """As a PNG file, which is whole at any time."""
        self.plotter.render()
        fresh = path.with_suffix(f".{os.getpid()}.png")
        self.plotter.screenshot(fresh)
        os.replace(fresh, path)

    def close(self) -> None:
        self.plotter.close()
