# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
Planar loops of a spatial linkage: what moves in one plane, wherever that plane moves.

Hinges along one direction, and slides across it, keep the links that they join in a plane; so do
rods and struts between such links. The joints of a loop of these depend on the loop's own inputs
alone, however its links are carried. So each loop is a planar linkage, and is solved as one: with
drawn assemblies, and with change points that are passed.

Loops are the biconnected components of the graph of links and joints of one direction (J. Hopcroft
and R. Tarjan, Algorithm 447, Communications of the ACM 16 (1973) 372-378).
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from math import asin, cos, dist, hypot, sin
from typing import NamedTuple

from linkage_ros.kinematics.plane.linkage import (
    AssemblyPose,
    GROUND,
    Input,
    Linkage,
    Mass,
    NO_LIMITS,
    Point,
    Ratio,
    RevoluteJoint,
    SlideJoint,
    Slider,
)
from linkage_ros.kinematics.space.carried_points import CarriedPoints, unit_across
from linkage_ros.kinematics.space.linkage import size_of, SpaceLinkage
from linkage_ros.kinematics.space.masses import SpatialMass, tensor_rows
from linkage_ros.kinematics.space.merged_pose import MERGED
from linkage_ros.kinematics.space.vectors import cross, dot, length, minus, scale, Vector

PARALLEL = 1e-6
"""Axes nearer to parallel than this are parallel, in [rad]: CAD rounds."""

_OPENED = 0.5
"""By how much the cranks of a parallelogram are turned to tell its assembly, in [rad]."""

_ROUNDED = 1e-15
"""Angles between axes that are rounding, in [rad]."""

Edges = dict[str, tuple[str, str]]
"""The ends of each joint by its name; those of a rod or strut by its name and the point."""


class PlanarLoop(NamedTuple):
    """
    A planar loop, as a linkage in its plane.

    The ground of that linkage is the loop's link nearest to the ground. Its hinges have the values
    of those in space less ``offsets``, in [rad]; its slides and struts have the same values.
    """

    linkage: Linkage
    links: tuple[str, ...]
    offsets: Mapping[str, float]
    normal: Vector

    @property
    def tilt(self) -> float:
        """Return the largest angle of a joint to the plane, or to its normal, in [rad]."""
        corrections = self.linkage.corrections
        return corrections.tilted_by if corrections else 0.0

    @property
    def inputs(self) -> tuple[str, ...]:
        """Return the names of the joints that move it."""
        return tuple(driven.joint for driven in self.linkage.inputs)


class _FlatJoints(NamedTuple):
    """Joints that move in one plane."""

    normal: Vector
    edges: Edges


def find_planar_loops(
    linkage: SpaceLinkage, carried: CarriedPoints, known: Collection[str]
) -> Iterator[PlanarLoop]:
    """Yield the planar loops that joints of known values move, and only they."""
    order = _links_from_ground(linkage)
    for normal in _normals(linkage, carried):
        joints = _joints_across(linkage, carried, normal)
        rods = _rods_across(linkage, carried, normal, known)
        for edges in biconnected_components({**joints, **rods}, order):
            loop = PlanarModel(linkage, carried, _FlatJoints(normal, edges), known, order)
            if loop.is_moved_by_inputs:
                yield loop.loop()


def model_in_plane(
    linkage: SpaceLinkage, carried: CarriedPoints, normal: Vector
) -> PlanarModel | None:
    """Return the model of all links in the plane across a direction; None if they leave it."""
    joints = _joints_across(linkage, carried, normal)
    if len(joints) < len(linkage.pair_joints):
        return None
    struts = {name for name in linkage.struts if name in (*linkage.driven, *linkage.published)}
    edges = {**joints, **_rods_across(linkage, carried, normal, struts)}
    if not {*linkage.link_names, *struts} <= _ends_of(edges.values()):
        return None
    order = _links_from_ground(linkage)
    model = PlanarModel(linkage, carried, _FlatJoints(normal, edges), linkage.driven, order)
    return model if model.is_moved_by_inputs else None


def _normals(linkage: SpaceLinkage, carried: CarriedPoints) -> list[Vector]:
    """Return the directions of hinges, parallel ones once, each with its largest part positive."""
    normals: list[Vector] = []
    for name in linkage.hinges:
        axis = carried.axes[name]
        if not any(_is_parallel(axis, normal) for normal in normals):
            normals.append(scale(-1.0 if max(axis, key=abs) < 0.0 else 1.0, axis))
    return normals


