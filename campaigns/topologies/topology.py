# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Linkages of any topology, made from a pose, and followed from it by their equations.

Links and dyads are those of the accuracy campaign's builder. In addition, inputs turn or slide,
act on the ground, on each other or between moving links, and there are Assur groups of class III.
Every linkage closes at the inputs of its pose.

A step along the motion is predicted by rates and accelerations and corrected by Newton's method.
It is accepted if the correction is small compared with the step and the determinant keeps its
sign; otherwise it is halved. If a step becomes too small, the linkage is at its limit.
"""

from __future__ import annotations

from cmath import phase
from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import tau
import random
from typing import Any, NamedTuple

from campaigns.accuracy.dyads import PRP, RPP, RPR, RRP, RRR
from campaigns.accuracy.mechanism import Dyad, polar, Spot
from campaigns.accuracy.random_families import add_random, Builder
from campaigns.topologies.constraints import Array, Equations, Real
from campaigns.topologies.geometry import DrivenLink, DrivenRRR, Group, Passing
from linkage_ros.kinematics import (
    AssemblyPose,
    GROUND,
    Input,
    Linkage,
    RevoluteJoint,
    Side,
    SlideJoint,
)
import numpy as np


@dataclass(frozen=True, slots=True)
class Topology:
    """A linkage, and the knowledge of its generator about it."""

    linkage: Linkage  # The linkage, in the package's terms
    # Inputs and dyads in the order of solution; None with an Assur group that is no dyad.
    groups: tuple[Group, ...] | None
    # For the pin or slider that closes a dyad +1 (left, ahead) or −1, or a side that changes.
    sides: Mapping[str, int | Passing]
    start: tuple[float, ...]  # Inputs at which it closes by construction, in [rad] or [m]
    pose: Mapping[str, tuple[float, float, float]]  # Angle and position of each moving link there
    step: tuple[float, ...]  # A small change of each input: 0.3 rad, or 0.3 of a length
    # Inputs within a turn at which the linkage passes an exact change point.
    change_points: tuple[float, ...] = ()


class TopologyBuilder(Builder):
    """Builds a random linkage of any topology; whether its frames are plain is drawn, or given."""

    def __init__(self, rng: random.Random, plain: bool | None = None) -> None:
        super().__init__(rng, 0.0, rng.random() < 0.5 if plain is None else plain)
        self.inputs: list[Input] = []
        self._start: list[float] = []
        self._step: list[float] = []
        self._groups: list[Group] = []
        self._sides: dict[str, int] = {}
        self._assembly: dict[str, Side] = {}
        self._rank = {GROUND: 0}
        self._pose_points: dict[str, complex] = {}
        self.put(GROUND, 'O', 0j)

    def is_first(self) -> bool:
        """Return False: with lines along axes two lines might be parallel at every input."""
        return False

    def parent(self) -> str:
        """Return the parent link for a published angle; `topology` publishes all angles anyway."""
        return GROUND

    def add(self, dyad: Dyad, *joints: RevoluteJoint | SlideJoint) -> None:
        """Add a dyad with its assembly as the conventions name it."""
        super().add(dyad, *joints)
        group: Any = dyad
        if isinstance(group, RRR):
            ends = (group.a, group.d), (group.one, group.two)
            self._name_side(ends[0], ends[1], group.pin)
        elif isinstance(group, RRP | RPR):
            self._sides[group.slider] = group.side
            self._assembly[group.slider] = 'ahead' if group.side > 0 else 'behind'
        self._known(group)

    def slide(self, line: complex, along: str, through: str, point: str, block: str) -> str:
        """Add a slider by its direction in the pose; its block may have any angle to the line."""
        name = super().slide(line, along, through, point, block)
        if block and self.axis(block) != self.axis(along):
            turn = phase(self.axis(block) * self.axis(along).conjugate())
            self._sliders[name] = replace(self._sliders[name], angle=turn)
        return name

    def _name_side(self, ends: tuple[Spot, Spot], links: tuple[str, str], pin: str) -> None:
        """Set the side of A→D on which a pin lies; A is solved later than D, or comes first."""
        ranks = [self._rank[end.link] for end in ends]
        order = list(self._links)
        if ranks[0] == ranks[1]:
            swapped = order.index(links[1]) < order.index(links[0])
        else:
            swapped = ranks[0] < ranks[1]
        where = self.where(Spot(links[0], pin)) - self.where(ends[0])
        line = self.where(ends[1]) - self.where(ends[0])
        side = 1 if (line.conjugate() * where).imag > 0 else -1
        self._sides[pin] = side
        self._assembly[pin] = 'left' if (side > 0) != swapped else 'right'

    def _known(self, group: Group) -> None:
        """Mark the links of a group as known, in the order of `linkage check`."""
        self._groups.append(group)
        bodies: list[tuple[str, ...]] = []
        if isinstance(group, RRR):
            bodies = [(group.one,), (group.two,)]
            if self._rank[group.a.link] < self._rank[group.d.link]:
                bodies.reverse()
        elif isinstance(group, DrivenRRR):
            bodies = list(group.arms)
            if self._rank[group.ends[0].link] < self._rank[group.ends[1].link]:
                bodies.reverse()
        elif isinstance(group, PRP):
            sliders = [self._sliders[name] for name in (group.one, group.two)]
            if self._rank[sliders[0].along] < self._rank[sliders[1].along]:
                sliders.reverse()
            bodies = [(slider.block,) for slider in sliders if slider.block]
        elif isinstance(group, RPP):
            inner = self._sliders[group.inner]
            bodies = [(inner.block,)] if inner.block else []
        # For RRP and RPR, the link with the pin, or the rail, was made first.
        for body in [*bodies, tuple(self._links)]:
            for link in body:
                self._rank.setdefault(link, len(self._rank))

    def turning(self, on: str, pivot: complex | None = None) -> str:
        """Add a link that an input turns on another."""
        spot = self.spot(on)
        if pivot is not None:
            self.put(on, spot.point, pivot)
        where = self.where(spot)
        arm = polar(self.length(), self.direction())
        link = self.link('crank', {spot.point: where, self.name('A'): where + arm})
        self._drive_turn(on, link)
        self._known(DrivenLink(link, on, len(self.inputs) - 1))
        return link

    def sliding(self, on: str) -> str:
        """Add a link that an input slides along a line of another, or whose line slides."""
        start = self.where(self.spot(on)) + polar(self.length(), self.direction())
        name = self.name('C')
        if self.rng.random() < 0.3:
            # The line is on the new link, which slides through a block on the known one.
            through = self.name('Q')
            line = polar(1.0, self.direction())
            link = self.link('rod', {through: start - line * self.length()}, axis=self.axis(on))
            self.put(on, name, start)
            self._drive_slide(line, link, through, name, on)
        else:
            line = polar(1.0, self.direction())
            link = self.link('slide', {name: start}, axis=self.axis(on))
            through = self.name('Q')
            self.put(on, through, start - line * self.length() * self.rng.choice((1, -1)))
            self._drive_slide(line, on, through, name, link)
        self._known(DrivenLink(link, on, len(self.inputs) - 1))
        return link

    def _drive_turn(self, parent: str, child: str) -> None:
        if self.rng.random() < 0.3:
            parent, child = child, parent
        self.inputs.append(Input(self.name('in'), parent, child))
        value = phase(self.axis(child) * self.axis(parent).conjugate())
        self._start.append(value)
        self._step.append(0.3)

    def _drive_slide(
        self, line: complex, along: str, through: str, point: str, block: str
    ) -> None:
        # With the opposite direction of the line the slide is negative.
        line *= self.rng.choice((1, -1))
        name = self.slide(line, along, through, point, block)
        self.inputs.append(Input(self.name('in'), slider=name))
        between = self.where(Spot(block, point)) - self.where(Spot(along, through))
        self._start.append((between * line.conjugate()).real)
        self._step.append(0.3 * abs(between))

    def dyad(self, kind: str, known: str, other: str) -> list[str]:
        """Add a random dyad between two links; the first one carries the pin of a rail."""
        return add_random(self, kind, known, other, first=False)

    def driven_dyad(self, known: str, other: str, count: int = 1) -> list[str]:
        """Add two arms pinned together, with inputs between the links of one or of both."""
        ends = self.spot(known), self.spot(other)
        places = [self.where(end) for end in ends]
        where = places[0] + polar(self.length(), self.direction())
        pin = self.name('B')
        arms: list[tuple[str, ...]] = []
        driven = (0, 1) if count == 2 else (self.rng.choice((0, 1)),)
        for k, (end, place) in enumerate(zip(ends, places, strict=True)):
            if k in driven:
                arms.append(self._driven_arm(end, place, pin, where))
            else:
                arms.append((self.link('link', {end.point: place, pin: where}),))
        self._name_side(ends, (arms[0][-1], arms[1][-1]), pin)
        self._known(DrivenRRR((arms[0], arms[1]), ends, pin))
        return [link for arm in arms for link in arm]

    def _driven_arm(self, end: Spot, start: complex, pin: str, where: complex) -> tuple[str, str]:
        if self.rng.random() < 0.5:
            elbow = start + polar(self.length(), self.direction())
            joint = self.name('E')
            one = self.link('upper', {end.point: start, joint: elbow})
            other = self.link('lower', {joint: elbow, pin: where})
            self._drive_turn(one, other)
            return one, other
        line = polar(1.0, self.direction())
        if self.rng.random() < 0.5:
            line = (where - start) / abs(where - start)
        barrel = self.link('barrel', {end.point: start}, axis=line)
        through = self.name('Q')
        self.put(barrel, through, where - line * self.length())
        rod = self.link('rod', {pin: where}, axis=line)
        self._drive_slide(line, barrel, through, pin, rod)
        return barrel, rod

    def platform(self, knowns: list[str], legs: list[str]) -> list[str]:
        """
        Add a link on three legs, each on a known link: an Assur group of class III or above.

        A leg is a link with two pins ('RR'), a slot in which a pin of the platform slides ('PR'),
        or a pinned link on which the platform slides as a block ('RP').
        """
        centre = self.where(self.spot(knowns[0])) + polar(self.length(), self.direction())
        corners = [centre + polar(self.length(), self.direction()) for _ in legs]
        names = [self.name('T') for _ in legs]
        platform = self.link('platform', dict(zip(names, corners, strict=True)))
        new = [platform]
        for known, leg, name, corner in zip(knowns, legs, names, corners, strict=True):
            if leg == 'PR':
                line = polar(1.0, self.direction())
                through = self.name('Q')
                self.put(known, through, corner - line * self.length())
                self.slide(line, known, through, name, '')
            elif leg == 'RP':
                end, line = self.spot(known), polar(1.0, self.direction())
                rail = self.link('rail', {end.point: self.where(end)}, axis=line)
                through = self.name('Q')
                self.put(rail, through, corner - line * self.length())
                self.slide(line, rail, through, name, platform)
                new.append(rail)
            else:
                end = self.spot(known)
                new.append(self.link('leg', {end.point: self.where(end), name: corner}))
            self._pose_points[name] = corner
        for link in new:
            for point in self._links[link]:
                self._pose_points[point] = self.where(Spot(link, point))
            self._rank[link] = len(self._rank)
        self._groups.append(None)  # type: ignore[arg-type]  # no dyad
        return new

    def topology(self) -> Topology:
        """Return the built linkage; every angle to the ground and every slide is published."""
        moving = [link for link in self._links if link != GROUND]
        joints: dict[str, RevoluteJoint | SlideJoint] = {
            f'a_{link}': RevoluteJoint(GROUND, link) for link in moving
        }
        if len(moving) > 1:
            one, other = self.rng.sample(moving, 2)
            joints['between'] = RevoluteJoint(one, other)
        joints |= {f's_{name}': SlideJoint(name) for name in self._sliders}
        iterated = None in self._groups
        points = {name: (z.real, z.imag) for name, z in self._pose_points.items()}
        pose = AssemblyPose(tuple(self._start), points)
        with_pose = iterated or len(self.inputs) > 1 or self.rng.random() < 0.5
        return Topology(
            Linkage(
                {link: dict(points) for link, points in self._links.items()},
                tuple(self.inputs),
                dict(self._assembly),
                joints,
                dict(self._sliders),
                pose=pose if with_pose else None,
            ),
            None if iterated else tuple(self._groups),
            dict(self._sides),
            tuple(self._start),
            {
                link: (phase(self._frames[link][1]), *_parts(self._frames[link][0]))
                for link in moving
            },
            tuple(self._step),
        )


def _parts(z: complex) -> tuple[float, float]:
    return z.real, z.imag


_KNOTS = 180
"""Steps to a turn, or to three lengths of a slide."""

_SMALLEST = 2.0**-26
_CLOSE = 0.05
"""Greatest correction, relative to the step and to the linkage's size."""


