# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Export of a linkage as MJCF, the format of MuJoCo.

Bodies are nested, and equality constraints hold the pins that are cut. The axes of a body are
parallel to its link's own; its origin lies at the pin or slider that connects it to its parent.
Springs are spatial tendons, which pull as in `linkage_ros.dynamics`. Bodies of spatial linkages
are in `linkage_ros.tools.models.space_mjcf`.
"""

from __future__ import annotations

from cmath import phase, rect
from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations
from math import prod, remainder, tau
from typing import Any, NamedTuple
from xml.etree import ElementTree as ET

from linkage_ros.kinematics import (
    GROUND,
    links_by_point,
    Mass,
    NO_LIMITS,
    PlanarClosure,
    RevoluteJoint,
    SlideJoint,
    SpaceClosure,
    SpaceDrawing,
    usual_inputs,
)
from linkage_ros.tools.models.bodies import bar_width, link_bodies, LinkBody, Solid
from linkage_ros.tools.models.orientation import joint_spans
from linkage_ros.tools.models.part import ModelPart, PartError, prefix_names, PrefixedNames
from linkage_ros.tools.models.space_mjcf import SpaceBodies
from linkage_ros.tools.models.xml import (
    DENSITY,
    DIFFERENCE,
    format_number,
    format_numbers,
    format_rough,
    LEAST_INERTIA,
    write_limits,
    xml_comment,
    xml_document,
)

LIGHT = 10.0
"""Density of the blocks of pins in slots, in [kg/m³]: negligible."""

_STEP = 5e-4
"""Step of the integration, in [s]."""

_STIFF = {'solref': f'{format_number(4.0 * _STEP)} 1', 'solimp': '0.9999 0.9999 0.001 0.5 2'}
"""Solver parameters of cut pins: errors decay within 2 ms, and loads hardly open the pins."""

_PACE = 30.0
"""Bandwidth of the position servo of an input, in [rad/s]."""

_HEAD = f"""\
Bodies hang by their joints; what closes loops are equality constraints. A planar linkage lies in
the plane z = 0. A joint that is published or driven has its name, sign and zero; others of a
planar linkage are CHILD_at_PIN. Lengths in [m], angles in [rad].
Planar links with a mass are thin plates; others are steel bars of {DENSITY:g} kg/m3, as they are
drawn. A pin in a slot has a block of {LIGHT:g} kg/m3. Inputs have position servos. Nothing
collides.
Friction, tolerances and other effects of a scene are not here, nor its loads on joints and points;
its gravity and its springs between points are."""


# The linkage as a tree of its physical pins and sliders, published or not, and the pins cut.
#
# Inputs and sliders stay in the tree, since an engine closes a pin most easily. Of the other
# pins, published joints have priority. A pin in a slot gets a block of its own, which slides.


class TreeBranch(NamedTuple):
    """A joint of the tree."""

    kind: str  # ``R`` for a pin, ``P`` for a slider
    name: str  # Name of the pin or slider
    # The links; a block has its name in the closure's structure.
    parent: str
    child: str
    joint: str  # Name of the joint in messages; '' if it has none
    sign: int  # −1 if the joint counts in the opposite direction


class PhysicalTree(NamedTuple):
    """A linkage as a tree."""

    # The joints of the tree, each after the one that moves its parent.
    branches: tuple[TreeBranch, ...]
    # Pins that are cut: the point, and the two links that it joins.
    cuts: tuple[tuple[str, str, str], ...]


class _Edge(NamedTuple):
    rank: int
    kind: str
    name: str
    ends: tuple[str, str]


def physical_tree(closure: PlanarClosure) -> PhysicalTree:
    """
    Return a linkage as a tree of pins and sliders.

    Every loop has a pin that is not an input, and is cut there. A loop of sliders alone would fix
    an angle twice, and one whose pins are all driven could not move: neither is a valid linkage.
    """
    links = closure.structure.links
    part_of = {link: link for link in links}
    kept: list[_Edge] = []
    for edge in sorted(_list_edges(closure), key=lambda edge: edge.rank):
        part, joined = (part_of[end] for end in edge.ends)
        if part != joined:
            kept.append(edge)
            part_of = {link: part if p == joined else p for link, p in part_of.items()}
    branches: list[TreeBranch] = []
    reached = [GROUND]
    for link in reached:
        for edge in kept:
            if link in edge.ends:
                child = edge.ends[0] if edge.ends[1] == link else edge.ends[1]
                if child not in reached:
                    reached.append(child)
                    joint, sign = _joint_name(closure, edge, link, child)
                    branches.append(TreeBranch(edge.kind, edge.name, link, child, joint, sign))
    return PhysicalTree(tuple(branches), tuple(_find_cuts(closure, kept)))


def _list_edges(closure: PlanarClosure) -> Iterator[_Edge]:
    """Yield pins between any two links, and sliders; those to keep in the tree rank first."""
    linkage, links = closure.linkage, closure.structure.links
    driven = {
        frozenset((driven_joint.parent, driven_joint.child))
        for driven_joint in linkage.driven_joints
    }
    for name, slider in linkage.sliders.items():
        is_input = any(driven_joint.slider == name for driven_joint in linkage.inputs)
        ends = (slider.along, closure.structure.blocks[name])
        yield _Edge(0 if is_input else 1, 'P', name, ends)
    published = {
        frozenset((joint.parent, joint.child))
        for joint in linkage.named_joints.values()
        if isinstance(joint, RevoluteJoint)
    }
    for link, neighbour in combinations(links, 2):
        for pin in links[link]:
            if pin in links[neighbour]:
                pair = frozenset((link, neighbour))
                rank = 0 if pair in driven else 2 if pair in published else 3
                yield _Edge(rank, 'R', pin, (link, neighbour))


def _find_cuts(closure: PlanarClosure, kept: list[_Edge]) -> Iterator[tuple[str, str, str]]:
    for point, carried in links_by_point(closure.structure.links).items():
        part_of = {link: link for link in carried}
        for edge in kept:
            if edge.kind == 'R' and edge.name == point:
                part, joined = (part_of[end] for end in edge.ends)
                part_of = {link: part if p == joined else p for link, p in part_of.items()}
        first, *others = dict.fromkeys(part_of[link] for link in carried)
        yield from ((point, first, link) for link in others)


def _joint_name(closure: PlanarClosure, edge: _Edge, parent: str, child: str) -> tuple[str, int]:
    """Return the name of a joint in messages, and its sign."""
    for name, joint in closure.linkage.named_joints.items():
        if isinstance(joint, SlideJoint):
            if edge.kind == 'P' and joint.slider == edge.name:
                return name, 1
        elif edge.kind == 'R' and {joint.parent, joint.child} == {parent, child}:
            return name, 1 if joint.parent == parent else -1
    return '', 1


class Bodies:
    """
    The bodies of a linkage, written into the ``world`` element of a model.

    ``first_layer`` is the number of layers that other linkages occupy below.
    """

    def __init__(
        self, world: ET.Element, part: ModelPart, names: PrefixedNames, first_layer: int
    ) -> None:
        closure: PlanarClosure = part.closure
        self._closure = closure
        self._names = names
        tree = physical_tree(closure)
        self.cuts = tree.cuts  # Pins that are cut: the point, and the two links that it joins
        self._drawn = link_bodies(closure, joint_spans(closure), first_layer)
        self.inputs = usual_inputs(closure)  # Inputs at the start, in [rad] or [m]
        self._position = closure.position(*self.inputs)
        self._driven = dict(
            zip((driven.joint for driven in closure.linkage.inputs), self.inputs, strict=True)
        )
        self.welds: list[tuple[str, str]] = []  # In the plane there are none
        # Elements of the joints that have a name in messages, by that name.
        self.joints: dict[str, ET.Element] = {}
        # Value of every joint at the start, in [rad] or [m], in the order of the model.
        self.start: list[float] = []
        self._masses: dict[str, float] = {}
        self._links = {GROUND: ET.SubElement(world, 'body', name=names.own_name(GROUND))}
        self._origins = {GROUND: 0j}
        self._sites: dict[tuple[str, str], str] = {}
        _write_geoms(self._links[GROUND], self._drawn[GROUND], 0j)
        self._hung: dict[str, list[TreeBranch]] = {}
        for branch in tree.branches:
            self._hung.setdefault(branch.parent, []).append(branch)
        self._hang_on(GROUND)

    def site_name(self, link: str, point: str) -> str:
        """Return the name of a site at a point of a link; make the site if it is missing."""
        if (link, point) not in self._sites:
            name = self._sites[link, point] = self._names.frame_on(point, link)
            place = complex(*self._closure.structure.links[link][point]) - self._origins[link]
            where = format_numbers(place.real, place.imag, 0.0)
            ET.SubElement(self._links[link], 'site', name=name, pos=where)
        return self._sites[link, point]

    def input_inertia(self, index: int) -> float:
        """
        Return the approximate inertia that an input moves at the start, in [kg·m²] or [kg].

        The kinetic energy at a rate of 1 is half the inertia. Rates come from finite differences,
        and each link's mass is spread over its points.
        """
        closure = self._closure
        step = DIFFERENCE * (closure.scale if closure.linkage.inputs[index].slider else 1.0)
        for sign in (1.0, -1.0):
            moved = [*self.inputs]
            moved[index] += sign * step
            there = closure.position(*moved)
            if there.joints:
                break
        else:
            return 0.0  # the input's range is narrower than the step: it hardly moves
        before, after = closure.points(self._position), closure.points(there)
        inertia_sum = 0.0
        for link, mass in self._masses.items():
            squares = [
                abs((after[link, point] - before[link, point]) / step) ** 2
                for point in closure.structure.links[link]
            ]
            inertia_sum += mass * sum(squares) / len(squares)
        return inertia_sum

    def _hang_on(self, parent: str) -> None:
        """Write the children of a link, depth first, in the order of the engine's joints."""
        for branch in self._hung.get(parent, ()):
            self._attach_body(branch)
            self._hang_on(branch.child)

    def _attach_body(self, branch: TreeBranch) -> None:
        closure, child = self._closure, branch.child
        place, turn, axis, origin = _pose_on_parent(closure, branch)
        self._origins[child] = origin
        place -= self._origins[branch.parent]
        is_link = child in closure.linkage.links
        name = self._names.own_name(child) if is_link else self._names.free_frame(child)
        value = self._joint_value(branch)
        if branch.kind == 'R':
            turn += branch.sign * value
        else:
            place += value * axis * rect(1.0, turn)
        where = format_numbers(place.real, place.imag, 0.0)
        body = ET.SubElement(self._links[branch.parent], 'body', name=name, pos=where)
        if turn:
            body.set('euler', format_numbers(0.0, 0.0, turn))
        self._links[child] = body
        joint = ET.SubElement(body, 'joint', type='hinge' if branch.kind == 'R' else 'slide')
        if branch.joint:
            joint.set('name', self._names.own_name(branch.joint))
            self.joints[branch.joint] = joint
            write_limits(joint, closure.linkage.limits.get(branch.joint, NO_LIMITS))
        else:
            joint.set('name', self._names.free_joint(f'{child}_at_{branch.name}'))
        flat = format_numbers(axis.real, axis.imag, 0.0)
        joint.set('axis', format_numbers(0.0, 0.0, branch.sign) if branch.kind == 'R' else flat)
        # The engine resets to the pose as written; this is the joint's value in that pose.
        joint.set('ref', format_number(value))
        self.start.append(value)
        mass = closure.linkage.masses.get(child)
        solids = self._drawn[child] if is_link else _slot_block(closure, child)
        if mass is not None:
            _write_inertial(body, mass, origin)
        self._masses[child] = mass.mass if mass else _approximate_mass(solids)
        _write_geoms(body, solids, origin)

    def _joint_value(self, branch: TreeBranch) -> float:
        """Return the value of a joint at the start."""
        if branch.joint in self._driven:
            return self._driven[branch.joint]
        if branch.kind == 'P':
            return self._closure.slide_values(self._position)[branch.name]
        angles = self._closure.link_angles(self._position)
        value = remainder(branch.sign * (angles[branch.child] - angles[branch.parent]), tau)
        for bound in self._closure.bounds.joints:
            if bound.name == branch.joint:
                return bound.turn_to_middle(value)
        return value


