# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Reduce a URDF to its plane: bodies, which are links joined by fixed joints, and their joints.

All joints of the loops turn about one direction or slide across it. With all joints at 0, all
bodies have the frame of the ground: a joint is at 0 where the frames of its bodies are parallel,
as in a linkage file.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from math import cos, sin
from typing import Any, NamedTuple

from linkage_ros.description import MOVING, pin_frames, PLACE, UrdfFile, UrdfJoint, UrdfLink
from linkage_ros.errors import did_you_mean, FileError, list_names, quote
from linkage_ros.kinematics import Mass, NO_LIMITS
import numpy as np

# The pins that close the loops of a URDF, as requested or by frames named PIN_on_LINK, and the
# links and joints of these loops.

_LINE = '_line'

_ZERO = (0.0, 0.0, 0.0)

Array = Any
"""A vector of 3, or a matrix of 3 × 3."""

_PARALLEL = 1e-6
"""Sine of the largest angle between a joint and the plane that still counts as planar."""


class Closing(NamedTuple):
    """Frames that coincide."""

    name: str  # Name of the pin or slider
    frames: tuple[str, ...]  # Links of the URDF, two or more
    line: bool = False  # True if the second only has to lie on the x axis of the first


def find_closings(
    urdf: UrdfFile, asked: Sequence[tuple[str, str]]
) -> tuple[list[Closing], dict[str, str]]:
    """
    Return the closing constraints, and the single frames, which are points, with their names.

    The origins of each pair of asked links coincide; a FileError if one of the two does not exist.
    """
    found = pin_frames(urdf)
    closings = []
    for name in list(found):
        slider = name.removesuffix(_LINE)
        if name != slider and len(found[name]) == 1 and len(found.get(slider, ())) == 1:
            closings.append(Closing(slider, (*found.pop(name), *found.pop(slider)), line=True))
    alone = {frames[0]: name for name, frames in found.items() if len(frames) == 1}
    closings += [Closing(name, tuple(of)) for name, of in found.items() if len(of) > 1]
    for pair in asked:
        for link in pair:
            if link not in urdf.links:
                place = PLACE.fullmatch(link)
                named = place[1] if place else link
                raise FileError(
                    urdf.file,
                    f'--close {"=".join(pair)}',
                    f'there is no link {quote(named)}',
                    did_you_mean(named, urdf.links, f'name two of {list_names(urdf.links)}'),
                )
        if pair[0] == pair[1]:
            raise FileError(
                urdf.file, f'--close {"=".join(pair)}', 'names one link twice', 'name two'
            )
        closings.append(Closing(PLACE.sub(r'\1_end', pair[0]), pair))
    return closings, alone


def find_pinned(urdf: UrdfFile) -> Iterator[tuple[str, str]]:
    """Yield pairs of places that meet, LINK.x,y,z, of joints that Gazebo closes loops by."""
    frames = {urdf.root: (np.eye(3), np.zeros(3))}
    for joint in urdf.joints.values():
        turn, place = frames[joint.parent]
        frames[joint.child] = (
            turn @ _rotation_matrix(joint.rpy),
            place + turn @ np.array(joint.xyz),
        )
    for end, parent in urdf.pinned:
        found = PLACE.fullmatch(end)
        assert found
        (turn, place), (to, origin) = frames[found[1]], frames[parent]
        there = to.T @ (place + turn @ np.array([*map(float, found.groups()[1:])]) - origin)
        yield end, f'{parent}.{",".join(repr(float(value)) for value in there)}'


def add_places(urdf: UrdfFile, asked: Sequence[tuple[str, str]]) -> UrdfFile:
    """Return the robot with a frame at each asked place, LINK.x,y,z, which bears its name."""
    links, joints = dict(urdf.links), dict(urdf.joints)
    for name in (name for pair in asked for name in pair):
        found = PLACE.fullmatch(name)
        if name in links or not found or found[1] not in links:
            continue
        x, y, z = map(float, found.groups()[1:])
        links[name] = UrdfLink(None, False, ())
        joints[name] = UrdfJoint(
            name, 'fixed', found[1], name, (x, y, z), _ZERO, _ZERO, '', 1.0, 0.0, NO_LIMITS
        )
    return urdf._replace(links=links, joints=joints)