class Walk(NamedTuple):
    """
    A linkage followed along its inputs: distances and unknowns, (n, knots), of the knots.

    If it is not complete, the path goes on behind ``end``.
    """

    values: list[float]
    unknowns: list[Array]
    end: float
    complete: bool


def walk(
    equations: Equations,
    start: Array,
    begin: Array,
    direction: Array,
    length: float,
    spacing: float,
) -> Walk:
    """
    Follow a linkage from a solution (n, 1) along a line of its inputs for a length.

    The inputs at a distance s are begin + s·direction, (inputs, 1); spacing is the longest step.
    """
    values, knots = [0.0], [start[:, 0]]
    at, done, step = start, 0.0, spacing
    still = np.zeros_like(direction)
    motion = equations.motion(at, begin, direction, still)
    sign = np.linalg.slogdet(equations.residuals(at, begin)[1].astype(float))[0][0]
    while done < length:
        step = min(step, length - done)
        target = done + step
        guess = at + step * motion.rates + 0.5 * step * step * motion.accelerations
        ahead = begin + Real(target) * direction
        found, good = equations.correct(guess, ahead, steps=6)
        taken = False
        if good.all():
            moved = np.abs(found - at).max()
            off = np.abs(found - guess).max()
            there = np.linalg.slogdet(equations.residuals(found, ahead)[1].astype(float))[0][0]
            taken = bool(off <= _CLOSE * min(moved, 10 * equations.size)) and there == sign
        if not taken:
            step *= 0.5
            if step < _SMALLEST * spacing:
                return Walk(values, knots, done, False)
            continue
        at, done = found, target
        values.append(done)
        knots.append(at[:, 0])
        motion = equations.motion(at, ahead, direction, still)
        step = min(2.0 * step, spacing)
    return Walk(values, knots, done, True)


