# Copyright 2026 The linkage_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.


"""What the numbers of closing the loops say, in words that are worked out of them."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.util import find_spec

from linkage_ros.accuracy.solving.measured import BATCH, Measured
from linkage_ros.accuracy.solving.methods import closed_form, extended, newton, table, textbook
from linkage_ros.accuracy.solving.methods.method import ACCELERATION, RATE
from linkage_ros.accuracy.solving.poses import Poses, unit_of

WANTED = (1e-3, 1e-6, 1e-9, 1e-12)
"""Accuracies, in [rad]."""

_TROUBLE = ('toggle', 'change_point')

_IN_A_SCENE = (*closed_form.NAMES, newton.FROM_KNOTS, table.NAMES['hermite'])
"""What ``solver`` of a scene can ask for."""


def text(found: Sequence[Measured], quick: bool) -> list[str]:
    """Return how it was measured, and what came out, in paragraphs."""
    sets = {one.poses.key: one.poses for one in found}
    easy = sets['easy']
    how = (
        f'{len(easy.inputs)} easy poses of {easy.name} were solved by each method, one call a '
        f'state in a loop, and {BATCH:,} in arrays. {_guests(sets)} A time is processor time of '
        'a state: the median over blocks with its quartiles, of all methods in turn, there and '
        'back, in one run. What starts from its last state has for it the neighbouring pose.'
    )
    errors = (
        'Errors were worked out apart from the times, at the same states: those of the worst '
        f'published joint, against fifty digits{_confirmed()}. A slide counts as a part of the '
        'greatest length of a link. Rates and accelerations are those at '
        f'{RATE:g} rad/s and {ACCELERATION:g} rad/s² of the input; their errors are relative '
        f'where they exceed 1. Rates that are integrated have one error, that after {_way(sets)}. '
        'An answer that is more than 0.1 rad off, or none, counts as failed and is in no error; '
        'next to a change point also one that is off by a tenth of the distance from it, since '
        'there the other assembly is as near.'
    )
    said = [how, errors]
    if quick:
        said.append('This is the quick run: fewer settings, poses and rounds.')
    said.append(_outcome(found, easy))
    said += [_near(found, sets[key]) for key in _TROUBLE]
    said.append(
        "Where Newton's method does not converge, next to toggles and change points, it takes the "
        'state of the closed form.'
    )
    said += filter(None, [_textbook(found), _iterated(found)])
    return said


def advice(found: Sequence[Measured]) -> list[str]:
    """Return for each wanted accuracy the cheapest way that a scene can have, a sentence each."""
    easy = [one for one in found if one.poses.key == 'easy' and one.times.get('position')]
    offered = [one for one in easy if one.method.name in _IN_A_SCENE]
    winners = [_cheapest(offered, wanted) for wanted in WANTED]
    node = next(one for one in offered if one.method.name in closed_form.NAMES)
    if all(one is node for one in winners):
        wins = (
            f'The {node.method.name} wins at every accuracy: {_micros(node):.2g} µs a state, '
            f'{node.position.worst or 0.0:.1g} rad off at worst. Nothing else that a scene can '
            'have is cheaper beyond the spread of the times, however little accuracy is wanted.'
        )
        return [wins]
    said = []
    for wanted, one in zip(WANTED, winners, strict=True):
        if one is None:
            said.append(f'For {wanted:g} rad: nothing that a scene can have.')
            continue
        words = (
            f'For {wanted:g} rad at easy poses: {_named(one)}, {_micros(one):.2g} µs a state, '
            f'{_compared(one, node)}'
        )
        refuge = _fails_in(found, one, wanted)
        if refuge:
            words += f'; but {refuge}'
        said.append(f'{words}.')
    said.append(
        f'The {node.method.name}, what a scene has that says nothing, takes '
        f'{_micros(node):.2g} µs a state, in which it also tells toggles and open loops from the '
        'rest, with the gap.'
    )
    return said


def _cheapest(found: Sequence[Measured], wanted: float) -> Measured | None:
    """
    Return what takes the least time of all that never fail and are as accurate as wanted.

    Of those that are within each other's spreads what the node does wins, else what holds least.
    """
    able = [one for one in found if _keeps(one, wanted)]
    if not able:
        return None
    best = min(able, key=lambda one: one.times['position'].middle)
    near = [one for one in able if one.times['position'].low <= best.times['position'].high]
    return min(
        near,
        key=lambda one: (
            one.method.name not in closed_form.NAMES,
            one.method.memory or 0,
            one.times['position'].middle,
        ),
    )


def _compared(one: Measured, node: Measured) -> str:
    if one is node:
        return 'and nothing is cheaper beyond the spread of the times'
    ratio = node.times['position'].middle / one.times['position'].middle
    return f'{ratio:.3g} times as fast as the {node.method.name}'


def _fails_in(found: Sequence[Measured], one: Measured, wanted: float) -> str:
    """Say where a method does not keep the accuracy, with its setting if that was measured."""
    bad = []
    for key in _TROUBLE:
        there = [other for other in found if other.poses.key == key]
        same = [other for other in there if other.method.name == one.method.name]
        same = [o for o in same if o.method.setting == one.method.setting] or same
        if same and not any(_keeps(other, wanted) for other in same):
            poses = same[0].poses
            bad.append(poses.title if poses.own else f'{poses.title} of other linkages')
    return f'not {" or ".join(bad)}' if bad else ''


def _keeps(one: Measured, wanted: float) -> bool:
    worst = one.position.worst
    return not one.position.failed and worst is not None and worst <= wanted


def _outcome(found: Sequence[Measured], easy: Poses) -> str:
    some = [one for one in found if one.poses.key == easy.key and one.times.get('position')]
    node = next(one for one in some if one.method.name in closed_form.NAMES)
    base = node.times['position'].middle
    exact = [
        one
        for one in some
        if one is not node
        and one.method.name != extended.NAME
        and not one.position.failed
        and (one.position.worst or 0.0) <= 1e-12
    ]
    words = (
        f'At easy poses the {node.method.name} takes {_micros(node):.2g} µs a state and is '
        f'{node.position.worst or 0.0:.1g} rad off at worst.'
    )
    if exact:
        nearest = min(exact, key=lambda one: one.times['position'].middle)
        words += (
            f' Of the others that reach 1e-12 rad {_named(nearest)} is the cheapest, '
            f'{_times(nearest.times["position"].middle / base)}.'
        )
    more = [one for one in some if one.method.name == extended.NAME]
    if more:
        words += (
            f' Extended precision, {more[0].method.setting}, takes '
            f'{more[0].times["position"].middle / base:,.0f} times as long.'
        )
    return words


def _near(found: Sequence[Measured], poses: Poses) -> str:
    some = [one for one in found if one.poses.key == poses.key]
    node = next(one for one in some if one.method.name in closed_form.NAMES)
    failing = dict.fromkeys(one.method.name for one in some if one.position.failed)
    where = poses.title[0].upper() + poses.title[1:]
    words = (
        f'{where} ({poses.name}, {max(poses.distances):.2g} to {min(poses.distances):.2g} '
        f'{unit_of(poses)} from '
        f'it) the {node.method.name} is {node.position.worst or 0.0:.1g} rad off at worst'
    )
    if node.motion and node.motion[1].worst is not None:
        words += f', its rates {node.motion[1].worst:.1g} of themselves'
    words += '. '
    return words + (
        f'At some of these poses fail: {", ".join(failing)}.'
        if failing
        else 'No method fails there.'
    )


def _textbook(found: Sequence[Measured]) -> str:
    some = [one for one in found if one.method.name == textbook.NAME]
    if not some:
        return ''
    parts = ', '.join(f'{one.poses.title}: {one.position.failed:.0%}' for one in some)
    return (
        'The textbook form has one root for one assembly throughout, and divides by zero where '
        f"the crank's pin stands over the rocker's pivot; of the poses it fails at {parts}."
    )


def _iterated(found: Sequence[Measured]) -> str:
    some = [one for one in found if one.method.name == closed_form.ITERATED]
    if not some:
        return ''
    return (
        f'No dyad covers {some[0].poses.name}: what the node does there is to iterate, from the '
        'curve of its branch.'
    )


def _confirmed() -> str:
    if find_spec('flint') is None:
        return ''
    return ', which were confirmed at some states of each set by interval arithmetic'


def _way(sets: dict[str, Poses]) -> str:
    return sets['path'].title if 'path' in sets else 'a turn'


def _guests(sets: dict[str, Poses]) -> str:
    told = [
        f'{poses.title}: {poses.name}' for key, poses in sets.items()
        if not poses.own and key != 'path'
    ]  # fmt: skip
    return (
        f'Other linkages stand in for what it does not have ({"; ".join(told)}).' if told else ''
    )


def _named(one: Measured) -> str:
    return f'{one.method.name}{one.method.setting and ", "}{one.method.setting}'


def _times(ratio: float) -> str:
    return f'{ratio:.2g} times the time'


def _micros(one: Measured) -> float:
    return 1e6 * one.times['position'].middle