def _pose_on_parent(
    closure: PlanarClosure, branch: TreeBranch
) -> tuple[complex, float, complex, complex]:
    """
    Return the pose of a body on its parent with its joint at 0.

    Returns the position, in the frame of the parent's link; the angle; for a slider the axis, in
    the body's own frame; and the body's origin, in the frame of its own link.
    """
    links = closure.structure.links
    if branch.kind == 'R':
        place, own = links[branch.parent][branch.name], links[branch.child][branch.name]
        return complex(*place), 0.0, 0j, complex(*own)
    slider = closure.linkage.sliders[branch.name]
    unit = slider.unit
    if branch.parent == slider.along:
        place, own = links[branch.parent][slider.through], links[branch.child][slider.point]
        turn, axis = slider.angle, unit * rect(1.0, -slider.angle)
    else:
        place, own = links[branch.parent][slider.point], links[branch.child][slider.through]
        turn, axis = -slider.angle, -unit
    return complex(*place), turn, axis, complex(*own)


def _slot_block(closure: PlanarClosure, block: str) -> LinkBody:
    """Return the block that represents a pin in a slot."""
    name = next(slider for slider, of in closure.structure.blocks.items() if of == block)
    slider, width = closure.linkage.sliders[name], bar_width(closure)
    angle = phase(complex(*slider.direction))
    solid = Solid('slot', slider.point, 0j, 0.0, angle, 2.0 * width, 1.5 * width, 0.5 * width)
    return LinkBody((0.35, 0.35, 0.35, 1.0), (solid,))


