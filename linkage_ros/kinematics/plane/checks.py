# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Checks of a linkage before it is solved: each refuses a definition that cannot work."""

from __future__ import annotations

from collections import Counter
from itertools import combinations
from math import hypot, isfinite

from linkage_ros.errors import DefinitionError, list_names, quote
from linkage_ros.kinematics.checks import (
    check_all_limits,
    check_inputs,
    check_name,
    check_ratios,
    check_traced,
    check_weighed,
)
from linkage_ros.kinematics.plane.linkage import (
    GROUND,
    Input,
    Linkage,
    RevoluteJoint,
    SlideJoint,
    Slider,
)

_SHORTEST = 2.0**-511
"""Least distance of two pins, in [m]: the square of a shorter one would underflow."""

_LEAST_RATIO = 1e-30
"""Least distance of two pins relative to the linkage; in a shorter one no digit would be left."""


def check_linkage(linkage: Linkage) -> None:
    """Refuse a linkage whose parts do not match; the error names the key of the part."""
    if GROUND not in linkage.links:
        raise DefinitionError(
            'links', f'no link is named {GROUND!r}', f'name the frame {GROUND!r}'
        )
    for name, slider in linkage.sliders.items():
        _check_slider(linkage, name, slider)
    _check_points(linkage)
    check_inputs(linkage)
    for driven in linkage.inputs:
        _check_input(linkage, driven)
    for name, joint in linkage.joints.items():
        if isinstance(joint, RevoluteJoint):
            for end in ('parent', 'child'):
                check_name(f'joints.{name}.{end}', getattr(joint, end), 'link', linkage.links)
        else:
            check_name(f'joints.{name}.slider', joint.slider, 'slider', linkage.sliders)
    joints = [driven.joint for driven in linkage.inputs]
    check_ratios(linkage, linkage.joints, 'published joint', {*joints, *linkage.joints})
    for name in linkage.ratios:
        _check_follower(linkage, name)
    check_all_limits(linkage)
    check_weighed(linkage.links, linkage.masses)
    points = {point for carried in linkage.links.values() for point in carried}
    check_traced(linkage, points)
    for point in linkage.pose.points if linkage.pose else ():
        check_name('pose.points', point, 'point', points)
    for link in linkage.pose.angles if linkage.pose else ():
        check_name('pose.angles', link, 'link', linkage.links)
    if linkage.pose and len(linkage.pose.inputs) != len(linkage.inputs):
        raise DefinitionError(
            'pose.inputs',
            f'{len(linkage.pose.inputs)} value(s) for {len(linkage.inputs)} input(s)',
            'give one for each input',
        )


def _check_points(linkage: Linkage) -> None:
    # A slider joins links without a shared point, so such a link may have a single point.
    sliding = {name for s in linkage.sliders.values() for name in (s.block, s.along)}
    if linkage.ratios:
        # A gear may have its pin alone.
        geared = (*linkage.inputs, *(linkage.joints.get(name) for name in linkage.ratios))
        sliding |= {getattr(joint, end, '') for joint in geared for end in ('parent', 'child')}
    for name, points in linkage.links.items():
        # A single pivot is enough for the ground: its frame does not turn.
        if len(points) < 2 and not (points and (name in sliding or name == GROUND)):
            raise DefinitionError(
                f'links.{name}', f'{len(points)} point(s)', 'a link needs two points or more'
            )
        for point, place in points.items():
            if not all(map(isfinite, place)):
                raise DefinitionError(
                    f'links.{name}.{point}', f'{place} is not a point', 'write two finite numbers'
                )
    for (first, one_points), (second, other_points) in combinations(linkage.links.items(), 2):
        shared = sorted(set(one_points) & set(other_points))
        if len(shared) > 1:
            raise DefinitionError(
                f'links.{second}',
                f'shares the points {list_names(shared)} with {first!r}',
                'two links have one pin between them; rename the points that are not pins',
            )
    ends = [point for points in linkage.links.values() for point in points]
    ends += [slider.point for slider in linkage.sliders.values()]
    joined = {point for point, count in Counter(ends).items() if count > 1}
    sizes = (hypot(*place) for points in linkage.links.values() for place in points.values())
    nearest = max(_SHORTEST, _LEAST_RATIO * max(sizes, default=0.0))
    for name, points in linkage.links.items():
        pins = [point for point in points if point in joined]
        for first, second in combinations(pins, 2):
            distance = hypot(*(p - q for p, q in zip(points[first], points[second], strict=True)))
            if not distance:
                fault, places = f'lies on {first!r}', 'different places'
            elif distance < nearest:
                fault = f'{second!r} lies {distance:.3g} m from {first!r}'
                places = f'places that are at least {nearest:.3g} m apart'
            else:
                continue
            key = f'links.{name}.{second}'
            raise DefinitionError(key, fault, f'give the two points {places}')


