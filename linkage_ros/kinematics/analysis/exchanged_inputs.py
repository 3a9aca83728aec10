# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.


"""
A linkage with other joints as its inputs: another plan, the same assembly.

Plane and space differ in how a linkage with other inputs is written down: `PlaneExchange` does it
for the plane, `SpaceClosure.plan_exchange` in space. All else is here: which state gives the
assembly, whether the names move the linkage there, and whether what is planned has its joints.
"""

from __future__ import annotations

from cmath import rect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import product
from math import inf, sin, tau
from typing import Any, TYPE_CHECKING, TypeVar

from linkage_ros.errors import DefinitionError
from linkage_ros.kinematics.analysis.sweep_analysis import usual_inputs
from linkage_ros.kinematics.plane.checks import check_linkage
from linkage_ros.kinematics.plane.linkage import (
    AssemblyPose,
    Input,
    Limits,
    Linkage,
    NO_LIMITS,
    RevoluteJoint,
    SlideJoint,
    Slider,
    turn_ratios,
)
from linkage_ros.kinematics.status import Status

if TYPE_CHECKING:
    from linkage_ros.kinematics.analysis.crank_branches import CrankBranch
    from linkage_ros.kinematics.closure import Closure
    from linkage_ros.kinematics.plane.closure import PlanarClosure
    from linkage_ros.kinematics.results import Near, Position

_SAME = 1e-6
"""Largest difference of joints in one assembly, in [rad] or of the linkage's size."""

_STARTS = (0.47, 0.31, 0.68)
_TRIED = (0.02, 0.11, 0.23, 0.37, 0.5, 0.63, 0.77, 0.89, 0.98)
"""Parts of a branch at which the assembly is taken, and at which it is compared."""

_STILL, DEPENDENT = 1e-9, 1e-9
"""The slope of a joint that does not move, and the least of slopes of joints that do, together."""

_STEP, _MOST_MET = 0.1, 1000
"""Steps of a lattice of inputs, in [rad] or of the linkage's size; and most of its states."""

Built = TypeVar('Built', bound='Closure')


def exchange_inputs(
    closure: Built, names: Sequence[str], branch: int | None, near: Sequence[float] | None
) -> Built:
    """
    Return a closure with these joints as its inputs, and its inputs as joints.

    With one input the branch of a number has the assembly, or that nearest to a crank; else the
    state ``near`` has it, or that at which the linkage is shown.

    Names that are unknown, too many or too few, or that do not move all of the linkage raise
    DefinitionError.
    """
    count = len(closure.input_names)
    if len(names) != count or len({*names}) != count:
        raise DefinitionError(
            ', '.join(names), f'{len(names)} for {count} input{"s" * (count != 1)}',
            f'name {count} different joint{"s" * (count != 1)}',
        )  # fmt: skip
    if near is not None and len(near) != count:
        raise DefinitionError(
            'near', f'{len(near)} values', f'give one for each of {count} inputs'
        )
    measured: Built = closure.measuring(*names)
    if count == 1:
        on = closure.find_branch(names[0], branch, None if near is None else near[0])
        return _exchange_on_branch(measured, names[0], on)
    if branch is not None:
        raise DefinitionError(
            f'branch {branch}', f'there are {count} inputs, and no branches',
            'leave it out: the pose has the assembly',
        )  # fmt: skip
    return _exchange_at(measured, names, near or usual_inputs(closure))


def _exchange_at(closure: Built, names: Sequence[str], at: Sequence[float]) -> Built:
    """Return the closure with several other inputs, in the assembly of a state."""
    zeros = (0.0,) * len(names)
    near = {name: (value, *zeros) for name, value in zip(closure.input_names, at, strict=True)}
    position = closure.close_unlimited(*at)
    check_moved(closure, names, position)
    plan = closure.plan_exchange(names, near)
    try:
        exchanged: Built = plan(position, {}, {})
        if exchanged.grids and (limits := _reached_limits(closure, names, at)):
            exchanged = plan(position, {}, limits)
    except DefinitionError as error:
        reason = f'do not move all of it: {error.where}: {error.reason}'
        raise DefinitionError(', '.join(names), reason, 'name other joints') from None
    if not _meets(closure, exchanged, position, {}):
        raise DefinitionError(
            ', '.join(names), 'do not close in the assembly of the pose', 'name other joints'
        )
    return exchanged


def _exchange_on_branch(closure: Built, name: str, branch: CrankBranch) -> Built:
    """
    Return the closure of a single input with another joint as its input.

    The branch of that joint gives the assembly, and the whole turns of the former input. A change
    point that the other plan does not pass raises DefinitionError.
    """
    (former,) = closure.input_names
    plan = closure.plan_exchange((name,), {former: branch.near_line()})
    reason, remedy = 'as the input passes a change point to another assembly', 'name another joint'
    error = DefinitionError(name, reason, remedy)
    for value, crank in map(branch.state_at, _STARTS):
        try:
            exchanged: Built = plan(closure.close_unlimited(crank), {name: value}, {})
        except DefinitionError as refused:
            error = refused
            continue
        if all(
            _meets(closure, exchanged, closure.close_unlimited(crank), {name: value})
            for value, crank in map(branch.state_at, _TRIED)
        ):
            return exchanged
    raise error