def _approximate_mass(body: LinkBody) -> float:
    """Return the approximate mass of the solids of a link, in [kg]."""
    return sum(
        (LIGHT if solid.kind == 'slot' else DENSITY)
        * prod((solid.length, solid.width, solid.height))
        for solid in body.solids
    )


def _write_inertial(body: ET.Element, mass: Mass, origin: complex) -> None:
    centre = complex(*mass.center) - origin
    about = max(mass.inertia, LEAST_INERTIA)
    ET.SubElement(
        body,
        'inertial',
        pos=format_numbers(centre.real, centre.imag, 0.0),
        mass=format_number(mass.mass),
        diaginertia=format_numbers(0.5 * about, 0.5 * about, about),
    )


def _write_geoms(element: ET.Element, body: LinkBody, origin: complex) -> None:
    for solid in body.solids:
        at = solid.centre - origin
        where = {
            'pos': format_rough(at.real, at.imag, solid.z),
            'rgba': format_numbers(*body.colour),
        }
        if solid.kind == 'disc':
            size = format_rough(0.5 * solid.width, 0.5 * solid.height)
            ET.SubElement(element, 'geom', where, type='cylinder', size=size)
            continue
        size = format_rough(0.5 * solid.length, 0.5 * solid.width, 0.5 * solid.height)
        where['euler'] = format_rough(0.0, 0.0, solid.angle)
        if solid.kind == 'slot':
            where['density'] = format_number(LIGHT)
        ET.SubElement(element, 'geom', where, type='box', size=size)