class UrdfLoops(NamedTuple):
    """The links and joints of a URDF that belong to its loops."""

    ground: str  # The root link of the loops
    joints: frozenset[str]  # Joints that move in the loops, or are driven
    left_out: tuple[str, ...]  # All other joints, and the links connected only by them, in words


def find_loops(urdf: UrdfFile, closings: Sequence[Closing], inputs: Sequence[str]) -> UrdfLoops:
    """Find the loops: leave out bodies held by a single joint that is not driven, repeatedly."""
    body_of = {urdf.root: urdf.root}
    edges: list[tuple[str, str, str]] = []
    for joint in urdf.joints.values():
        moves = joint.kind in MOVING
        body_of[joint.child] = joint.child if moves else body_of[joint.parent]
        if moves:
            edges.append((body_of[joint.parent], joint.child, joint.name))
    for closing in closings:
        first, *others = (body_of[frame] for frame in closing.frames)
        edges += [(first, other, '') for other in others]
    bodies = list(dict.fromkeys(body_of.values()))
    left_out = []
    while len(bodies) > 1:
        for body in bodies:
            held = [edge for edge in edges if body in edge[:2]]
            if len(held) < 2 and not any(
                edge[2] in inputs or (edge[2] and urdf.joints[edge[2]].mimics in inputs)
                for edge in held
            ):
                break
        else:
            break
        bodies.remove(body)
        edges = [edge for edge in edges if edge not in held]
        left_out.append(f'link {body}')
    kept = frozenset(edge[2] for edge in edges if edge[2])
    return UrdfLoops(bodies[0], kept, tuple(left_out))


class Frame(NamedTuple):
    """Position of a link on its body, in [m], and its x axis there, as complex numbers."""

    body: str
    place: complex
    facing: complex


class PlanarJoint(NamedTuple):
    """A joint between bodies."""

    name: str  # Name of the URDF's joint
    kind: str  # ``R`` or ``P``
    # Bodies.
    parent: str
    child: str
    place: complex  # Position on the parent, in [m]; it is the child's origin
    axis: complex  # A unit vector for a slide; +1 or −1 for a turn
    # The joint that it follows, '' if none, with factor and offset.
    mimics: str
    multiplier: float
    offset: float


@dataclass(slots=True)
class Planar:
    """A URDF in the plane."""

    root: str  # The root of the tree of bodies: the ground
    frames: dict[str, Frame] = field(default_factory=dict)  # Frames of all links of the URDF
    joints: list[PlanarJoint] = field(default_factory=list)  # Joints, parents first
    bodied: set[str] = field(default_factory=set)  # Bodies with a shape or a mass
    # Named positions on bodies.
    marks: list[tuple[str, str, complex]] = field(default_factory=list)
    # Masses of bodies, as far as they are given.
    masses: dict[str, Mass] = field(default_factory=dict)
    # x, y and normal of the plane in the frame of the ground, as rows.
    basis: Array = None
    # With all joints at 0, rotation of each link of the URDF from the frame of the ground, and
    # height of each body above the plane, in [m].
    turns: dict[str, Array] = field(default_factory=dict)
    heights: dict[str, float] = field(default_factory=dict)


