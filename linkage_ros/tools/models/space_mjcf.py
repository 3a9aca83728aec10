# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A spatial linkage as bodies of MJCF: a tree of its joints, and equality constraints that close it.

Every link hangs on joints, see `with_rod_joints`. Links without points and masses that a chain of
joints passes, as those of a ball, are joints of one body: the engine moves no massless body. At
the start the axes of all bodies are parallel to those of the ground. Points that links share are
connected; a hinge that closes a loop is two points of its axis, and a slide moves a light body,
which is welded to the link.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Any
from xml.etree import ElementTree as ET

from linkage_ros.kinematics import (
    direction_of,
    GROUND,
    minus,
    NO_LIMITS,
    plus,
    scale,
    SpaceClosure,
    SpaceDrawing,
    SpatialJoint,
    SpatialMass,
    Vector,
    with_rod_joints,
)
from linkage_ros.names import free_name
from linkage_ros.tools.models.part import ModelPart, PrefixedNames
from linkage_ros.tools.models.xml import (
    DENSITY,
    DIFFERENCE,
    format_number,
    format_numbers,
    format_rough,
    LEAST_INERTIA,
    write_limits,
)
import numpy as np

_LIGHT = 1e-3
"""Mass of a body that only holds joints, relative to the mean of the others."""


