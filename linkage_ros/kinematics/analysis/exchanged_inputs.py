# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A linkage with other joints as its inputs: another plan, the same assembly."""

from __future__ import annotations

from cmath import rect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from math import inf, sin, tau
from typing import TYPE_CHECKING, TypeVar

from linkage_ros.errors import DefinitionError, did_you_mean, list_names
from linkage_ros.kinematics.analysis.sweep_analysis import usual_inputs
from linkage_ros.kinematics.plane.checks import check_linkage
from linkage_ros.kinematics.plane.linkage import (
    AssemblyPose,
    Input,
    Linkage,
    RevoluteJoint,
    SlideJoint,
    Slider,
    turn_ratios,
)

if TYPE_CHECKING:
    from linkage_ros.kinematics.analysis.crank_branches import CrankBranch
    from linkage_ros.kinematics.results import PlanarClosure, Position

_SAME = 1e-6
"""Largest difference of joints in one assembly, in [rad] or of the linkage's size."""

_STARTS = (0.47, 0.31, 0.68)
_TRIED = (0.02, 0.11, 0.23, 0.37, 0.5, 0.63, 0.77, 0.89, 0.98)
"""Parts of a branch at which the assembly is taken, and at which it is compared."""

Built = TypeVar('Built', bound='PlanarClosure')

Rebuild = Callable[[Linkage], Built]


def exchange_inputs(
    closure: PlanarClosure, names: Sequence[str], rebuild: Rebuild[Built]
) -> Built:
    """
    Return a closure with these published joints as its inputs, and its inputs as joints.

    The pose at which the linkage is shown gives the assembly; ``rebuild`` makes a closure.

    More or fewer joints than inputs, an unknown joint and a repeated one raise DefinitionError.
    """
    count = len(closure.linkage.inputs)
    if len(names) != count or len({*names}) != count:
        raise DefinitionError(
            ', '.join(names), f'{len(names)} for {count} inputs', f'name {count} different joints'
        )
    at = usual_inputs(closure)
    zeros = (0.0,) * count
    near = {name: (value, *zeros) for name, value in zip(closure.input_names, at, strict=True)}
    exchange = _Exchange(closure, names, near)
    position = closure.close_unlimited(*at)
    try:
        found = exchange.plan(position, {}, rebuild)
    except DefinitionError as error:
        reason = f'do not move all of it: {error.where}: {error.reason}'
        raise DefinitionError(', '.join(names), reason, 'name other joints') from None
    if not exchange.meets(found, position, {}):
        raise DefinitionError(
            ', '.join(names), 'do not close in the assembly of the pose', 'name other joints'
        )
    return found


def exchange_input(
    closure: PlanarClosure, name: str, branch: CrankBranch, rebuild: Rebuild[Built]
) -> Built:
    """
    Return the closure of a single input with a published joint as its input.

    The branch of that joint gives the assembly, and the whole turns of the former input. A change
    point that the other plan does not pass raises DefinitionError.
    """
    (given,) = closure.linkage.inputs
    exchange = _Exchange(closure, (name,), {given.joint: branch.near_line()})
    reason, remedy = 'as the input passes a change point to another assembly', 'name another joint'
    error = DefinitionError(name, reason, remedy)
    for share in _STARTS:
        value, crank = branch.state_at(share)
        try:
            found = exchange.plan(closure.close_unlimited(crank), {name: value}, rebuild)
        except DefinitionError as refused:
            error = refused
            continue
        states = map(branch.state_at, _TRIED)
        if all(
            exchange.meets(found, closure.close_unlimited(crank), {name: value})
            for value, crank in states
        ):
            return found
    raise error


