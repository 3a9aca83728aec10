# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Linkages of one loop with an exact change point, drawn at random, in every arrangement.

Lengths are multiples of 1/8, so that their sums, and the change point, are exact. At 0 the crank
lies on the ground line. The crank may carry the dyad's first or its second outer joint, and the
input may be the angle of the crank to the ground or of the ground to the crank.
"""

from collections.abc import Callable
from math import pi
import random
from typing import NamedTuple

from linkage_ros.kinematics import Input, Linkage, Point, RevoluteJoint, Side, SlideJoint, Slider

Points = dict[tuple[str, str], complex]
Sided = Callable[[Points], float]
"""Returns, of the places of all points, what is positive on the side of 'left' and of 'ahead'."""


class Flat(NamedTuple):
    """A linkage, and what is known of it without solving it; crank angles in [rad]."""

    linkage: Linkage
    sign: int
    at: tuple[float, ...]
    meets: tuple[float, ...]
    holds: tuple[float, float]
    side: Sided


def _number(rng: random.Random, most: int = 40) -> float:
    return rng.randrange(4, most) / 8


def _cross(one: complex, other: complex) -> float:
    return (one.conjugate() * other).imag


def _linkage(
    rng: random.Random,
    links: dict[str, dict[str, Point]],
    assembly: dict[str, Side],
    sliders: dict[str, Slider],
    turning: str,
) -> tuple[Linkage, int]:
    backwards = rng.random() < 0.5
    ends = ('crank', 'ground') if backwards else ('ground', 'crank')
    joints: dict[str, RevoluteJoint | SlideJoint] = {turning: RevoluteJoint('ground', turning)}
    joints |= {f'{name}_slide': SlideJoint(name) for name in sliders}
    linkage = Linkage(links, (Input('crank_joint', *ends),), assembly, joints, sliders)
    return linkage, -1 if backwards else 1


def four_bar(rng: random.Random) -> Flat:
    """Return a four-bar that folds flat at 0, at π or at both."""
    kind = rng.choice(('fold', 'stretch', 'parallelogram', 'kite'))
    a, b, d = _number(rng), _number(rng), _number(rng)
    if kind == 'fold':
        c = b + rng.choice((1, -1)) * (a - d)
    elif kind == 'stretch':
        c = a + d - b
    elif kind == 'kite':
        b, c = a, d
    else:
        b, c = d, a
    if c <= 0.0 or a == d or (kind in ('fold', 'stretch') and {b, c} & {a, d}):
        return four_bar(rng)
    side = rng.choice(('left', 'right'))
    links = {
        'ground': {'O': (0.0, 0.0), 'D': (d, 0.0)},
        'crank': {'O': (0.0, 0.0), 'A': (a, 0.0)},
        'coupler': {'A': (0.0, 0.0), 'B': (b, 0.0)},
        'rocker': {'D': (0.0, 0.0), 'B': (c, 0.0)},
    }
    linkage, sign = _linkage(rng, links, {'B': side}, {}, 'rocker')

    def left(points: Points) -> float:
        pin, pivot = points['crank', 'A'], points['ground', 'D']
        return _cross(pivot - pin, points['coupler', 'B'] - pin)

    at = {'fold': (0.0,), 'stretch': (pi,)}.get(kind, (0.0, pi))
    return Flat(linkage, sign, at, (), (0.0, pi), left)


def swivel(rng: random.Random) -> Flat:
    """Return a rail that passes a swivel, pinned to the crank or to the ground."""
    on_crank, bent = rng.random() < 0.5, rng.random() < 0.7
    a, d = _number(rng), _number(rng)
    offset = rng.choice((1, -1)) * abs(d - a) if bent else 0.0
    if not bent:
        d = a
    elif not offset:
        return swivel(rng)
    side = rng.choice(('ahead', 'behind'))
    pin, swivelled = ('A', 'D') if on_crank else ('D', 'A')
    links = {
        'ground': {'O': (0.0, 0.0), 'D': (d, 0.0)},
        'crank': {'O': (0.0, 0.0), 'A': (a, 0.0)},
        'rail': {pin: (0.0, 0.0), 'Q': (0.0, offset), 'T': (1.0, 0.0)},
    }
    slider = Slider(swivelled, 'rail', 'Q' if offset else pin, (1.0, 0.0))
    linkage, sign = _linkage(rng, links, {'slide': side}, {'slide': slider}, 'rail')

    def ahead(points: Points) -> float:
        start, end = points['crank', 'A'], points['ground', 'D']
        if not on_crank:
            start, end = end, start
        unit = points['rail', 'T'] - points['rail', pin]
        return ((end - start) * unit.conjugate()).real

    at, meets = ((0.0,), ()) if bent else ((), (0.0,))
    return Flat(linkage, sign, at, meets, (0.0, 2.0 * pi), ahead)


def slider_crank(rng: random.Random) -> Flat:
    """Return a slider-crank whose rod stands across its line with the crank."""
    a, e = _number(rng), _number(rng, 20) if rng.random() < 0.6 else 0.0
    above = rng.random() < 0.5
    # The line lies at −e from the crank's pivot: b − e − a = 0, or b + e − a = 0.
    b = a + e if not above else a - e
    if b <= 0.0 or (e and b == a):
        return slider_crank(rng)
    side = rng.choice(('ahead', 'behind'))
    links = {
        'ground': {'O': (0.0, 0.0), 'Q': (0.0, -e)},
        'crank': {'O': (0.0, 0.0), 'A': (a, 0.0)},
        'rod': {'A': (0.0, 0.0), 'B': (b, 0.0)},
    }
    if not e:
        links['ground'] = {'O': (0.0, 0.0)}
    slider = Slider('B', 'ground', 'Q' if e else 'O', (1.0, 0.0))
    linkage, sign = _linkage(rng, links, {'slide': side}, {'slide': slider}, 'rod')

    def ahead(points: Points) -> float:
        return (points['rod', 'B'] - points['crank', 'A']).real

    at = (0.5 * pi, 1.5 * pi) if not e else (1.5 * pi,) if above else (0.5 * pi,)
    return Flat(linkage, sign, at, (), (-0.5 * pi, 0.5 * pi), ahead)


FLAT = {'RRR': four_bar, 'RPR': swivel, 'RRP': slider_crank}
"""By the kind of the dyad."""