def _values_at(
    closure: Closure, position: Position, known: Mapping[str, float]
) -> dict[str, float]:
    inputs = zip(closure.input_names, position.inputs, strict=True)
    return {**position, **dict(inputs), **known}


def _meets(
    closure: Closure,
    exchanged: Closure,
    position: Position,
    known: Mapping[str, float],
) -> bool:
    """Return whether a closure has the joints of a position of the linkage."""
    values = _values_at(closure, position, known)
    again = exchanged.close_unlimited(*(values[name] for name in exchanged.input_names))
    return bool(again.joints) and all(
        abs(sin(0.5 * (again[name] - values[name]))) < _SAME
        if turning
        else abs(again[name] - values[name]) < _SAME * closure.scale
        for name, turning in zip(exchanged.joint_names, exchanged.turning, strict=True)
    )


def check_moved(closure: Closure, names: Sequence[str], position: Position) -> None:
    """Refuse names that do not say at a position how the inputs move."""
    if not position.status.has_rates:
        return
    import numpy as np  # local import: one input does without it

    # Of lengths in sizes of the linkage.
    units = [closure.scale if driven.slider else 1.0 for driven in closure.linkage.inputs]
    own = [1.0 if turning else closure.scale for turning in closure.turning]
    scaled = closure.jacobian(position) * units / np.array(own)[:, None]
    slopes = scaled[[closure.joint_names.index(name) for name in names]]
    for name, row in zip(names, slopes, strict=True):
        if not np.abs(row).max() > _STILL:
            raise DefinitionError(name, 'does not move with the inputs', 'name another joint')
    _, sizes, ways = np.linalg.svd(slopes / np.abs(slopes).max(axis=1, keepdims=True))
    if not sizes[-1] > DEPENDENT:
        free = closure.input_names[int(np.abs(ways[-1]).argmax())]
        raise DefinitionError(
            ', '.join(names), f'are not independent in the pose: {free} stays free',
            f'name a joint that moves with {free}, or draw another pose',
        )  # fmt: skip


def turn_to_pose(closure: Closure, values: Sequence[float]) -> tuple[float, ...]:
    """
    Return values of several inputs; angles beyond limits in the turn that is nearest to the pose.

    So are those without limits: links that close only together are followed from there, and not a
    turn away.
    """
    inputs, home = closure.linkage.inputs, closure.linkage.pose.inputs
    if len(inputs) == 1:
        return tuple(values)
    return tuple(
        value
        if driven.slider
        or (driven.limits.is_bounded and driven.limits.low <= value <= driven.limits.high)
        else value - tau * round((value - at) / tau)
        for value, driven, at in zip(values, inputs, home, strict=True)
    )


def _reached_limits(
    closure: Closure, names: Sequence[str], at: Sequence[float]
) -> dict[str, Limits]:
    """
    Return limits of joints that have none: what those of the linkage let them reach from a state.

    They are sought on a lattice, from neighbour to neighbour, and include the first states beyond;
    none are returned if the states are too many. They need not be exact, since the limits of the
    linkage hold too: between them the cells of links are made that close only together.
    """
    own = closure.linkage.limits
    rows = {
        name: closure.joint_names.index(name)
        for name in names
        if not own.get(name, NO_LIMITS).is_bounded
    }
    turns = [tau if closure.turning[row] else inf for row in rows.values()]
    steps = [
        _STEP * (closure.scale if driven.slider else 1.0) for driven in closure.linkage.inputs
    ]
    first = closure.position(*at).joints
    if not first:
        return {}
    # Each place of the lattice with the values of a neighbour, by which angles are in one turn.
    waiting = [((0,) * len(steps), [first[row] for row in rows.values()])]
    met, reached, longest = {waiting[0][0]}, [], [0.0] * len(rows)
    opens = False
    while waiting:
        place, near = waiting.pop()
        inputs = (x + k * step for x, k, step in zip(at, place, steps, strict=True))
        position = closure.position(*inputs)
        if not position.joints:
            opens = True
            continue
        found = [position.joints[row] for row in rows.values()]
        values = [
            value - turn * round((value - by) / turn) if turn < inf else value
            for value, by, turn in zip(found, near, turns, strict=True)
        ]
        reached.append(values)
        ways = zip(longest, values, near, strict=True)
        longest = [max(way, abs(value - by)) for way, value, by in ways]
        if position.status is Status.LIMITED:
            continue
        for k, way in product(range(len(steps)), (-1, 1)):
            beside = tuple(number + way * (i == k) for i, number in enumerate(place))
            if beside not in met:
                met.add(beside)
                waiting.append((beside, values))
        if len(met) > _MOST_MET:
            return {}
    # Where loops open, the last state before may be two steps of the lattice away.
    wider = [2.0 * way * opens for way in longest]
    return {
        name: replace(own.get(name, NO_LIMITS), low=min(values) - more, high=max(values) + more)
        for name, values, more in zip(rows, zip(*reached, strict=True), wider, strict=True)
    }