class _Exchange:
    """The definition of a linkage with other inputs; ``near`` says how the former ones turn."""

    def __init__(
        self, closure: PlanarClosure, names: Sequence[str], near: Mapping[str, tuple[float, ...]]
    ) -> None:
        self._closure, self._names = closure, names
        linkage = closure.linkage
        driven = {given.joint: given for given in linkage.inputs}
        joints = {name: _as_joint(given, near[name]) for name, given in driven.items()}
        joints |= {name: joint for name, joint in linkage.joints.items() if name not in driven}
        inputs = []
        for name in names:
            if name not in joints:
                remedy = did_you_mean(name, joints, f'name one of {list_names(joints)}')
                raise DefinitionError(name, 'is neither a published joint nor an input', remedy)
            inputs.append(driven.get(name) or Input.from_joint(name, joints[name]))
        # The inputs as joints, and the other joints.
        self._joints = {name: joint for name, joint in joints.items() if name not in names}
        self._linkage = replace(
            linkage,
            inputs=tuple(inputs),
            joints=self._joints,
            assembly={},
            pose=None,
            ratios=turn_ratios(linkage.ratios, names),
            nominal=None,
        )
        self._hold_without_pins()
        check_linkage(self._linkage)

    def plan(
        self, position: Position, known: Mapping[str, float], rebuild: Rebuild[Built]
    ) -> Built:
        """Return the closure in the assembly of a position of the linkage; it is not checked."""
        linkage, values = self._linkage, self._values_at(position, known)
        if not position.status.has_pose:
            raise DefinitionError('pose', 'the loops are open there', 'draw another pose')
        places, angles = self._closure.points(position), self._closure.link_angles(position)
        points: dict[str, tuple[float, float]] = {}
        for link, on_link in linkage.links.items():
            if link in self._carriers:
                parent, pin = self._carriers[link]
                arm = places[pin] - places[parent, next(iter(linkage.links[parent]))]
                way = rect(1.0, angles[parent])
                along = (arm * way.conjugate()).real * way
                place = places[parent, next(iter(linkage.links[parent]))] + along
                points[link] = (place.real, place.imag)
                angles[link] = angles[parent]
            for point in on_link:
                if (link, point) in places:
                    place = places[link, point]
                    points[point] = (place.real, place.imag)
        drawn = AssemblyPose(
            tuple(_turn_within(values[given.joint], given) for given in linkage.inputs),
            points,
            {link: angle for link, angle in angles.items() if link in linkage.links},
        )
        return rebuild(replace(linkage, pose=drawn))

    def meets(self, found: PlanarClosure, position: Position, known: Mapping[str, float]) -> bool:
        """Return whether a closure has the joints of a position of the linkage."""
        values = self._values_at(position, known)
        again = found.close_unlimited(*(values[name] for name in self._names))
        return bool(again.joints) and all(
            abs(sin(0.5 * (again[name] - values[name]))) < _SAME
            if isinstance(joint, RevoluteJoint)
            else abs(again[name] - values[name]) < _SAME * self._closure.scale
            for name, joint in self._joints.items()
        )

    def _values_at(self, position: Position, known: Mapping[str, float]) -> dict[str, float]:
        names = self._closure.input_names
        return {**position, **dict(zip(names, position.inputs, strict=True)), **known}

    def _hold_without_pins(self) -> None:
        """
        Give inputs that turn two links without a common pin such a pin.

        A carrier slides along the parent, and a block across on the carrier: it takes a pin of the
        child, and the angle of the parent.
        """
        linkage = self._linkage
        self._carriers: dict[str, tuple[str, tuple[str, str]]] = {}
        inputs, links, sliders = [], dict(linkage.links), dict(linkage.sliders)
        for given in linkage.inputs:
            parent, child = (linkage.links.get(end, {}) for end in (given.parent, given.child))
            held = given
            if not given.slider and not {*parent} & {*child}:
                carrier, block = f'carrier of {given.joint}', f'block of {given.joint}'
                pin, through = next(iter(child)), next(iter(parent))
                links[carrier], links[block] = {carrier: (0.0, 0.0)}, {pin: (0.0, 0.0)}
                along = Slider(carrier, given.parent, through, (1.0, 0.0), carrier)
                sliders[carrier] = along
                sliders[block] = Slider(pin, carrier, carrier, (0.0, 1.0), block)
                self._carriers[carrier] = given.parent, (given.child, pin)
                held = replace(given, parent=block)
            inputs.append(held)
        self._linkage = replace(linkage, inputs=tuple(inputs), links=links, sliders=sliders)


def _as_joint(given: Input, near: tuple[float, ...]) -> RevoluteJoint | SlideJoint:
    """Return a former input as a joint, whose angle comes round to limits on one side."""
    joint = given.as_joint()
    if isinstance(joint, SlideJoint):
        return joint
    if inf in (-joint.limits.low, joint.limits.high):
        joint = replace(joint, limits=replace(joint.limits, low=-inf, high=inf))
    return replace(joint, near=near)


def _turn_within(value: float, given: Input) -> float:
    """Return the value of a new input, with the whole turns that its limits allow."""
    low, high = given.limits.low, given.limits.high
    if inf in (-low, high):
        return value
    if not given.slider:
        value -= tau * round((value - 0.5 * (low + high)) / tau)
    return min(max(value, low), high)
