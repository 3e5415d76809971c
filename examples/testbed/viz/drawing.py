"""Hazards are drawn on the ground with the mouse: a click for each node, the first node again to close the border. Nodes can be moved
afterwards; Delete takes away the node below the mouse."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import vtk  # type: ignore[import-untyped]
from virtualrobot.ground import Array

from .picture import Picture


class Border:
    """One border in the picture. name: of its hazard; None: it is being drawn. nodes: as its hazard has them."""

    def __init__(self, widget: Any) -> None:
        self.widget, self.name = widget, None  # type: Any, str | None
        self.nodes = np.zeros((0, 3))

    @property
    def drawn(self) -> Array:
        """Its nodes in the picture, m on the map."""
        shown, out = self.widget.GetRepresentation(), []
        for i in range(shown.GetNumberOfNodes()):
            place = [0.0, 0.0, 0.0]
            shown.GetNthNodeWorldPosition(i, place)
            out.append(place)
        return np.array(out).reshape(-1, 3)

    def put_back(self) -> None:
        """Shows the nodes of its hazard."""
        shown = self.widget.GetRepresentation()
        shown.ClearAllNodes()
        for place in self.nodes:
            shown.AddNodeAtWorldPosition(*place)
        shown.ClosedLoopOn()
        shown.BuildRepresentation()


class Drawing:
    """closed: is called when a border is closed or changed, with its name (None: it is new) and its nodes, and gives the name of
    the hazard; None: it cannot be one, and what was there stays. say: is told why a click counts for nothing."""

    def __init__(self, picture: Picture, closed: Callable[[str | None, Array], str | None], say: Callable[[str], None]) -> None:
        self.picture, self.closed, self.say = picture, closed, say
        self.interactor = picture.plotter.iren.interactor
        self.locator = vtk.vtkStaticCellLocator()  # without it a click takes two seconds
        self.locator.SetDataSet(picture.ground)
        self.locator.BuildLocator()
        self.borders: list[Border] = []
        self.pen: Border | None = None  # what is being drawn

    def begin(self) -> None:
        """The next click is the first node of a new border."""
        if self.pen is None:
            self.pen = self._make()

    def give_up(self) -> None:
        """What is being drawn is dropped."""
        if self.pen is not None:
            self._drop(self.pen)

    def show(self, name: str, nodes: Array) -> None:
        """A hazard that was loaded, or edited elsewhere."""
        border = next((one for one in self.borders if one.name == name), None) or self._make()
        border.name, border.nodes = name, nodes
        border.widget.SetWidgetState(vtk.vtkContourWidget.Manipulate)
        border.put_back()

    def take_away(self, name: str) -> None:
        for border in [one for one in self.borders if one.name == name]:
            self._drop(border)

    def _make(self) -> Border:
        placer = vtk.vtkPolygonalSurfacePointPlacer()
        placer.AddProp(self.picture.ground_actor)
        placer.GetPolys().AddItem(self.picture.ground)
        placer.GetCellPicker().AddLocator(self.locator)
        placer.GetCellPicker().SetTolerance(0)
        shown = vtk.vtkOrientedGlyphContourRepresentation()
        shown.SetPointPlacer(placer)
        shown.SetLineInterpolator(vtk.vtkLinearContourLineInterpolator())  # straight, as the border is
        shown.GetLinesProperty().SetColor(1, 1, 1)
        shown.GetLinesProperty().SetLineWidth(2)
        widget = vtk.vtkContourWidget()
        widget.SetInteractor(self.interactor)
        widget.SetRepresentation(shown)
        border = Border(widget)
        widget.AddObserver("EndInteractionEvent", lambda *_: self._look(border))
        widget.AddObserver("InteractionEvent", lambda *_: self._look_between(border))
        widget.On()
        self.borders.append(border)
        return border

    def _look_between(self, border: Border) -> None:
        """A node of what is being drawn was placed, or a node of a border is moved or was taken away."""
        if border is self.pen:
            self._look_for_two(border)
        elif len(border.drawn) != len(border.nodes):
            self._look(border)

    def _look_for_two(self, border: Border) -> None:
        """A third node in the place of the first would be seen by nobody."""
        shown = border.widget.GetRepresentation()
        if shown.GetNumberOfNodes() != 3:
            return
        first, third = [0.0, 0.0], [0.0, 0.0]
        shown.GetNthNodeDisplayPosition(0, first)
        shown.GetNthNodeDisplayPosition(2, third)
        if np.hypot(first[0] - third[0], first[1] - third[1]) < shown.GetPixelTolerance():
            shown.DeleteLastNode()
            self.say("a border needs three nodes before it can be closed")

    def _look(self, border: Border) -> None:
        """The border was closed, or a node of it was moved or taken away."""
        if border is self.pen and not border.widget.GetRepresentation().GetClosedLoop():
            return
        nodes = border.drawn
        name = self.closed(border.name, nodes)
        if name is not None:
            border.name, border.nodes = name, nodes
        elif border is self.pen:
            self._drop(border)
        else:
            border.put_back()
        if border is self.pen:
            self.pen = None

    def _drop(self, border: Border) -> None:
        border.widget.Off()
        self.borders = [one for one in self.borders if one is not border]
        if border is self.pen:
            self.pen = None