class PlaneExchange:
    """The definition of a planar linkage with other inputs; ``near`` is for the former ones."""

    def __init__(
        self,
        closure: PlanarClosure,
        names: Sequence[str],
        near: Near,
        rebuild: Callable[[Linkage], Any],
    ) -> None:
        self._closure, self._names, self._rebuild = closure, names, rebuild
        linkage = closure.linkage
        before = {driven.joint: driven for driven in linkage.inputs}
        joints = {name: _as_joint(driven, near[name]) for name, driven in before.items()}
        joints |= {name: joint for name, joint in linkage.joints.items() if name not in before}
        inputs = [before.get(name) or Input.from_joint(name, joints[name]) for name in names]
        # The inputs as joints, and the other joints.
        self._linkage = replace(
            linkage,
            inputs=tuple(inputs),
            joints={name: joint for name, joint in joints.items() if name not in names},
            assembly={},
            pose=None,
            ratios=turn_ratios(linkage.ratios, names),
            nominal=None,
        )
        self._hold_without_pins()
        check_linkage(self._linkage)

    def __call__(
        self, position: Position, known: Mapping[str, float], limits: Mapping[str, Limits]
    ) -> Any:
        """Return the closure in the assembly of a position; see `Plan`."""
        linkage, values = self._linkage, _values_at(self._closure, position, known)
        if not position.status.has_pose:
            raise DefinitionError('pose', 'the loops are open there', 'draw another pose')
        places, angles = self._closure.points(position), self._closure.link_angles(position)
        points: dict[str, tuple[float, float]] = {}
        for link, on_link in linkage.links.items():
            if link in self._carriers:
                parent, pin, block = self._carriers[link]
                arm = places[pin] - places[parent, next(iter(linkage.links[parent]))]
                way = rect(1.0, angles[parent])
                along = (arm * way.conjugate()).real * way
                place = places[parent, next(iter(linkage.links[parent]))] + along
                points[link] = (place.real, place.imag)
                angles[link] = angles[block] = angles[parent]
            for point in on_link:
                if (link, point) in places:
                    place = places[link, point]
                    points[point] = (place.real, place.imag)
        drawn = AssemblyPose(
            tuple(_turn_within(values[driven.joint], driven) for driven in linkage.inputs),
            points,
            {link: angle for link, angle in angles.items() if link in linkage.links},
        )
        inputs = tuple(
            replace(driven, limits=limits.get(driven.joint, driven.limits))
            for driven in linkage.inputs
        )
        return self._rebuild(replace(linkage, inputs=inputs, pose=drawn))

    def _hold_without_pins(self) -> None:
        """
        Give inputs that turn two links without a common pin such a pin.

        A carrier slides along the parent, and a block across on the carrier: it takes a pin of the
        child, and the angle of the parent.
        """
        linkage = self._linkage
        self._carriers: dict[str, tuple[str, tuple[str, str], str]] = {}
        inputs, links, sliders = [], dict(linkage.links), dict(linkage.sliders)
        for driven in linkage.inputs:
            parent, child = (linkage.links.get(end, {}) for end in (driven.parent, driven.child))
            held = driven
            if not driven.slider and not {*parent} & {*child}:
                carrier, block = f'carrier of {driven.joint}', f'block of {driven.joint}'
                pin, through = next(iter(child)), next(iter(parent))
                links[carrier], links[block] = {carrier: (0.0, 0.0)}, {pin: (0.0, 0.0)}
                along = Slider(carrier, driven.parent, through, (1.0, 0.0), carrier)
                sliders[carrier] = along
                sliders[block] = Slider(pin, carrier, carrier, (0.0, 1.0), block)
                self._carriers[carrier] = driven.parent, (driven.child, pin), block
                held = replace(driven, parent=block)
            inputs.append(held)
        self._linkage = replace(linkage, inputs=tuple(inputs), links=links, sliders=sliders)


def _as_joint(driven: Input, near: tuple[float, ...]) -> RevoluteJoint | SlideJoint:
    """Return a former input as a joint, whose angle comes round to limits on one side."""
    joint = driven.as_joint()
    if isinstance(joint, SlideJoint):
        return joint
    if inf in (-joint.limits.low, joint.limits.high):
        joint = replace(joint, limits=replace(joint.limits, low=-inf, high=inf))
    return replace(joint, near=near)


def _turn_within(value: float, driven: Input) -> float:
    """Return the value of a new input, with the whole turns that its limits allow."""
    low, high = driven.limits.low, driven.limits.high
    if inf in (-low, high):
        return value
    if not driven.slider:
        value -= tau * round((value - 0.5 * (low + high)) / tau)
    return min(max(value, low), high)