def mujoco_model(name: str, parts: Sequence[ModelPart]) -> bytes:
    """
    Return a model of linkages for MuJoCo.

    A PartError says that one has another gravity than the first, a massless link, or names that
    are taken.
    """
    _refuse_massless(parts)
    model = ET.Element('mujoco', model=name)
    model.append(xml_comment(_HEAD.splitlines()))
    ET.SubElement(model, 'compiler', angle='radian', autolimits='true')
    gravity = format_numbers(*_common_gravity(parts))
    option = {'timestep': format_number(_STEP), 'gravity': gravity, 'integrator': 'implicitfast'}
    ET.SubElement(model, 'option', option, solver='Newton', iterations='200', tolerance='1e-12')
    default = ET.SubElement(model, 'default')
    ET.SubElement(default, 'geom', contype='0', conaffinity='0', density=format_number(DENSITY))
    ET.SubElement(default, 'equality', _STIFF)
    width = max(_width_of(part.closure) for part in parts)
    ET.SubElement(default, 'site', size=format_rough(0.2 * width), group='4')
    sections = {
        key: ET.SubElement(model, key)
        for key in ('worldbody', 'equality', 'tendon', 'actuator', 'keyframe')
    }
    start: list[float] = []
    commands: list[float] = []
    layers = 0
    _, names = prefix_names([(part.prefix, part.closure.linkage) for part in parts])
    for part, own in zip(parts, names, strict=True):
        bodies: Any
        if isinstance(part.closure, SpaceClosure):
            bodies = SpaceBodies(sections['worldbody'], part, own)
        else:
            bodies = Bodies(sections['worldbody'], part, own, layers)
        _write_connections(sections, part, bodies)
        _write_servos(sections['actuator'], part, bodies)
        start += bodies.start
        commands += bodies.inputs
        layers += len(part.closure.linkage.links)
    values = {'qpos': format_numbers(*start), 'ctrl': format_numbers(*commands)}
    ET.SubElement(sections['keyframe'], 'key', attrib={'name': 'start', **values})
    for key, section in sections.items():
        if not len(section) and key != 'worldbody':
            model.remove(section)
    return xml_document(model)


