# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The content of ~/markers, drawn from the messages alone, as in RViz."""

from __future__ import annotations

from typing import Any

from linkage_ros.stages.effects import MarkersEffect
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle, FancyArrowPatch
from matplotlib.patheffects import Normal, Stroke
import numpy as np
from rosbags.typesys import get_typestore, Stores

from .paper import empty_sheet, GREEN, PURPLE
from .runs import extra_messages, Scene, Values

_STORE = get_typestore(Stores.ROS2_JAZZY)
_ARROW, _LINE_STRIP, _LINE_LIST, _SPHERE_LIST, _TEXT, _TRIANGLES = 0, 4, 5, 7, 9, 11
_DELETE = 2

Display = dict[tuple[str, int], Any]
"""The displayed markers, by namespace and id."""

_MOMENTS = ((0.0, 'far from a toggle'), (1.17, 'near one'), (1.5, 'beyond it: open'))
_INCH = 72.0


def markers(scene: Scene) -> Figure:
    """Draw the display at three times of a run."""
    figure = empty_sheet()
    figure.set_size_inches(8.0, 7.4)
    grid = figure.add_gridspec(2, 2, height_ratios=(1.7, 1.0))
    axes = [figure.add_subplot(place) for place in (grid[0, :], grid[1, 0], grid[1, 1])]
    lines: list[tuple[Any, float]] = []
    for place, (moment, label) in zip(axes, _MOMENTS, strict=True):
        shown: Display = {}
        for message in extra_messages(scene, MarkersEffect.message, moment):
            receive(shown, message)
        lines += show(place, shown, 2.4 if place is axes[0] else 1.5)
        place.set_xlim(-0.85, 1.65)
        place.set_ylim(-0.75, 0.85)
        place.set_title(f'{moment:g} s, {label}')
        place.set_ylabel('y [m]')
        place.set_xlabel('x [m]')
    for colour, label in ((PURPLE, 'force in a pin'), (GREEN, 'effort of the drive')):
        axes[0].plot([], [], color=colour, linewidth=2.4, label=label)
    axes[0].legend(loc='lower right')
    figure.draw_without_rendering()  # fixes the scale of the axes
    for line, width in lines:
        (low, _), (high, _) = line.axes.transData.transform(((0.0, 0.0), (1.0, 0.0)))
        line.set_linewidth(width * (high - low) * _INCH / figure.dpi)
    return figure


def receive(shown: Display, message: bytes) -> None:
    """Add, replace or delete the markers of a message in CDR."""
    for marker in _STORE.deserialize_cdr(message, MarkersEffect.message).markers:
        key = marker.ns, marker.id
        if marker.action == _DELETE:
            shown.pop(key, None)
        else:
            shown[key] = marker


def show(axes: Any, shown: Display, width: float) -> list[tuple[Any, float]]:
    """Draw the markers, arrows with a width in points; return the lines with theirs in [m]."""
    drawn: list[tuple[Any, float]] = []
    axes.set_aspect('equal')
    axes.grid(False)
    for marker in shown.values():
        places, height = _placed(marker)
        style = {'color': _colour(marker), 'zorder': 10.0 + 1e3 * height}
        if marker.ns in ('forces', 'efforts'):
            style['zorder'] = 3e4
        if marker.type == _TRIANGLES:
            triangles = places.reshape(-1, 3, 2)
            faces = PolyCollection(triangles, facecolors=[style['color']], zorder=style['zorder'])
            axes.add_collection(faces)
        elif marker.type in (_LINE_STRIP, _LINE_LIST):
            lines = [places] if marker.type == _LINE_STRIP else places.reshape(-1, 2, 2)
            drawn += [(axes.plot(*line.T, **style)[0], marker.scale.x) for line in lines]
        elif marker.type == _SPHERE_LIST:
            for place in places:
                axes.add_patch(Circle(place, 0.5 * marker.scale.x, linewidth=0.0, **style))
        elif marker.type == _ARROW:
            # A white edge sets them off from the links.
            edge = [Stroke(linewidth=2.0 * width, foreground='white'), Normal()]
            look = {'arrowstyle': '-|>', 'mutation_scale': 6.0 * width, 'linewidth': width}
            look |= {**style, 'path_effects': edge}
            axes.add_patch(FancyArrowPatch(*places, shrinkA=0.0, shrinkB=0.0, **look))
        elif marker.type == _TEXT:
            axes.text(*places[0], marker.text, ha='center', va='center', fontsize=7, **style)
    return drawn


def _placed(marker: Any) -> tuple[Values, float]:
    """Return the points of a marker in the plane of its frame, and their greatest height."""
    position, turn = marker.pose.position, marker.pose.orientation
    angle = 2.0 * np.arctan2(turn.z, turn.w)
    points = np.array([(p.x, p.y, p.z) for p in marker.points] or [(0.0, 0.0, 0.0)])
    cos, sin = np.cos(angle), np.sin(angle)
    turned = points[:, :2] @ np.array([[cos, sin], [-sin, cos]])
    return turned + np.array((position.x, position.y)), position.z + float(points[:, 2].max())


def _colour(marker: Any) -> tuple[float, ...]:
    colour = marker.color
    return colour.r, colour.g, colour.b, colour.a


PICTURES = {'markers': markers}
"""The function that draws the picture of each section."""
