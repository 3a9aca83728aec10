# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Checks of what planar and spatial linkages both have; each refuses what cannot work."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable
from math import inf, isfinite, isnan
from typing import Any

from linkage_ros.errors import DefinitionError, did_you_mean, list_names, quote
from linkage_ros.kinematics.plane.linkage import GROUND, Limits, RevoluteJoint


def check_name(key: str, name: str, what: str, names: Iterable[str]) -> None:
    """Refuse a name that is not among others, and suggest one."""
    known = sorted(names)
    if name not in known:
        choices = f'name one of {list_names(known)}' if known else 'this linkage has none'
        reason = f'there is no {what} {quote(name)}'
        raise DefinitionError(key, reason, did_you_mean(name, known, choices))


def check_named_once(key: str, names: Iterable[str]) -> None:
    """Refuse a name that is there twice."""
    for name, count in Counter(names).items():
        if count > 1:
            raise DefinitionError(key, f'{quote(name)} is named twice', 'name it once')


def check_inputs(linkage: Any) -> None:
    """Refuse a linkage without inputs, and an input that is named twice."""
    if not linkage.inputs:
        raise DefinitionError('input', 'no joint is driven', 'name the driven joint')
    check_named_once('input', (driven.joint for driven in linkage.inputs))


def check_traced(linkage: Any, points: Iterable[str]) -> None:
    """Refuse a traced point that is none."""
    for point in linkage.traced:
        check_name('traced', point, 'point', points)


def check_weighed(links: Collection[str], weighed: Iterable[str]) -> None:
    """Refuse the mass of what is not a moving link."""
    for link in weighed:
        if link == GROUND:
            reason = 'the ground does not move'
            raise DefinitionError(f'masses.{link}', reason, 'leave its mass out')
        check_name(f'masses.{link}', link, 'link', {*links} - {GROUND})


def check_ratios(
    linkage: Any, followers: Collection[str], what: str, leaders: Collection[str]
) -> None:
    """
    Refuse a joint that cannot follow others.

    ``followers`` are the joints that may follow others, ``what`` says which these are, and
    ``leaders`` are those that may be followed.
    """
    inputs = {driven.joint for driven in linkage.inputs}
    for name, ratio in linkage.ratios.items():
        key = f'ratios.{name}'
        if name in inputs:
            reason = f'{quote(name)} is an input, which follows no joint'
            raise DefinitionError(key, reason, 'leave one of the two out')
        check_name(key, name, what, {*followers} - inputs)
        for of in ratio.terms:
            end = 'of' if of == ratio.of else 'also'
            check_name(f'{key}.{end}', of, 'joint', leaders)
        if circle := _find_circle(linkage, [name]):
            reason, remedy = ' follows '.join(circle), 'let one of them follow an input'
            raise DefinitionError(f'{key}.of', reason, remedy)
        factors = [*ratio.terms.values()]
        if not all(factors) or not all(map(isfinite, (*factors, ratio.offset))):
            raise DefinitionError(
                f'{key}.ratio',
                f'{", ".join(f"{factor:g}" for factor in factors)}, offset {ratio.offset:g}',
                'write a ratio other than 0, and finite numbers',
            )


def _find_circle(linkage: Any, chain: list[str]) -> list[str]:
    """Return joints that follow each other in a circle, from a chain of followers on; or none."""
    ratio = linkage.ratios.get(chain[-1])
    for name in ratio.terms if ratio else ():
        if name in chain:
            return [*chain, name]
        if circle := _find_circle(linkage, [*chain, name]):
            return circle
    return []


def check_all_limits(linkage: Any) -> None:
    """Refuse limits that allow no motion, and a pose beyond those of its inputs."""
    for driven in linkage.inputs:
        _check_limits('input', driven.limits, driven.joint, driven.unit)
    for name, joint in linkage.joints.items():
        _check_limits(f'joints.{name}', joint.limits, name, joint.unit)
        ends = (joint.limits.low, joint.limits.high)
        if isinstance(joint, RevoluteJoint) and ends != (-inf, inf) and inf in map(abs, ends):
            raise DefinitionError(
                f'joints.{name}.limits',
                f'{joint.limits} rad limits the angle on one side, and angles come round to it',
                'write two finite numbers',
            )
    if linkage.pose:
        for driven, value in zip(linkage.inputs, linkage.pose.inputs, strict=False):
            if not driven.limits.low <= value <= driven.limits.high:
                raise DefinitionError(
                    'pose.inputs',
                    f'{value:g} {driven.unit} is beyond the limits {driven.limits} '
                    f'{driven.unit} of {quote(driven.joint)}',
                    'start within the limits, or widen them',
                )


def _check_limits(key: str, limits: Limits, name: str, unit: str) -> None:
    """Refuse limits that allow no motion."""
    low, high = limits.low, limits.high
    if isnan(low) or isnan(high) or low == inf or high == -inf:
        raise DefinitionError(
            f'{key}.limits',
            f'{limits} {unit} of {quote(name)} are not valid limits',
            'write [low, high]; -.inf or .inf for none on a side',
        )
    if low >= high:
        fault = 'are the same number' if low == high else 'cross'
        raise DefinitionError(
            f'{key}.limits',
            f'{limits} {unit} of {quote(name)} {fault}',
            'write [low, high], the lower one first',
        )
    for what in ('velocity', 'effort'):
        if not (value := getattr(limits, what)) > 0.0:
            raise DefinitionError(
                f'{key}.{what}',
                f'{value:g} of {quote(name)} allows no motion',
                'write a number of more than 0, or leave it out',
            )
