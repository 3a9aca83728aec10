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


"""
From links, pins and sliders to the dyad that closes them.

This version closes one loop: crank, ground, and one dyad between them, RRR or RPR.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations
from math import atan2, frexp, hypot, ldexp
from typing import NamedTuple

from linkage_ros.errors import DefinitionError, quoted
from linkage_ros.kinematics.dyads.rpr import RPRDyad
from linkage_ros.kinematics.dyads.rrr import RRRDyad
from linkage_ros.kinematics.linkage import GROUND, Linkage, Point, Slider

_CLOSABLE = (
    'this version closes a four-bar (two links pinned together between crank and ground) or an '
    'inverted slider-crank (a rod pinned to the crank that slides through a point of the ground)'
)


class Term(NamedTuple):
    """
    A link's angle, or a slide, as a sum over the crank's angle and the dyad's two coordinates.

    value = crank·θ + first·x1 + second·x2 + constant
    """

    crank: float
    first: float
    second: float
    constant: float


@dataclass(frozen=True, slots=True)
class Loop:
    """
    One loop, ready to be solved.

    Attributes
    ----------
    dyad
        The dyad, in lengths of ``scale`` metres.
    scale
        Metres in the dyad's unit of length: a power of two, so that scaling rounds nothing.
    crank_offset
        φ − θ: direction of the crank in the frame of the loop less the crank's angle, in [rad].
    angles
        For each link its angle, in [rad].
    slides
        For each slider the position of its point from ``through``, in [m].

    """

    dyad: RRRDyad | RPRDyad
    scale: float
    crank_offset: float
    angles: Mapping[str, Term]
    slides: Mapping[str, Term]


def find_loop(linkage: Linkage) -> Loop:
    """
    Find the dyad that closes a linkage.

    Raises
    ------
    DefinitionError
        Where the links do not make one loop of the kinds above.

    """
    _check_links(linkage)
    crank = linkage.input.child
    pins = _pins(linkage)
    pivot = _pin_between(
        pins, GROUND, crank, 'links', 'the crank turns about a point of the ground'
    )
    others = [name for name in linkage.links if name not in (GROUND, crank)]
    if len(others) == 2 and not linkage.sliders:
        return _four_bar(linkage, pins, pivot, others)
    if len(others) == 1 and len(linkage.sliders) == 1:
        return _inverted_slider_crank(linkage, pins, pivot, others[0])
    raise DefinitionError(
        'links',
        f'{len(linkage.links)} links and {len(linkage.sliders)} sliders do not make one loop',
        _CLOSABLE,
    )


def _four_bar(
    linkage: Linkage, pins: Mapping[frozenset[str], str], pivot: str, others: list[str]
) -> Loop:
    links = linkage.links
    coupler, rocker = others
    if frozenset((linkage.input.child, coupler)) not in pins:
        coupler, rocker = rocker, coupler
    a_pin = _pin_between(pins, linkage.input.child, coupler, f'links.{coupler}', _CLOSABLE)
    d_pin = _pin_between(pins, GROUND, rocker, f'links.{rocker}', _CLOSABLE)
    b_pin = _pin_between(pins, coupler, rocker, f'links.{rocker}', _CLOSABLE)
    sign = _sign(linkage, b_pin, {'left': 1, 'right': -1}, f'the side of {a_pin}→{d_pin}')

    a, crank_zero = _polar(links, linkage.input.child, pivot, a_pin)
    d, base = _polar(links, GROUND, pivot, d_pin)
    b, coupler_zero = _polar(links, coupler, a_pin, b_pin)
    c, rocker_zero = _polar(links, rocker, d_pin, b_pin)
    scale = _scale(a, b, c, d)
    return Loop(
        RRRDyad(a / scale, b / scale, c / scale, d / scale, sign),
        scale,
        crank_zero - base,
        {
            GROUND: Term(0.0, 0.0, 0.0, 0.0),
            linkage.input.child: Term(1.0, 0.0, 0.0, 0.0),
            coupler: Term(0.0, 1.0, 0.0, base - coupler_zero),
            rocker: Term(0.0, 0.0, 1.0, base - rocker_zero),
        },
        {},
    )


def _inverted_slider_crank(
    linkage: Linkage, pins: Mapping[frozenset[str], str], pivot: str, rod: str
) -> Loop:
    links = linkage.links
    ((name, slider),) = linkage.sliders.items()
    if slider.along != rod or slider.point not in links[GROUND]:
        raise DefinitionError(
            f'sliders.{name}',
            f'the point {slider.point!r} slides along {slider.along!r}',
            _CLOSABLE,
        )
    a_pin = _pin_between(pins, linkage.input.child, rod, f'links.{rod}', _CLOSABLE)
    sign = _sign(
        linkage, name, {'ahead': 1, 'behind': -1}, f'where {slider.point} lies from {a_pin}'
    )

    a, crank_zero = _polar(links, linkage.input.child, pivot, a_pin)
    d, base = _polar(links, GROUND, pivot, slider.point)
    along, offset = _line_from(links[rod], a_pin, slider)
    scale = _scale(a, d, offset)
    return Loop(
        RPRDyad(a / scale, d / scale, offset / scale, sign),
        scale,
        crank_zero - base,
        {
            GROUND: Term(0.0, 0.0, 0.0, 0.0),
            linkage.input.child: Term(1.0, 0.0, 0.0, 0.0),
            rod: Term(0.0, 1.0, 0.0, base - atan2(slider.direction[1], slider.direction[0])),
        },
        {name: Term(0.0, 0.0, scale, -along)},
    )


def _check_links(linkage: Linkage) -> None:
    """Refuse what no loop can be made of, whatever its kind."""
    if GROUND not in linkage.links:
        raise DefinitionError(
            'links', f'no link is named {GROUND!r}', f'name the frame {GROUND!r}'
        )
    if linkage.input.parent != GROUND:
        raise DefinitionError(
            'input.parent',
            f'{quoted(linkage.input.parent)} is not the ground',
            f'this version drives a crank on the ground: write parent: {GROUND}',
        )
    if linkage.input.child not in linkage.links or linkage.input.child == GROUND:
        raise DefinitionError(
            'input.child',
            f'{quoted(linkage.input.child)} is not a link that moves',
            f'name one of {", ".join(sorted(set(linkage.links) - {GROUND}))}',
        )
    for name, points in linkage.links.items():
        if len(points) < 2:
            raise DefinitionError(
                f'links.{name}', f'{len(points)} point(s)', 'a link needs two points or more'
            )
    for name, slider in linkage.sliders.items():
        if slider.along not in linkage.links:
            raise DefinitionError(
                f'sliders.{name}.along',
                f'{quoted(slider.along)} is not a link',
                f'name one of {", ".join(sorted(linkage.links))}',
            )
        if slider.through not in linkage.links[slider.along]:
            raise DefinitionError(
                f'sliders.{name}.through',
                f'{quoted(slider.through)} is not a point of {slider.along!r}',
                f'name one of {", ".join(sorted(linkage.links[slider.along]))}',
            )
        carriers = [link for link, points in linkage.links.items() if slider.point in points]
        if len(carriers) != 1 or carriers[0] == slider.along:
            raise DefinitionError(
                f'sliders.{name}.point',
                f'{quoted(slider.point)} is named on {", ".join(carriers) or "no link"}',
                f'name a point of one link other than {slider.along!r}',
            )
        if slider.direction == (0.0, 0.0):
            raise DefinitionError(
                f'sliders.{name}.direction', '[0, 0] points nowhere', 'write for example [1, 0]'
            )


def _pins(linkage: Linkage) -> dict[frozenset[str], str]:
    """Return the name of the pin between each two links that share one."""
    pins: dict[frozenset[str], str] = {}
    for (one, one_points), (other, other_points) in combinations(linkage.links.items(), 2):
        shared = sorted(set(one_points) & set(other_points))
        if len(shared) > 1:
            raise DefinitionError(
                f'links.{other}',
                f'shares the points {", ".join(shared)} with {one!r}',
                'two links have one pin between them; rename the points that are not pins',
            )
        if shared:
            pins[frozenset((one, other))] = shared[0]
    return pins


def _pin_between(
    pins: Mapping[frozenset[str], str], one: str, other: str, key: str, remedy: str
) -> str:
    try:
        return pins[frozenset((one, other))]
    except KeyError:
        raise DefinitionError(
            key, f'no point is named both on {one!r} and on {other!r}', remedy
        ) from None


def _sign(linkage: Linkage, closing: str, sides: Mapping[str, int], meaning: str) -> int:
    """Return the sign of the assembly of the pin or slider that closes the dyad."""
    for name in linkage.assembly:
        if name != closing:
            raise DefinitionError(
                f'assembly.{name}',
                f'{quoted(name)} does not close a dyad',
                f'name {closing!r}',
            )
    choices = ' or '.join(sides)
    if closing not in linkage.assembly:
        raise DefinitionError(
            'assembly', f'{closing!r} is missing', f'write {closing}: {choices} ({meaning})'
        )
    side = linkage.assembly[closing]
    if side not in sides:
        raise DefinitionError(
            f'assembly.{closing}', f'{quoted(side)} is no side', f'write {choices} ({meaning})'
        )
    return sides[side]


def _polar(
    links: Mapping[str, Mapping[str, Point]], link: str, start: str, end: str
) -> tuple[float, float]:
    """Return length and direction from one point of a link to another."""
    points = links[link]
    x = points[end][0] - points[start][0]
    y = points[end][1] - points[start][1]
    length = hypot(x, y)
    if length == 0.0:
        raise DefinitionError(
            f'links.{link}.{end}', f'lies on {start!r}', 'give the two points different places'
        )
    return length, atan2(y, x)


def _line_from(points: Mapping[str, Point], pin: str, slider: Slider) -> tuple[float, float]:
    """Return where a slider's ``through`` lies from a pin: along its line, and to its left."""
    x = points[slider.through][0] - points[pin][0]
    y = points[slider.through][1] - points[pin][1]
    length = hypot(*slider.direction)
    ux, uy = slider.direction[0] / length, slider.direction[1] / length
    return x * ux + y * uy, y * ux - x * uy


def _scale(*lengths: float) -> float:
    """Return the power of two next to the longest length."""
    return ldexp(1.0, frexp(max(map(abs, lengths)))[1])