def _check_slider(linkage: Linkage, name: str, slider: Slider) -> None:
    key = f'sliders.{name}'
    check_name(f'{key}.along', slider.along, 'link', linkage.links)
    points = linkage.links[slider.along]
    check_name(f'{key}.through', slider.through, f'point of {slider.along!r} called', points)
    carriers = [link for link, carried in linkage.links.items() if slider.point in carried]
    if not carriers or slider.along in carriers:
        raise DefinitionError(
            f'{key}.point',
            f'{quote(slider.point)} is named on {list_names(carriers) or "no link"}',
            f'name a point of a link other than {slider.along!r}',
        )
    if slider.block and slider.block not in carriers:
        raise DefinitionError(
            f'{key}.block',
            f'{quote(slider.block)} does not carry {slider.point!r}',
            _one_of(carriers),
        )
    if hypot(*slider.direction) < _SHORTEST or not all(map(isfinite, slider.direction)):
        raise DefinitionError(
            f'{key}.direction',
            f'[{slider.direction[0]:g}, {slider.direction[1]:g}] has no direction',
            'write for example [1, 0]',
        )


def _check_input(linkage: Linkage, driven: Input) -> None:
    if driven.slider:
        check_name('input.slider', driven.slider, 'slider', linkage.sliders)
        return
    for end in ('parent', 'child'):
        check_name(f'input.{end}', getattr(driven, end), 'link', linkage.links)
    if driven.parent == driven.child:
        raise DefinitionError(
            'input.child', f'{quote(driven.child)} is its own parent', 'name two links'
        )
    if not set(linkage.links[driven.parent]) & set(linkage.links[driven.child]):
        raise DefinitionError(
            f'links.{driven.child}',
            f'no point is named both on {driven.parent!r} and on {driven.child!r}',
            f'name the pin about which {driven.joint!r} turns on both',
        )


def _check_follower(linkage: Linkage, name: str) -> None:
    """Refuse a joint that cannot follow others since it turns about no pin, or is locked."""
    key, joint = f'ratios.{name}', linkage.joints[name]
    if isinstance(joint, RevoluteJoint):
        first, second = linkage.links[joint.parent], linkage.links[joint.child]
        if joint.parent == joint.child or not set(first) & set(second):
            raise DefinitionError(
                key,
                f'{quote(joint.parent)} and {quote(joint.child)} have no common pin about '
                'which it could turn',
                'name a joint of two links that share a pin, or of a slider',
            )
    followed = name
    while followed in linkage.ratios:
        followed = linkage.ratios[followed].of
        if _moved_parts(linkage, followed) == _moved_parts(linkage, name):
            raise DefinitionError(
                f'{key}.of',
                f'{quote(followed)} moves the same links as {quote(name)}, and a ratio locks them',
                'name a joint of other links',
            )


def _moved_parts(linkage: Linkage, name: str) -> set[str]:
    """Return the two links that a joint turns, or the slider that it moves."""
    joint = linkage.named_joints[name]
    return {joint.slider} if isinstance(joint, SlideJoint) else {joint.parent, joint.child}


def _one_of(names: object) -> str:
    return f'name one of {list_names(sorted(names))}'  # type: ignore[call-overload]