def _width_of(closure: Any) -> float:
    """Return the width of bars, in [m]."""
    if isinstance(closure, SpaceClosure):
        return 2.0 * SpaceDrawing(closure).size
    return bar_width(closure)


def _refuse_massless(parts: Sequence[ModelPart]) -> None:
    for count, part in enumerate(parts):
        for link, mass in part.closure.linkage.masses.items():
            # In space links without points are joints of other bodies, or have a light one.
            if not mass.mass and link in part.closure.linkage.links:
                raise PartError(
                    count,
                    f'masses.{link}.mass',
                    'is 0, and MuJoCo moves no massless body',
                    'write a small mass, or omit it: its shape then has one',
                )


def _common_gravity(parts: Sequence[ModelPart]) -> tuple[float, ...]:
    # In the plane there is none across it.
    gravities = [
        (*(part.loads.gravity if part.loads else ()), 0.0, 0.0, 0.0)[:3] for part in parts
    ]
    for count, gravity in enumerate(gravities):
        if gravity != gravities[0]:
            axes = len(parts[count].closure.linkage.axes)
            raise PartError(
                count,
                'loads.gravity',
                f'[{format_numbers(*gravity[:axes])}] differs from the first linkage',
                'give all linkages one gravity: MuJoCo has one',
                of_linkage=False,
            )
    return gravities[0]


def _write_connections(sections: Mapping[str, ET.Element], part: ModelPart, bodies: Any) -> None:
    """Write the connections that are not joints: cut pins and springs."""
    linkage = part.closure.linkage
    links = links_by_point(linkage.links)
    for point in linkage.traced:
        bodies.site_name(links[point][0], point)
    for point, link, neighbour in bodies.cuts:
        ends = {
            'site1': bodies.site_name(link, point),
            'site2': bodies.site_name(neighbour, point),
        }
        name = f'{ends["site1"]} = {ends["site2"]}'
        ET.SubElement(sections['equality'], 'connect', {'name': name, **ends})
    for body, neighbour in bodies.welds:
        ET.SubElement(sections['equality'], 'weld', body1=body, body2=neighbour)
    for name, ratio in linkage.ratios.items():
        if ratio.also:
            raise PartError(
                0, f'ratios.{name}', 'adds joints, and MuJoCo follows one', 'follow one joint'
            )
        if not {name, ratio.of} <= {*bodies.joints}:
            raise PartError(
                0,
                f'ratios.{name}',
                'one of its two joints is cut, or lies between links without a common pin',
                'publish the joint at a pin of the tree',
            )
        follower, leader = (bodies.joints[joint].get('name', '') for joint in (name, ratio.of))
        # The engine counts both from the pose as written, in which the ratio holds.
        coefficients = format_numbers(0.0, ratio.ratio, 0.0, 0.0, 0.0)
        ET.SubElement(
            sections['equality'], 'joint', joint1=follower, joint2=leader, polycoef=coefficients
        )
    for spring in part.loads.springs if part.loads else ():
        tendon = ET.SubElement(
            sections['tendon'],
            'spatial',
            name=part.prefix + spring.name,
            stiffness=format_number(spring.stiffness),
            springlength=format_number(spring.free_length),
            damping=format_number(spring.damping),
            width=format_rough(0.15 * _width_of(part.closure)),
        )
        for end in spring.ends:
            ET.SubElement(tendon, 'site', site=bodies.site_name(*end))


def _write_servos(actuators: ET.Element, part: ModelPart, bodies: Any) -> None:
    """Drive the inputs by servos whose stiffness suits the inertia that they move."""
    motor = part.loads.drive_inertia if part.loads else 0.0
    for count, driven in enumerate(part.closure.linkage.inputs):
        inertia = bodies.input_inertia(count) + motor
        joint = bodies.joints[driven.joint]
        if motor:
            joint.set('armature', format_number(motor))
        servo = ET.SubElement(
            actuators,
            'position',
            name=joint.get('name', ''),
            joint=joint.get('name', ''),
            kp=format_rough(inertia * _PACE * _PACE),
            kv=format_rough(2.0 * inertia * _PACE),
        )
        if driven.limits.is_bounded:
            servo.set('ctrlrange', joint.get('range', ''))
