# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What the joints of a linkage in space transmit; for the table see `JointForm`."""

from __future__ import annotations

from collections.abc import Callable, Collection

from linkage_ros.dynamics.joint_forms import Action, Direction, JointForm, JointForms
from linkage_ros.kinematics import (
    balls_of,
    CarriedPoints,
    cross,
    GROUND,
    GROUND_FRAME,
    length,
    minus,
    Position,
    scale,
    SpaceClosure,
    SpatialJoint,
    unit_across,
    Vector,
    ZERO,
)

_ALL: tuple[Direction, ...] = (0, 1, 2)


def spatial_forms(closure: SpaceClosure, rubbing: Collection[int]) -> JointForms:
    """
    Return what the joints of a linkage in space transmit.

    First come hinges and slides, then struts, then balls. Joints with the numbers ``rubbing``
    transmit first what presses on their guide: the forces across their axes.
    """
    linkage = closure.linkage
    carried = CarriedPoints(linkage, closure.scale)
    joints = [
        _spatial_form(closure, name, joint, number in rubbing)
        for number, (name, joint) in enumerate(linkage.pair_joints.items())
    ]
    for name, (start_point, end_point) in linkage.struts.items():
        links = [carried.carriers[carried.same[end]][0] for end in (end_point, start_point)]
        ends = [
            (link, linkage.points[end])
            for link, end in zip(links, (end_point, start_point), strict=True)
        ]
        along = _strut_direction(closure, ends)
        link, to = links
        joints.append(JointForm(name, link, to, ends[0], (), (), slides=True, axis=along))
    efforts = {joint.name: joint.motion(number) for number, joint in enumerate(joints)}
    for point, first, link in balls_of(linkage, carried):
        holder = next((holding for holding in (first, link) if holding not in closure.idle), first)
        place = holder, scale(closure.scale, carried.places[point])
        name = next(name for name in linkage.points if carried.same[name] == point)
        joints.append(JointForm(name, link, first, place, (0, 1, 2), ()))
    spins = tuple(
        Action(link, GROUND, _strut_direction(closure, _rod_ends(closure, link)))
        for link in closure.idle
    )
    spins += tuple(efforts[name] for name in closure.held)
    return JointForms(linkage.link_names[1:], tuple(joints), efforts, spins)


def spatial_bar(
    closure: SpaceClosure, link: str, near: JointForm, far: JointForm
) -> Callable[[Position], Vector]:
    """Return the direction on a link from one of its joints to another, where nearest."""
    import numpy as np  # local import: few scenes

    hinges = closure.linkage.hinges
    places = [np.array(joint.point[1]) for joint in (near, far)]
    axes = [np.array(hinges[joint.name].axis if joint.axis else ZERO) for joint in (near, far)]
    # The least steps along both axes that lead to the shortest bar.
    steps, *_ = np.linalg.lstsq(
        np.transpose(axes) * (-1.0, 1.0), places[0] - places[1], rcond=None
    )
    start, end = (
        tuple((place + step * axis).tolist())
        for place, step, axis in zip(places, steps, axes, strict=True)
    )
    return _strut_direction(closure, [(link, end), (link, start)])


def _spatial_form(closure: SpaceClosure, name: str, joint: SpatialJoint, rubs: bool) -> JointForm:
    linkage = closure.linkage
    axis = scale(1.0 / length(joint.axis), joint.axis)
    x = unit_across(axis)
    along = closure.carried_vector(joint.parent, axis)
    ends = name, joint.child, joint.parent
    across = tuple(_carried_direction(closure, joint.parent, way) for way in (x, cross(axis, x)))
    if name in linkage.slides:
        points = linkage.links.get(joint.child, ())
        at = linkage.points[points[0]] if points else joint.at
        return JointForm(*ends, (joint.child, at), across, _ALL, slides=True, axis=along)
    forces = (*across, along) if rubs else _ALL
    carrier = GROUND if joint.parent == GROUND else joint.child
    return JointForm(*ends, (carrier, joint.at), forces, across, axis=along)


def _carried_direction(closure: SpaceClosure, link: str, vector: Vector) -> Direction:
    """Return a direction that a link turns; its sign does not matter."""
    if link == GROUND:
        for number, axis in enumerate(GROUND_FRAME[:3]):
            if tuple(map(abs, vector)) == axis:
                return number
    return closure.carried_vector(link, vector)


def _rod_ends(closure: SpaceClosure, link: str) -> list[tuple[str, Vector]]:
    axis = closure.rod_axis(link)
    return [(link, axis.end), (link, axis.start)]


def _strut_direction(
    closure: SpaceClosure, ends: list[tuple[str, Vector]]
) -> Callable[[Position], Vector]:
    """Return the direction from the second of two points to the first one."""
    tracker = closure.point_tracker(ends)

    def direction(position: Position) -> Vector:
        end, start = tracker.places(position)
        along = minus(end, start)
        return scale(1.0 / length(along), along)

    return direction