def _is_parallel(first: Vector, second: Vector) -> bool:
    return length(cross(first, second)) < PARALLEL


def _joints_across(linkage: SpaceLinkage, carried: CarriedPoints, normal: Vector) -> Edges:
    """Return the hinges along a direction and the slides across it."""
    return {
        name: (joint.parent, joint.child)
        for name, joint in linkage.pair_joints.items()
        if (
            _is_parallel(carried.axes[name], normal)
            if name in linkage.hinges
            else abs(dot(carried.axes[name], normal)) < PARALLEL
        )
    }


def _rods_across(
    linkage: SpaceLinkage, carried: CarriedPoints, normal: Vector, known: Collection[str]
) -> Edges:
    """Return the ends of rods, of struts of known length across a direction, and of balls."""
    edges: Edges = {}
    rods = carried.rods
    for point, (first, *others) in _balls(linkage, rods):
        edges |= {f'{link}, {point}': (link, first) for link in others}
    held = {
        point: next((link for link in carriers if link not in rods), '')
        for point, carriers in carried.carriers.items()
    }
    for link in rods:
        ends = {f'{link}, {point}': (link, held[point]) for point in carried.carried[link]}
        ends = {edge: on for edge, on in ends.items() if on[1]}
        edges |= ends if len(ends) > 1 else {}
    for name, pair in linkage.struts.items():
        points = [carried.same[point] for point in pair]
        start, end = (carried.places[point] for point in points)
        if name in known and abs(dot(minus(end, start), normal)) < MERGED:
            edges |= {f'{name}, {point}': (name, held[point]) for point in points}
    return edges


def _balls(linkage: SpaceLinkage, rods: Collection[str]) -> Iterator[tuple[str, list[str]]]:
    """Yield the points that several links carry, with those of them that are not rods."""
    for point in linkage.points:
        links = [
            link
            for link, carried in linkage.links.items()
            if point in carried and link not in rods
        ]
        if len(links) > 1:
            yield point, links


def _links_from_ground(linkage: SpaceLinkage) -> list[str]:
    """Return all links, those nearer to the ground first."""
    order = [GROUND]
    for link in order:
        for joint in linkage.pair_joints.values():
            if link in (joint.parent, joint.child):
                order += [end for end in (joint.parent, joint.child) if end not in order]
    return [*order, *(link for link in linkage.link_names if link not in order)]


def biconnected_components(edges: Edges, order: Collection[str]) -> list[Edges]:
    """
    Return the edges of each biconnected component of a graph that has a circle.

    ``order`` has the vertices in the order in which they are taken as roots.
    """
    near: defaultdict[str, list[tuple[str, str]]] = defaultdict(list)
    for edge, (behind, ahead) in edges.items():
        near[behind].append((edge, ahead))
        near[ahead].append((edge, behind))
    depth: dict[str, int] = {}
    low: dict[str, int] = {}
    components: list[Edges] = []
    for root in (vertex for vertex in order if vertex in near):
        if root in depth:
            continue
        depth[root] = low[root] = len(depth)
        waiting: list[str] = []
        path = [(root, '', iter(near[root]))]
        while path:
            at, by, ways = path[-1]
            way = next(ways, None)
            if way is None:
                path.pop()
                if path:
                    top = path[-1][0]
                    low[top] = min(low[top], low[at])
                    if low[at] >= depth[top]:
                        first = waiting.index(by)
                        components.append({edge: edges[edge] for edge in waiting[first:]})
                        del waiting[first:]
                continue
            edge, ahead = way
            if ahead not in depth:
                depth[ahead] = low[ahead] = len(depth)
                waiting.append(edge)
                path.append((ahead, edge, iter(near[ahead])))
            elif edge != by and depth[ahead] < depth[at]:
                waiting.append(edge)
                low[at] = min(low[at], depth[ahead])
    return [component for component in components if len(component) > 2]


class _Pin(NamedTuple):
    name: str
    place: Point  # In the plane, in [m]
    links: set[str]