class SpaceBodies:
    """The bodies of a spatial linkage, written into the ``world`` element of a model."""

    def __init__(self, world: ET.Element, part: ModelPart, names: PrefixedNames) -> None:
        self._closure: SpaceClosure = part.closure
        self._names = names
        self._drawing = SpaceDrawing(part.closure)
        self._linkage = linkage = with_rod_joints(part.closure.linkage)
        self.inputs = part.closure.linkage.pose.inputs
        position = part.closure.close_unlimited(*self.inputs)
        self._places = self._drawing.places(position)
        self.joints: dict[str, ET.Element] = {}
        self.start: list[float] = []
        self._masses: dict[str, float] = {}
        self._links = {GROUND: ET.SubElement(world, 'body', name=names.own_name(GROUND))}
        self._origins: dict[str, Vector] = {GROUND: (0.0, 0.0, 0.0)}
        self._sites: dict[tuple[str, str], str] = {}
        self.welds: list[tuple[str, str]] = []
        self._points = dict(linkage.points)
        self._halves = dict(self._strut_halves())
        self._write_shapes(GROUND)
        self._left, closing = self._choose_tree()
        self._hang_on(GROUND)
        self.cuts = [*self._balls(), *self._close_by(closing)]

    def _choose_tree(self) -> tuple[dict[str, SpatialJoint], dict[str, SpatialJoint]]:
        """Return the joints of the tree, driven ones before others, and those that close loops."""
        part_of = {link: link for link in self._linkage.link_names}
        kept, closing = dict[str, SpatialJoint](), dict[str, SpatialJoint]()
        joints = self._linkage.pair_joints.items()
        for name, joint in sorted(joints, key=lambda entry: entry[0] not in self._linkage.driven):
            part, joined = part_of[joint.parent], part_of[joint.child]
            if part == joined:
                closing[name] = joint
                continue
            kept[name] = joint
            part_of = {link: part if p == joined else p for link, p in part_of.items()}
        return kept, closing

    def _balls(self) -> Iterator[tuple[str, str, str]]:
        """Yield the points that are cut, each with two links that it joins."""
        joined = set()
        for point, link, neighbour in self._linkage.shared_points(on_axes=False):
            if (point, neighbour) not in joined:
                joined.add((point, neighbour))
                yield point, link, neighbour

    def site_name(self, link: str, point: str) -> str:
        """Return the name of a site at a point of a link; make the site if it is missing."""
        if (link, point) not in self._sites:
            name = self._sites[link, point] = self._names.frame_on(point, link)
            place = minus(self._points[point], self._origins[link])
            ET.SubElement(self._links[link], 'site', name=name, pos=format_numbers(*place))
        return self._sites[link, point]

    def input_inertia(self, index: int) -> float:
        """
        Return the approximate inertia that an input moves at the start, in [kg·m²] or [kg].

        Rates come from finite differences; each link's mass is spread over its places.
        """
        slides = bool(self._closure.linkage.inputs[index].slider)
        step = DIFFERENCE * (self._closure.scale if slides else 1.0)
        for sign in (1.0, -1.0):
            moved = [*self.inputs]
            moved[index] += sign * step
            there = self._closure.close_unlimited(*moved)
            if there.joints:
                break
        else:
            return 0.0
        rates = np.square((self._drawing.places(there) - self._places) / step).sum(axis=1)
        inertia = 0.0
        for part in self._drawing.bodies:
            mass = self._masses.get(part.name, 0.0)
            inertia += mass * float(np.mean(rates[list(part.corners)]))
        return inertia

    def _hang_on(self, parent: str) -> None:
        """Write the children of a link, depth first, in the order of the engine's joints."""
        while (next_joint := self._next_joint(parent)) is not None:
            chain = [next_joint]
            while self._is_passed(chain[-1][2]):
                onward = self._next_joint(chain[-1][2])
                assert onward is not None
                chain.append(onward)
            link = chain[-1][2]
            is_hinge = chain[-1][0] in self._linkage.hinges
            self._add_body(parent, link, chain[-1][1].at if is_hinge else None)
            for name, joint, child in chain:
                self._add_joint(link, name, joint, 1.0 if child == joint.child else -1.0)
            self._write_mass(link)
            self._hang_on(link)

    def _next_joint(self, link: str) -> tuple[str, SpatialJoint, str] | None:
        """Take the next joint that leads from a link to one that is not reached."""
        for name, joint in self._left.items():
            for on, child in ((joint.parent, joint.child), (joint.child, joint.parent)):
                if on == link and child not in self._links:
                    del self._left[name]
                    return name, joint, child
        return None

    def _is_passed(self, link: str) -> bool:
        """Return whether a link only hands on from a joint to another."""
        ends = [end for joint in self._left.values() for end in (joint.parent, joint.child)]
        mass = self._linkage.masses.get(link)
        carries = self._linkage.links.get(link) or (mass is not None and mass.mass)
        return not carries and ends.count(link) == 1 and not self._corners(link)

    def _add_body(self, parent: str, link: str, at: Vector | None) -> None:
        if at is None:
            points = self._linkage.links.get(link, ())
            at = self._linkage.points[points[0]] if points else self._origins[parent]
        self._origins[link] = at
        where = format_numbers(*minus(at, self._origins[parent]))
        name = self._names.own_name(link)
        self._links[link] = ET.SubElement(self._links[parent], 'body', name=name, pos=where)

    def _add_joint(self, link: str, name: str, joint: SpatialJoint, sign: float) -> None:
        slides = name in self._linkage.slides
        axis = [sign * component for component in joint.axis]
        at = (0.0, 0.0, 0.0) if slides else minus(joint.at, self._origins[link])
        element = ET.SubElement(
            self._links[link],
            'joint',
            name=self._names.own_name(name),
            type='slide' if slides else 'hinge',
            axis=format_numbers(*axis),
            pos=format_numbers(*at),
            # The engine resets to the pose as written; this is the joint's value in that pose.
            ref=format_number(joint.value),
        )
        limits = self._closure.linkage.limits.get(name, NO_LIMITS)
        write_limits(element, limits)
        self.joints[name] = element
        self.start.append(joint.value)

    def _write_mass(self, link: str) -> None:
        mass = self._linkage.masses.get(link)
        self._masses[link] = 0.0
        solids = self._write_shapes(link)
        if mass is not None and mass.mass:
            self._write_inertial(link, mass)
            self._masses[link] = mass.mass
        elif solids and not self._linkage.masses:
            self._masses[link] = solids
        else:
            self._write_light(link)

    def _write_light(self, link: str) -> None:
        """Give a body that only holds joints a small mass."""
        known = [mass.mass for mass in self._linkage.masses.values() if mass.mass]
        mass = _LIGHT * (sum(known) / len(known) if known else self._drawing.size)
        inertia = mass * self._drawing.size**2
        at = self._origins[link]
        self._write_inertial(link, SpatialMass(mass, at, (inertia, 0, 0, inertia, 0, inertia)))

    def _write_inertial(self, link: str, mass: SpatialMass) -> None:
        xx, xy, xz, yy, yz, zz = mass.inertia
        least = LEAST_INERTIA
        ET.SubElement(
            self._links[link],
            'inertial',
            pos=format_numbers(*minus(mass.center, self._origins[link])),
            mass=format_number(mass.mass),
            fullinertia=format_numbers(xx + least, yy + least, zz + least, xy, xz, yz),
        )

    def _corners(self, link: str) -> list[Any]:
        """Return the places between which a link is drawn, in the pose."""
        if link in self._halves:
            return [self._halves[link]]
        return [
            self._places[list(part.corners)] for part in self._drawing.bodies if part.name == link
        ]

    def _write_shapes(self, link: str) -> float:
        """Write a link as round bars between its places; return their mass in [kg]."""
        radius, total = 0.5 * self._drawing.size, 0.0
        for corners in self._corners(link):
            for start, end in pairwise(corners):
                ends = [minus(tuple(corner), self._origins[link]) for corner in (start, end)]
                place = format_rough(*ends[0], *ends[1])
                size = format_rough(radius)
                ET.SubElement(self._links[link], 'geom', type='capsule', fromto=place, size=size)
                total += DENSITY * np.pi * radius**2 * float(np.linalg.norm(end - start))
        return total

    def _strut_halves(self) -> Iterator[tuple[str, Any]]:
        """Yield tube and rod of each strut, with the places of its ends and its middle."""
        for name, (start, end) in self._closure.linkage.struts.items():
            ends = [self._places[self._drawing.points[point]] for point in (start, end)]
            middle = self._places[self._drawing.joints[name]]
            slide = self._linkage.slides[name]
            yield slide.parent, np.array([ends[0], middle])
            yield slide.child, np.array([middle, ends[1]])

    def _close_by(self, closing: dict[str, SpatialJoint]) -> Iterator[tuple[str, str, str]]:
        """
        Write joints that close loops.

        A hinge is two points of its axis, which are yielded with the links. A slide moves a light
        body, which is welded to the link.
        """
        for name, joint in closing.items():
            parent, child = joint.parent, joint.child
            if name in self._linkage.hinges:
                arm = scale(self._closure.scale, direction_of(joint.axis))
                for number, place in enumerate((joint.at, plus(joint.at, arm)), 1):
                    point = free_name(f'{name}_{number}', self._points)
                    self._points[point] = place
                    yield point, parent, child
                continue
            frame = self._names.free_frame(f'{name}_frame')
            where = format_numbers(*minus(self._origins[child], self._origins[parent]))
            self._links[frame] = ET.SubElement(self._links[parent], 'body', name=frame, pos=where)
            self._origins[frame] = self._origins[child]
            self._add_joint(frame, name, joint, 1.0)
            self._write_light(frame)
            self.welds.append((frame, self._names.own_name(child)))
