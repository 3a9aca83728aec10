# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Markers: the linkage for RViz and Foxglove, on a separate topic, at its own rate.

They show the solved mechanism, without the effects of sensors. With the time t of the tick and the
rate f of the markers, a message is published at the first tick at which::

    ⌊t·f⌋ ≠ ⌊t′·f⌋

t′ is the time of the last message. Only the times of the ticks decide, so that a replay gives the
same messages. Still markers come with the first message of each second. A marker disappears after
its lifetime, so that a silent linkage does not look like one that stands still.

Forces are arrows; see `linkage_ros.stages.effects.marker_pile`.

Links are red while the conditioning of their group (see
`linkage_ros.kinematics.analysis.singularity_margin`) is below √2·sin(μ/2), with the threshold μ:
for a dyad, while its transmission angle is smaller than μ. Where a loop does not close there is no
pose: moving markers are deleted, and a text shows the closure error.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from math import pi, radians, sin, sqrt
from typing import Any

from linkage_ros.description import number, text
from linkage_ros.kinematics import GROUND, PlanarClosure, Position, Status, usual_inputs
from linkage_ros.messages import DELETE, MarkerArrayWriter, NANOSECONDS, Place
from linkage_ros.stages.drives import Context
from linkage_ros.stages.effects.effect import MessageEffect
from linkage_ros.stages.effects.marker_pile import Arrows, MarkersWanted
from linkage_ros.stages.effects.marker_shapes import PlanarMarkers
from linkage_ros.stages.effects.stage import MechanismState, SensorReading, Writer

_LONGEST_TRAIL = 2000


@dataclass(frozen=True, slots=True)
class MarkersEffect(MessageEffect):
    """The linkage drawn for RViz and Foxglove, on ~/markers."""

    rate: float = number('messages a second, at most', 30.0, unit='Hz', least=0.01, most=1000.0)
    frame: str = text("frame of the markers, instead of the ground's", '')
    thickness: float = number(
        'width of a bar, as a fraction of the workspace; 0: a suitable one',
        0.0,
        least=0.0,
        most=0.5,
    )
    trace: float = number(
        'duration of the trail of a traced point; 0: its whole curve, with one input',
        0.0,
        unit='s',
        least=0.0,
        most=60.0,
    )
    force_scale: float = number(
        'length of an arrow for a force; 0: by its logarithm', 0.0, unit='m/N', least=0.0, most=1e6
    )
    near_toggle: float = number(
        'transmission angle below which links are red',
        radians(10.0),
        unit='rad',
        least=0.0,
        most=0.5 * pi,
    )

    topic = '~/markers'
    message = 'visualization_msgs/msg/MarkerArray'

    @property
    def is_recoverable(self) -> bool:
        """Return whether it draws no trail."""
        return not self.trace

    def writer(self, context: Context) -> Writer:
        """Build the writer of the message."""
        return Markers(self, context)