def lay_flat(urdf: UrdfFile, loops: UrdfLoops) -> Planar:
    """
    Reduce the loops of a URDF to their plane.

    A FileError is raised if its joints are not in one plane; it names the first that is not.
    """
    turns: dict[str, Array] = {loops.ground: np.eye(3)}
    for joint in urdf.joints.values():
        if joint.parent in turns:
            turns[joint.child] = turns[joint.parent] @ _rotation_matrix(joint.rpy)
    basis = _plane_basis(urdf, turns, loops)

    def to_plane(vector: Array) -> complex:
        return complex(basis[0] @ vector, basis[1] @ vector)

    planar = Planar(loops.ground, basis=basis, turns=turns, heights={loops.ground: 0.0})
    bodies = {loops.ground: (loops.ground, np.zeros(3))}
    for joint in urdf.joints.values():
        if joint.parent not in bodies or not (
            joint.name in loops.joints or joint.kind not in MOVING
        ):
            continue
        body, place = bodies[joint.parent]
        place = place + turns[joint.parent] @ np.array(joint.xyz)
        if joint.kind not in MOVING:
            bodies[joint.child] = (body, place)
            continue
        bodies[joint.child] = (joint.child, np.zeros(3))
        planar.heights[joint.child] = planar.heights[body] + float(basis[2] @ place)
        axis = turns[joint.child] @ _unit_vector(joint.axis)
        turning = joint.kind != 'prismatic'
        along = complex(1 if basis[2] @ axis > 0.0 else -1) if turning else to_plane(axis)
        planar.joints.append(
            PlanarJoint(
                joint.name,
                'R' if turning else 'P',
                body,
                joint.child,
                to_plane(place),
                along,
                joint.mimics,
                joint.multiplier,
                joint.offset,
            )
        )
    weights: dict[str, list[tuple[float, complex, float]]] = {}
    for name, (body, place) in bodies.items():
        link = urdf.links[name]
        planar.frames[name] = Frame(body, to_plane(place), to_plane(turns[name][:, 0]))
        if link.bodied:
            planar.bodied.add(body)
        for mark, xyz in link.marks:
            planar.marks.append((mark, body, to_plane(place + turns[name] @ np.array(xyz))))
        if link.inertial is not None:
            centre = to_plane(place + turns[name] @ np.array(link.inertial.xyz))
            axes = turns[name] @ _rotation_matrix(link.inertial.rpy)
            ixx, ixy, ixz, iyy, iyz, izz = link.inertial.tensor
            tensor = np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]])
            about = float(basis[2] @ axes @ tensor @ axes.T @ basis[2])
            weights.setdefault(body, []).append((link.inertial.mass, centre, about))
    planar.masses = {body: _combine_masses(found) for body, found in weights.items()}
    return planar


def _combine_masses(parts: list[tuple[float, complex, float]]) -> Mass:
    """Return the total of masses fixed to each other (parallel axis theorem)."""
    if len(parts) == 1:  # every digit as given
        ((mass, centre, inertia),) = parts
    else:
        mass = sum(each for each, _, _ in parts)
        centre = sum(each * place for each, place, _ in parts) / mass
        inertia = sum(own + each * abs(place - centre) ** 2 for each, place, own in parts)
    return Mass(mass, (centre.real, centre.imag), max(inertia, 0.0))


def _plane_basis(urdf: UrdfFile, turns: dict[str, Array], loops: UrdfLoops) -> Array:
    """
    Return x and y of the plane and its normal in the frame of the ground, as rows.

    They are the ground's own axes if the plane is one of its coordinate planes; the largest
    component of the normal is positive.
    """

    def joint_axis(joint: UrdfJoint) -> Array:
        return turns[joint.child] @ _unit_vector(joint.axis)

    moving = [joint for joint in urdf.joints.values() if joint.name in loops.joints]
    turning = [joint for joint in moving if joint.kind != 'prismatic']
    if not turning:
        raise FileError(urdf.file, '', 'no joint of its loops turns', 'close others by --close')
    normal = joint_axis(turning[0])
    largest = int(np.argmax(np.abs(normal)))
    normal = normal * np.sign(normal[largest])
    for joint in moving:
        found, first = joint_axis(joint), turning[0].name
        if joint.kind == 'prismatic':
            off = abs(float(found @ normal))
            reason = f'does not slide in the plane that {first} turns in'
        else:
            off = float(np.linalg.norm(np.cross(found, normal)))
            reason = f'turns about another direction than {first}'
        if off > _PARALLEL:
            raise FileError(
                urdf.file,
                f'joint {joint.name}',
                reason,
                'write it fixed, or leave it out: a linkage lies in one plane',
            )
    x = np.eye(3)[(largest + 1) % 3]
    x = _unit_vector(x - (x @ normal) * normal)
    return np.array([x, np.cross(normal, x), normal])


def _unit_vector(vector: Any) -> Array:
    vector = np.array(vector, float)
    return vector / np.linalg.norm(vector)


def _rotation_matrix(rpy: tuple[float, float, float]) -> Array:
    """Return the rotation matrix of roll, pitch and yaw about fixed axes, as in URDF."""
    (cr, cp, cy), (sr, sp, sy) = map(cos, rpy), map(sin, rpy)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )
