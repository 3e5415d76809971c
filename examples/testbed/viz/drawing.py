"""Hazards are drawn on the ground with the mouse: a click for each node, the first node again to close the border. Nodes can be moved
afterwards; Delete takes away the node below the mouse."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import vtk  # type: ignore[import-untyped]
from virtualrobot.ground import Array

from .picture import Picture


class Drawing:
    """One border at a time is being drawn; those that are closed stay, each with its own name.

    closed: is called with a border (its name, or None for a new one, and its nodes), and gives the name of the hazard; None: it cannot
    be one, and is dropped, or stays as it was.
    """

    def __init__(self, picture: Picture, closed: Callable[[str | None, Array], str | None]) -> None:
        self.picture, self.closed = picture, closed
        self.interactor = picture.plotter.iren.interactor
        self.locator = vtk.vtkStaticCellLocator()  # without it a click takes two seconds
        self.locator.SetDataSet(picture.ground)
        self.locator.BuildLocator()
        self.widgets: dict[Any, str | None] = {}  # the name of each border; None: it is being drawn
        self.pen: Any = None

    def begin(self) -> None:
        """The next click is the first node of a new border."""
        if self.pen is not None:
            return
        placer = vtk.vtkPolygonalSurfacePointPlacer()
        placer.AddProp(self.picture.ground_actor)
        placer.GetPolys().AddItem(self.picture.ground)
        placer.GetCellPicker().AddLocator(self.locator)
        placer.GetCellPicker().SetTolerance(0)
        shown = vtk.vtkOrientedGlyphContourRepresentation()
        shown.SetPointPlacer(placer)
        shown.GetLinesProperty().SetColor(1, 1, 1)
        shown.GetLinesProperty().SetLineWidth(2)
        widget = vtk.vtkContourWidget()
        widget.SetInteractor(self.interactor)
        widget.SetRepresentation(shown)
        widget.AddObserver("EndInteractionEvent", lambda *_: self._look(widget))
        widget.On()
        self.widgets[widget] = None
        self.pen = widget

    def give_up(self) -> None:
        """What is being drawn is dropped."""
        if self.pen is not None:
            self._drop(self.pen)

    def take_away(self, name: str) -> None:
        for widget in [one for one, its in self.widgets.items() if its == name]:
            self._drop(widget)

    def nodes(self, widget: Any) -> Array:
        shown, out = widget.GetRepresentation(), []
        for i in range(shown.GetNumberOfNodes()):
            place = [0.0, 0.0, 0.0]
            shown.GetNthNodeWorldPosition(i, place)
            out.append(place)
        return np.array(out).reshape(-1, 3)

    def _look(self, widget: Any) -> None:
        """A border was closed, or a node of it was moved or taken away."""
        if not widget.GetRepresentation().GetClosedLoop():
            return
        before = self.widgets[widget]
        name = self.closed(before, self.nodes(widget))
        if name is not None:
            self.widgets[widget] = name
        if widget is self.pen:
            self.pen = None
            if name is None:
                self._drop(widget)

    def _drop(self, widget: Any) -> None:
        widget.Off()
        self.widgets.pop(widget, None)
        if widget is self.pen:
            self.pen = None