class Markers:
    """The markers of a linkage, at their own rate."""

    __slots__ = (
        '_arrows', '_closure', '_figure', '_frame', '_full', '_moving', '_near', '_per', '_pile',
        '_second', '_slot', '_trails', '_unit',
    )  # fmt: skip

    def __init__(self, use: MarkersEffect, context: Context) -> None:
        self._closure = closure = context.closure
        self._unit, denominator = use.rate.as_integer_ratio()
        self._per = NANOSECONDS * denominator
        self._slot = self._second = -1
        self._frame = use.frame or context.prefix + GROUND
        named = context.effects
        trail = min(round(use.trace * use.rate) + 1, _LONGEST_TRAIL) if use.trace else 0
        wanted = MarkersWanted(
            use.thickness,
            trail,
            context.reactions.joints if 'pin_forces' in named else (),
            closure.linkage.inputs if 'effort' in named else (),
            _marker_lifetimes(use, context),
        )
        self._figure = figure = _markers_of(closure, wanted)
        self._pile = pile = figure.pile
        mass = sum(body.mass for body in closure.linkage.masses.values())
        self._arrows = Arrows(use.force_scale, mass, pile)
        self._moving = MarkerArrayWriter(self._frame, pile.markers)
        self._full = MarkerArrayWriter(self._frame, (*pile.markers, *pile.still))
        self._trails: list[deque[Place]] = [deque(maxlen=trail) for _ in pile.trails]
        self._near = sqrt(2.0) * sin(0.5 * use.near_toggle)
        # Search once here, not in a tick.
        closure.singularity_margin(closure.position(*usual_inputs(closure)))

    def __call__(self, now: int, motion: MechanismState, _reading: SensorReading) -> bytes:
        """Return a message; b'' between two messages."""
        if not self.due(now):
            return b''
        self._slot = now * self._unit // self._per
        position = motion.position
        full = self._still_due(now)
        write, pile = self._full if full else self._moving, self._pile
        placed = self._figure.place(write, position, self._links_near_toggle(position))
        # Without trails there are none of the traced points.
        for marker, place, trail in zip(pile.trails, placed.traced, self._trails, strict=False):
            trail.append(place)
            # A line has its full number of points from the start.
            write.move_points(marker, [*trail, *(place,) * (trail.maxlen or 0)][: trail.maxlen])
        # Other effects may need forces that no marker shows.
        forces = (motion.reactions or [(0.0,)] * len(pile.forces)) if pile.forces else ()
        axes = len(self._closure.linkage.axes)
        for marker, start, wrench in zip(pile.forces, placed.joints, forces, strict=True):
            # Behind the force of a wrench there is its moment.
            fx, fy, fz, *_ = (*wrench[:axes], 0.0, 0.0, 0.0)
            _show_arrow(write, marker, self._arrows.force_arrow(start, (fx, fy, fz)))
        efforts = (motion.efforts or [0.0] * len(pile.efforts)) if pile.efforts else ()
        for marker, arm, effort in zip(pile.efforts, placed.drives, efforts, strict=True):
            _show_arrow(write, marker, self._arrows.effort_arrow(arm, effort))
        write.show_marker(pile.status, False)
        return write.message_at(now)

    def due(self, now: int) -> bool:
        """Return whether a message is due at a time, in [ns]."""
        return now * self._unit // self._per != self._slot

    def no_pose(self, now: int, position: Position) -> bytes:
        """Return a message without a pose; b'' between two messages."""
        if not self.due(now):
            return b''
        self._slot = now * self._unit // self._per
        for trail in self._trails:
            trail.clear()
        said = f'{position.status.value}: no pose'
        if position.status is Status.OPEN:
            said = f'open: the links miss each other by {position.gap:.3g} m'
        elif position.status is Status.LIMITED:
            said = 'limited: a joint is beyond its limits'
        pile = self._pile
        markers = [
            marker._replace(text=said)
            if index == pile.status
            else marker._replace(points=(), action=DELETE)
            for index, marker in enumerate(pile.markers)
        ]
        if self._still_due(now):
            markers += pile.still
        return MarkerArrayWriter(self._frame, markers).message_at(now)

    def _still_due(self, now: int) -> bool:
        """Return whether the still markers are due."""
        before, self._second = self._second, now // NANOSECONDS
        return before != self._second

    def _links_near_toggle(self, position: Position) -> frozenset[str]:
        """Return the links near a toggle."""
        nearness = self._closure.singularity_margin(position)
        near = nearness.conditioning < self._near and nearness.group >= 0
        return self._figure.groups[nearness.group] if near else frozenset()


def _markers_of(closure: Any, wanted: MarkersWanted) -> Any:
    """Return the markers of a linkage in the plane or in space."""
    if isinstance(closure, PlanarClosure):
        return PlanarMarkers(closure, wanted)
    from linkage_ros.stages.effects.spatial_markers import (
        SpatialMarkers,  # local import: loads numpy
    )

    return SpatialMarkers(closure, wanted)


def _show_arrow(write: MarkerArrayWriter, marker: int, drawn: list[Place]) -> None:
    write.show_marker(marker, bool(drawn))
    write.move_points(marker, drawn)


def _marker_lifetimes(use: MarkersEffect, context: Context) -> tuple[int, int]:
    """
    Return the lifetimes of moving and of still markers, in [ns].

    Three periods of the message, but at least a second; without limit if ticks come with samples
    only, since their period is unknown.
    """
    if not context.rate:
        return 0, 0
    period = 1.0 / min(use.rate, context.rate)
    moves = max(1.0, 3.0 * period)
    return round(moves * NANOSECONDS), round(max(3.0, moves) * NANOSECONDS)
