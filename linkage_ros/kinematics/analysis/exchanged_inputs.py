# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A linkage of several inputs with other joints as its inputs: another plan, the same assembly."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import islice, product
from math import sin
from typing import Any, TYPE_CHECKING

from linkage_ros.errors import DefinitionError, did_you_mean, list_names
from linkage_ros.kinematics.analysis.sweep_analysis import usual_inputs
from linkage_ros.kinematics.plane.checks import check_linkage
from linkage_ros.kinematics.plane.linkage import AssemblyPose, Input, Linkage, RevoluteJoint
from linkage_ros.kinematics.plane.sides import assembly_sides
from linkage_ros.kinematics.plane.topology import assur_groups, Iterated

if TYPE_CHECKING:
    from linkage_ros.kinematics.results import PlanarClosure

_SAME = 1e-6
"""Largest difference of joints in one assembly, in [rad] or of the linkage's size."""

_MOST = 1024
"""Most assemblies that are tried."""


def exchange_inputs(
    closure: PlanarClosure, names: Sequence[str], rebuild: Callable[[Linkage], PlanarClosure]
) -> Linkage:
    """
    Return the linkage with these published joints as its inputs, and its inputs as joints.

    The pose at which the linkage is shown gives the assembly; ``rebuild`` makes a closure.

    More or fewer joints than inputs, an unknown joint and a repeated one raise DefinitionError.
    """
    linkage = closure.linkage
    count = len(linkage.inputs)
    if len(names) != count or len({*names}) != count:
        raise DefinitionError(
            ', '.join(names), f'{len(names)} for {count} inputs', f'name {count} different joints'
        )
    driven = {given.joint: given for given in linkage.inputs}
    inputs = []
    for name in names:
        joint = linkage.joints.get(name)
        if name in driven:
            inputs.append(driven[name])
        elif joint is not None:
            inputs.append(Input.from_joint(name, joint))
        else:
            known = [*linkage.joints, *driven]
            remedy = did_you_mean(name, known, f'name one of {list_names(known)}')
            raise DefinitionError(name, 'is neither a published joint nor an input', remedy)
    # The inputs as joints, and the other joints.
    joints = {given.joint: given.as_joint() for given in linkage.inputs}
    joints = {
        name: joint for name, joint in (joints | dict(linkage.joints)).items() if name not in names
    }
    position = closure.position(*usual_inputs(closure))
    values = dict(zip(closure.joint_names, position.joints, strict=True))
    values |= dict(zip(closure.input_names, position.inputs, strict=True))
    exchanged = replace(
        linkage, inputs=tuple(inputs), joints=joints, assembly={}, pose=None, nominal=None
    )
    check_linkage(exchanged)
    structure = assur_groups(exchanged)
    iterated = {
        link for group in structure.groups if isinstance(group, Iterated) for link in group.links
    }
    if iterated:
        points = {
            point: (place.real, place.imag)
            for (link, point), place in closure.points(position).items()
            if link in iterated
        }
        start = tuple(values[name] for name in names)
        exchanged = replace(exchanged, pose=AssemblyPose(start, points))
    sides = assembly_sides(structure)
    for words in islice(product(*sides.values()), _MOST):
        assembly: Any = dict(zip(sides, words, strict=True))
        found = replace(exchanged, assembly=assembly)
        again = rebuild(found).position(*(values[name] for name in names))
        if again.joints and all(
            abs(sin(0.5 * (again[name] - values[name]))) < _SAME
            if isinstance(joint, RevoluteJoint)
            else abs(again[name] - values[name]) < _SAME * closure.scale
            for name, joint in joints.items()
        ):
            return found
    raise DefinitionError(
        ', '.join(names), 'do not close in the assembly of the pose', 'name other joints'
    )