def start_of(topology: Topology, equations: Equations) -> tuple[Array, Array]:
    """Return the corrected pose in which a linkage was made, and its inputs."""
    begin = np.array([[value] for value in topology.start], Real)
    rough = np.array([[part] for link in equations.links for part in topology.pose[link]], Real)
    return equations.correct(rough, begin)[0], begin


Walks = tuple[Walk, Walk]
"""A linkage with a single input, followed down and up from the pose it was made in."""


def follow(
    topology: Topology, equations: Equations, inputs: Array, both: Walks | None
) -> tuple[Array, Array]:
    """
    Return poses (n, N) at inputs, and whether the linkage can be followed there.

    The path is straight from the pose in which the linkage was made to the inputs. If it fails, a
    single turning input may still be reached the other way round; such a state is 'unknown'.
    """
    start, begin = start_of(topology, equations)
    count = inputs.shape[1]
    unknowns = np.zeros((equations.count, count), Real)
    state = np.full(count, 'unknown', object)
    if both is not None:
        for k in range(count):
            value = float(inputs[0, k] - begin[0, 0])
            part = both[value > 0]
            if abs(value) <= part.end:
                nearest = int(np.argmin(np.abs(np.array(part.values) - abs(value))))
                pose = _to(equations, part, nearest, begin, inputs[:, [k]], value)
                if pose is not None:
                    unknowns[:, [k]], state[k] = pose, 'closed'
                continue
            turning = not topology.linkage.inputs[0].slider
            around = tau - abs(value)
            if not turning or around > max(0.0, both[value <= 0].end):
                state[k] = 'open'
        return unknowns, state
    for k in range(count):
        way = inputs[:, [k]] - begin
        if not way.any():
            unknowns[:, [k]], state[k] = start, 'closed'
            continue
        part = walk(equations, start, begin, way, 1.0, 0.05)
        if part.complete:
            unknowns[:, k], state[k] = part.unknowns[-1], 'closed'
        elif part.end < 0.999:
            state[k] = 'open'
    return unknowns, state


def both_ways(topology: Topology, turns: float = 1.25) -> Walks:
    """Follow a linkage with a single input down and up from the pose it was made in."""
    equations = Equations(topology.linkage)
    start, begin = start_of(topology, equations)
    length, spacing = turns * tau, tau / _KNOTS
    if topology.linkage.inputs[0].slider:
        length = 10.0 * topology.step[0]
        spacing = length / _KNOTS
    down, up = (
        walk(equations, start, begin, np.array([[sign]], Real), length, spacing)
        for sign in (-1.0, 1.0)
    )
    return down, up


def _to(
    equations: Equations, part: Walk, nearest: int, begin: Array, inputs: Array, value: float
) -> Array | None:
    """Follow a linkage from a knot to inputs; return the pose, None if it fails."""
    sign = 1.0 if value > 0 else -1.0
    knot = part.values[nearest]
    start = part.unknowns[nearest][:, None]
    at = begin + Real(sign * knot)
    length = abs(value) - knot
    if length == 0.0:
        return start
    way = np.array([[sign if length > 0 else -sign]], Real)
    rest = walk(equations, start, at, way, abs(length), abs(length))
    return rest.unknowns[-1][:, None] if rest.complete else None