class PlanarModel:
    """
    A planar linkage made of the joints of a loop.

    Each link has its own frame in the plane. In the pose a link is turned against the one that it
    hangs on by the value of their hinge, so that hinges have the same values as in space; those of
    hinges that close a loop may differ by a constant.
    """

    def __init__(
        self,
        linkage: SpaceLinkage,
        carried: CarriedPoints,
        part: _FlatJoints,
        known: Collection[str],
        order: list[str],
    ) -> None:
        self._linkage, self._carried, self._edges = linkage, carried, part.edges
        self._normal = part.normal
        self._x = unit_across(part.normal)
        self._y = cross(part.normal, self._x)
        ends = {end for pair in part.edges.values() for end in pair}
        self._links = [link for link in order if link in ends]
        self._struts = [name for name in linkage.struts if name in ends]
        joints = [name for name in linkage.pair_joints if name in part.edges]
        self._inputs = [name for name in (*joints, *self._struts) if name in known]
        order_of_inputs = {name: number for number, name in enumerate(linkage.driven)}
        self._inputs.sort(key=lambda name: order_of_inputs.get(name, len(order_of_inputs)))
        self._joints = [name for name in joints if name not in known]
        self._joints.sort(key=lambda name: name not in linkage.published)
        self._ratios = {
            name: ratio
            for name, ratio in linkage.ratios.items()
            if name in self._joints
            and not ratio.also
            and ratio.of in (*self._joints, *self._inputs)
        }
        self._near = MERGED * size_of(linkage)
        self._pins = self._find_pins()

    @property
    def is_moved_by_inputs(self) -> bool:
        """Return whether its links stay in the plane, and its inputs are all its freedoms."""
        pairs = [self._edges[name] for name in self._linkage.pair_joints if name in self._edges]
        joined = {self._links[0]}
        for _ in pairs:
            joined.update(*(pair for pair in pairs if not joined.isdisjoint(pair)))
        # Rods and struts end on links of the plane, and balls join such links.
        free = {*self._carried.rods, *self._struts}
        if not _ends_of(self._edges.values()) - free <= joined:
            return False
        slides = sum(name in self._linkage.slides for name in self._edges)
        count = sum(len(pin.links) - 1 for pin in self._pins) + slides
        # A strut of known length is a rod.
        turned = [name for name in self._inputs if name not in self._struts]
        rod_count = len(self._inputs) - len(turned)
        freedoms = 3 * (len(self._links) - 1) - 2 * count - rod_count
        return freedoms == len(turned) + len(self._ratios) and bool(self._inputs)

    def _flat_name(self, link: str) -> str:
        """Return the name of a link in the plane."""
        return GROUND if link == self._links[0] else link

    def _flat(self, place: Vector) -> Point:
        return dot(place, self._x), dot(place, self._y)

    def _find_pins(self) -> list[_Pin]:
        """Return the pins; those of one link in one place are one, as of hinges on one line."""
        pins: list[_Pin] = []
        for edge, ends in self._edges.items():
            if edge in self._linkage.slides:
                continue
            held = {self._flat_name(end) for end in ends if end not in self._struts}
            if edge in self._linkage.hinges:
                place = self._linkage.hinges[edge].at
                name = self._point_at(self._flat(place), ends) or edge
            else:
                name = edge.removeprefix(f'{ends[0]}, ')
                place = scale(self._carried.size, self._carried.places[name])
            pin = _Pin(name, self._flat(place), held)
            for near_pin in [*pins]:
                if near_pin.name == name or (
                    dist(near_pin.place, pin.place) < self._near
                    and not held.isdisjoint(near_pin.links)
                ):
                    pins.remove(near_pin)
                    held = held | near_pin.links
                    pin = _Pin(near_pin.name, near_pin.place, held)
            pins.append(pin)
        return pins

    def _point_at(self, place: Point, links: Collection[str]) -> str:
        """Return the name of a point of some links at a place in the plane, first a traced one."""
        spatial = self._linkage
        names = (point for link in links for point in spatial.links.get(link, ()))
        at = [
            point for point in names if dist(self._flat(spatial.points[point]), place) < self._near
        ]
        return min(at, key=lambda point: point not in spatial.traced, default='')

    def loop(self) -> PlanarLoop:
        """Return the loop, with all joints whose values are not known."""
        return self.with_joints(self._joints, {})

    def with_joints(
        self, joints: Collection[str], points: Mapping[str, Collection[str]]
    ) -> PlanarLoop:
        """Return the linkage in its plane with some joints, and with more points of its links."""
        spatial = self._linkage
        turned = self._pose_angles()
        places: dict[str, dict[str, Point]] = {self._flat_name(link): {} for link in self._links}
        for pin in self._pins:
            for link in pin.links:
                places[link][pin.name] = pin.place
        sliders: dict[str, Slider] = {}
        for name in self._edges:
            if name in spatial.slides:
                sliders[name] = self._slider(name, places, turned)
        for name in self._struts:
            sliders[name] = self._cylinder(name, places)
        for link, names in points.items():
            self._add_points(places.get(link, {}), names)
        links: dict[str, dict[str, Point]] = {}
        masses: dict[str, Mass] = {}
        for link, at in places.items():
            first = (0.0, 0.0) if link == GROUND else next(iter(at.values()))
            if spatial.masses and link != GROUND:
                weighed = spatial.masses_with(link)[link]
                masses[link] = self._mass(weighed, first, turned.get(link, 0.0))
            links[link] = {
                name: _turn((x - first[0], y - first[1]), -turned.get(link, 0.0))
                for name, (x, y) in at.items()
            }
        offsets: dict[str, float] = {}
        made: dict[str, RevoluteJoint | SlideJoint] = {}
        for name in dict.fromkeys((*self._inputs, *joints)):
            if name in sliders:
                limits = spatial.slides[name].limits if name in spatial.slides else NO_LIMITS
                made[name] = SlideJoint(name, limits)
                offsets[name] = 0.0
                continue
            joint = spatial.hinges[name]
            ends = [self._flat_name(joint.parent), self._flat_name(joint.child)]
            if dot(self._carried.axes[name], self._normal) < 0.0:
                ends.reverse()
            made[name] = RevoluteJoint(ends[0], ends[1], joint.limits)
            angle = turned.get(ends[1], 0.0) - turned.get(ends[0], 0.0)
            offsets[name] = joint.value - angle
        inputs = tuple(Input.from_joint(name, made[name]) for name in self._inputs)
        pose = AssemblyPose(
            tuple(spatial.pose_value(name) - offsets[name] for name in self._inputs),
            {pin.name: pin.place for pin in self._pins},
            {link: turned.get(link, 0.0) for link in links if link != GROUND},
        )
        pose = self._open_parallelogram(pose, inputs)
        flat = Linkage(
            links, inputs, {}, {name: made[name] for name in joints}, sliders, pose=pose,
            ratios={name: self._ratio(of, name, offsets) for name, of in self._ratios.items()},
            masses=masses,
            corrections=replace(spatial.corrections, tilted_by=self._tilt),
        )  # fmt: skip
        return PlanarLoop(flat, tuple(self._links), offsets, self._normal)

    def _mass(self, weighed: SpatialMass, first: Point, angle: float) -> Mass:
        """Return the mass of a link with its first point at a place, turned by an angle."""
        x, y = self._flat(weighed.center)
        center = _turn((x - first[0], y - first[1]), -angle) if weighed.mass else (0.0, 0.0)
        across = (dot(row, self._normal) for row in tensor_rows(weighed.inertia))
        about = sum(first * second for first, second in zip(self._normal, across, strict=True))
        return Mass(weighed.mass, center, about)

    def _add_points(self, there: dict[str, Point], names: Collection[str]) -> None:
        """Add the points of a link that are in no other place of it."""
        for name in names:
            place = self._flat(self._linkage.points[name])
            if name not in there and all(dist(place, at) >= self._near for at in there.values()):
                there[name] = place

    def _open_parallelogram(self, pose: AssemblyPose, inputs: tuple[Input, ...]) -> AssemblyPose:
        """Return a pose that tells the assembly of a parallelogram that is drawn flat."""
        crank_pins = [pin for pin in self._pins if GROUND in pin.links]
        others = [pin for pin in self._pins if GROUND not in pin.links]
        is_four_bar = len(self._links) == 4 and len(crank_pins) == len(others) == 2
        if not is_four_bar or any(len(pin.links) != 2 for pin in self._pins):
            return pose
        moved, cranks = dict(pose.points), []
        for pivot in crank_pins:
            (crank,) = pivot.links - {GROUND}
            pin = next(pin for pin in others if crank in pin.links)
            arm = (pin.place[0] - pivot.place[0], pin.place[1] - pivot.place[1])
            x, y = _turn(arm, _OPENED)
            moved[pin.name] = (pivot.place[0] + x, pivot.place[1] + y)
            cranks.append((crank, arm))
        (first, arm), (second, other_arm) = cranks
        if dist(arm, other_arm) > PARALLEL * hypot(*arm):
            return pose
        turn = {first: _OPENED, second: _OPENED}
        values = (
            value + turn.get(driven.child, 0.0) - turn.get(driven.parent, 0.0)
            for value, driven in zip(pose.inputs, inputs, strict=True)
        )
        angles = {link: angle + turn.get(link, 0.0) for link, angle in pose.angles.items()}
        return AssemblyPose(tuple(values), moved, angles)

    def _pose_angles(self) -> dict[str, float]:
        """Return the angle of each link in the pose; hinges that are inputs are met first."""
        angles = {GROUND: 0.0}
        joints = [name for name in (*self._inputs, *self._joints) if name not in self._struts]
        for _ in joints:
            for name in joints:
                joint = self._linkage.pair_joints[name]
                parent, child = self._flat_name(joint.parent), self._flat_name(joint.child)
                value = 0.0 if name in self._linkage.slides else joint.value
                if dot(self._carried.axes[name], self._normal) < 0.0:
                    value = -value
                if parent in angles and child not in angles:
                    angles[child] = angles[parent] + value
                    break
                if child in angles and parent not in angles:
                    angles[parent] = angles[child] - value
                    break
            else:
                break
        return angles

    def _slider(
        self, name: str, places: dict[str, dict[str, Point]], turned: Mapping[str, float]
    ) -> Slider:
        """Return a slide as a slider, and add its points to its links."""
        joint = self._linkage.slides[name]
        along, block = self._flat_name(joint.parent), self._flat_name(joint.child)
        # A pin of the block, since no link has two points in one place.
        point = next((pin for pin in places[block] if pin not in places[along]), '')
        if not point:
            point = f'{name} block'
            places[block][point] = next(iter({**places[block], **places[along]}.values()))
        x, y = places[block][point]
        ux, uy = self._flat(self._carried.axes[name])
        places[along][f'{name} zero'] = (x - joint.value * ux, y - joint.value * uy)
        angle = turned.get(along, 0.0)
        direction = _turn((ux, uy), -angle)
        return Slider(
            point, along, f'{name} zero', direction, block, turned.get(block, 0.0) - angle
        )

    def _cylinder(self, name: str, places: dict[str, dict[str, Point]]) -> Slider:
        """Return a strut as a rod in a tube."""
        start, end = (self._pin_of(name, point) for point in self._linkage.struts[name])
        tube, rod = f'{name} tube', f'{name} rod'
        places[tube], places[rod] = {start.name: start.place}, {end.name: end.place}
        way = (end.place[0] - start.place[0], end.place[1] - start.place[1])
        return Slider(end.name, tube, start.name, way, rod)

    def _pin_of(self, strut: str, point: str) -> _Pin:
        """Return the pin at an end of a strut; it may be merged with another."""
        at = self._carried.same[point]
        place = self._flat(scale(self._carried.size, self._carried.places[at]))
        link = self._flat_name(self._edges[f'{strut}, {at}'][1])
        pins = [pin for pin in self._pins if link in pin.links or pin.name == at]
        return min(pins, key=lambda pin: dist(pin.place, place))

    def _ratio(self, ratio: Ratio, name: str, offsets: Mapping[str, float]) -> Ratio:
        """Return a ratio between joints of the plane."""
        rest = ratio.ratio * offsets[ratio.of] + ratio.offset - offsets[name]
        return replace(ratio, offset=rest)

    @property
    def _tilt(self) -> float:
        """Return by how much a joint leaves the plane, in [rad]."""
        worst = 0.0
        for name in self._edges:
            if name in self._linkage.hinges:
                worst = max(worst, length(cross(self._carried.axes[name], self._normal)))
            elif name in self._linkage.slides:
                worst = max(worst, abs(dot(self._carried.axes[name], self._normal)))
        return asin(worst) if worst > _ROUNDED else 0.0


def _ends_of(pairs: Collection[tuple[str, str]]) -> set[str]:
    return {end for pair in pairs for end in pair}


def _turn(vector: Point, angle: float) -> Point:
    """Return a vector turned by an angle; itself for 0."""
    if not angle:
        return vector
    (x, y), c, s = vector, cos(angle), sin(angle)
    return c * x - s * y, s * x + c * y
