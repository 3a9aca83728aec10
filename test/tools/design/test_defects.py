# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Defects that make a design useless, against a linkage that is moved by hand.

The table's verdicts are worked out from the lengths: where the crank stops is a triangle of three
known sides. The random ones are held against a simulator that knows nothing but two circles: it
moves the crank in small steps and keeps to the intersection that is nearest.
"""

from itertools import pairwise
from math import acos, asin, cos, degrees, pi, radians, sin, tau
import random
from typing import NamedTuple

from linkage_ros.tools.design import assess, Design, DesignRequest, FourBar
import numpy as np
import pytest

from .by_hand import cross, design, Lengths, on, pins, transmission
from .test_proof import THREE_PAIRS

L, R = 'left', 'right'
CRANK_ROCKER = (2.0, 7.0, 9.0, 6.0)
DOUBLE_CRANK = (5.0, 4.0, 6.0, 2.0)
# The coupler turns: |d − a| < c − b and a + d > b + c, so that the crank stops at
# cos φ = (4² + 5² − 4²)/40 and (4² + 5² − 6²)/40: from 51.32° to 82.82° on each side.
DOUBLE_ROCKER = (4.0, 1.0, 5.0, 5.0)
ROCKER_CRANK = (6.0, 7.0, 2.0, 9.0)
# Stops stretched only, at cos φ = (6² + 4.5² − 9²)/54: 117.25° on both sides of 0.
STRETCHES = (6.0, 4.0, 5.0, 4.5)
# Stops folded only, at cos φ = (4² + 6² − 5²)/48: from 55.77° through 180° to 304.23°.
FOLDS = (4.0, 8.0, 3.0, 6.0)
PARALLELOGRAM = (1.0, 2.0, 1.0, 2.0)
# 2 + 5 = 3 + 4: folds flat with the crank outwards of O4 only, at 0.
ONE_CHANGE_POINT = (2.0, 4.0, 5.0, 3.0)
# 3 + 4 = 6 + 1: folds flat at 180°, and stops folded at cos φ = (3² + 4² − 5²)/24: 90° to 270°.
CHANGE_POINT_ACROSS = (3.0, 6.0, 1.0, 4.0)
# 5 + 2 = 4 + 3: folds flat at 0, and stops stretched at cos φ = (5² + 3² − 6²)/30: 93.82°.
CHANGE_POINT_AHEAD = (5.0, 2.0, 4.0, 3.0)
# 3, 4, 5: stretched at 90°.
RIGHT_ANGLE = (3.0, 2.0, 3.0, 4.0)


class Case(NamedTuple):
    lengths: Lengths
    positions: list
    defects: list
    travel: tuple | None = None
    """In degrees."""


CASES = {
    'a crank-rocker as it should be': Case(CRANK_ROCKER, [(20, L), (90, L), (150, L)], [],
                                           (20, 150)),
    'the crank goes down': Case(CRANK_ROCKER, [(150, L), (90, L), (20, L)], [], (150, 20)),
    'the crank wraps at 360°': Case(CRANK_ROCKER, [(340, R), (350, R), (10, R)], [], (340, 370)),
    'the crank wraps at 180°': Case(DOUBLE_CRANK, [(170, L), (-170, L), (-120, L)], [],
                                    (170, 240)),
    'downwards through 0': Case(CRANK_ROCKER, [(15, L), (0, L), (-30, L)], [], (15, -30)),
    'turns in the angles asked for do not matter': Case(
        CRANK_ROCKER, [(20, L), (90 - 720, L), (150 + 360, L)], [], (20, 150)
    ),
    'two positions, the shorter way': Case(CRANK_ROCKER, [(20, L), (300, L)], [], (20, -60)),
    'one position': Case(CRANK_ROCKER, [(20, L)], [], (20, 20)),
    'the same crank angle twice': Case(CRANK_ROCKER, [(20, L), (20, L), (40, L)], [], (20, 40)),
    'the same crank angle twice but for rounding': Case(
        CRANK_ROCKER, [(20, L), (20 - 1e-12, L), (140, L), (260, L)], [], (20, 260)
    ),
    'once round, and back at the first': Case(CRANK_ROCKER, [(20, L), (140, L), (260, L), (20, L)],
                                              [], (20, 380)),
    'most of a turn': Case(CRANK_ROCKER, [(20, L), (10, L), (330, L), (50, L)], [], (20, -310)),
    'two assemblies of a crank that turns': Case(CRANK_ROCKER, [(20, L), (90, L), (150, R)],
                                                 ['circuit']),
    'two assemblies of a double crank': Case(DOUBLE_CRANK, [(20, R), (90, L)], ['circuit']),
    'out of order in a turn': Case(CRANK_ROCKER, [(20, L), (150, L), (90, L), (200, L)],
                                   ['order']),
    'out of order twice round': Case(CRANK_ROCKER, [(0, L), (150, L), (300, L), (90, L)],
                                     ['order']),
    'between two toggles': Case(DOUBLE_ROCKER, [(55, L), (60, L), (80, L)], [], (55, 80)),
    'between two toggles, on the other side': Case(DOUBLE_ROCKER, [(-55, L), (-60, L), (-80, L)],
                                                   [], (-55, -80)),
    'two branches between two toggles': Case(DOUBLE_ROCKER, [(55, L), (60, L), (80, R)],
                                             ['branch']),
    'two ranges, one assembly': Case(DOUBLE_ROCKER, [(60, L), (-60, L)], ['circuit']),
    'two ranges, two assemblies': Case(DOUBLE_ROCKER, [(60, L), (300, R)], ['circuit']),
    'no way round in a range': Case(DOUBLE_ROCKER, [(60, R), (80, R), (55, R)], ['order']),
    'branch and order': Case(DOUBLE_ROCKER, [(60, R), (80, L), (55, R)], ['branch', 'order']),
    'the same crank angle twice in a range': Case(DOUBLE_ROCKER, [(60, L), (60, L), (80, L)], [],
                                                  (60, 80)),
    'the same crank angle twice in a range, downwards': Case(
        DOUBLE_ROCKER, [(60, L), (420, L), (55, L)], [], (60, 55)
    ),
    'an output crank': Case(ROCKER_CRANK, [(40, L), (60, L)], [], (40, 60)),
    'a range about 0': Case(STRETCHES, [(300, L), (0, L), (100, L)], [], (300, 460)),
    'a range about 0 is not left backwards': Case(STRETCHES, [(110, L), (250, L)], [],
                                                  (110, -110)),
    'two branches of the only circuit': Case(STRETCHES, [(-30, L), (30, R)], ['branch']),
    'a range across 180°': Case(FOLDS, [(160, R), (180, R), (-160, R)], [], (160, 200)),
    'a range across 180° is not left at 0': Case(FOLDS, [(300, R), (60, R)], [], (300, 60)),
    'out of order across 180°': Case(FOLDS, [(190, L), (100, L), (200, L)], ['order']),
    'a parallelogram between its change points': Case(PARALLELOGRAM, [(30, L), (90, L), (150, L)],
                                                      [], (30, 150)),
    'a parallelogram and what it folds into': Case(PARALLELOGRAM, [(30, L), (90, R)], ['branch']),
    'a parallelogram through its change point': Case(
        # Beyond it the parallelogram is on the other side of A→O4.
        PARALLELOGRAM, [(150, L), (210, R)], ['transmission'], (150, 210)
    ),
    'an antiparallelogram comes out of a parallelogram': Case(PARALLELOGRAM, [(150, L), (210, L)],
                                                              ['branch']),
    'a single change point': Case(ONE_CHANGE_POINT, [(-40, L), (30, R)], ['transmission'],
                                  (-40, 30)),
    'a single change point, sent beyond a turn': Case(ONE_CHANGE_POINT, [(320, L), (390, R)],
                                                      ['transmission'], (320, 390)),
    'not through a single change point': Case(ONE_CHANGE_POINT, [(30, R), (180, R), (330, R)], [],
                                              (30, 330)),
    'through a change point between two toggles': Case(CHANGE_POINT_ACROSS, [(170, L), (190, R)],
                                                       ['transmission'], (170, 190)),
    'through a change point at 0 between two toggles': Case(
        CHANGE_POINT_AHEAD, [(-40, L), (30, R), (90, R)], ['transmission'], (-40, 90)
    ),
    'beside a change point between two toggles': Case(CHANGE_POINT_ACROSS,
                                                      [(100, L), (170, L), (120, L)], ['order']),
    'a position at a toggle': Case(RIGHT_ANGLE, [(40, L), (60, L), (90, L)], ['transmission'],
                                   (40, 90)),
    'a toggle, and two branches': Case(RIGHT_ANGLE, [(40, L), (90, R), (60, R)],
                                       ['branch', 'order']),
}  # fmt: skip


@pytest.mark.parametrize('name', CASES)
@pytest.mark.parametrize('frame', ['plain', 'odd'])
def test_assessment_names_the_defects_of_a_design(name, frame):
    lengths, positions, defects, travel = CASES[name]
    if frame == 'plain':
        made, zero = design(lengths, positions), 0.0
    else:
        made, zero = design(lengths, positions, zeros=(2.9, -1.3), ground=0.7), 0.7 - 2.9
    found = assess(made)
    assert [defect.name for defect in found.defects] == defects
    if travel is None:
        assert found.travel is None
    else:
        assert found.travel == pytest.approx([radians(angle) + zero for angle in travel])


def test_textbook_design_has_a_branch_defect():
    """sources/003: a crank of 5.6 and a rocker of 4.9 on a ground of 1, a coupler of 0.17."""
    found = assess(THREE_PAIRS)
    (defect,) = found.defects
    assert defect.name == 'branch'
    a, b, c, d = THREE_PAIRS.four_bar.lengths
    folds, stretches = (
        degrees(acos((a * a + d * d - s * s) / (2 * a * d))) for s in (c - b, b + c)
    )
    assert defect.text == (
        'positions 1 and 2 on the left assembly, position 3 on the right one; they meet only '
        f'where coupler and rocker are in line, at crank angles of {folds:.6g}° and '
        f'{stretches:.6g}°, and a crank does not lead from one to the other'
    )
    assert found.kind.code == 'GRCR'
    assert not found.turns
    assert found.full_transmission is None
    assert found.link_ratio == pytest.approx(a / b)


@pytest.mark.parametrize(
    ('lengths', 'code', 'turns'),
    [
        (CRANK_ROCKER, 'GCRR', True),
        (DOUBLE_ROCKER, 'GRCR', False),
        (ROCKER_CRANK, 'GRRC', False),
        (DOUBLE_CRANK, 'GCCC', True),
        ((4.0, 5.0, 6.0, 8.0), 'RRR1', False),
        ((8.0, 5.0, 6.0, 4.0), 'RRR2', False),
        ((5.0, 8.0, 6.0, 4.0), 'RRR3', False),
        ((5.0, 6.0, 8.0, 4.0), 'RRR4', False),
        (PARALLELOGRAM, 'S2X', True),
        ((2.0, 5.0, 4.0, 3.0), 'SCRR', True),
        ((5.0, 2.0, 4.0, 3.0), 'SRCR', False),
        ((5.0, 3.0, 2.0, 4.0), 'SRRC', False),
        ((3.0, 4.0, 5.0, 2.0), 'SCCC', True),
        ((1.0, 1.0, 1.0, 1.0), 'S3X', True),
        ((1.0, 1.0, 2.0, 2.0), 'S2X', True),
        ((2.0, 1.0, 1.0, 2.0), 'S2X', False),
        # Change points but for the rounding of decimals.
        ((0.1, 0.4, 0.3, 0.2), 'SCRR', True),
        ((0.1, 0.7, 0.1 + 1e-17, 0.7), 'S2X', True),
        ((0.7, 0.1, 0.7 - 1e-16, 0.1), 'S2X', True),
    ],
)
def test_assessment_names_kind_and_full_turns(lengths, code, turns):
    found = assess(design(lengths, [(60, L)]))
    assert found.kind.code == code
    assert found.turns == turns
    assert (found.full_transmission is not None) == turns


def test_open_positions_are_the_only_reported_defect():
    """Stretched, the right angle's coupler and rocker are 5 long; at 180° A is 7 from O4."""
    four_bar = FourBar.of_lengths(*RIGHT_ANGLE)
    found = assess(Design(four_bar, (DesignRequest(1.0), DesignRequest(pi), DesignRequest(2.0))))
    assert [defect.name for defect in found.defects] == ['open']
    assert found.defects[0].text == (
        'positions 2 and 3 cannot be assembled, the links miss each other by up to 2 m'
    )
    assert found.transmission == 0.0


def test_links_that_never_close_have_no_type():
    found = assess(Design(FourBar.of_lengths(1.0, 1.0, 1.0, 4.0), (DesignRequest(1.0, 2.0),)))
    assert found.kind.code == ''
    assert [defect.name for defect in found.defects] == ['open']
    assert not found.turns


def test_defect_texts_name_positions_and_angles():
    texts = {
        'two assemblies of a crank that turns': (
            'positions 1 and 2 on the left assembly, position 3 on the right one; only taking it '
            'apart leads from one to the other'
        ),
        'two ranges, one assembly': (
            'the crank moves in two ranges, with position 1 in one and position 2 in the other; '
            'only taking it apart leads from one to the other'
        ),
        'out of order in a turn': (
            'a crank that turns one way passes the positions in the order '
            '1 (20°), 3 (90°), 2 (150°), 4 (200°)'
        ),
        'out of order across 180°': (
            'a crank that turns one way passes the positions in the order '
            '2 (100°), 1 (190°), 3 (200°)'
        ),
        'a parallelogram through its change point': (
            'coupler and rocker are in line at a crank angle of 180°, and the rocker may go '
            'either way from there'
        ),
        'a parallelogram and what it folds into': (
            'position 1 on the left assembly, position 2 on the right one; they meet only where '
            'coupler and rocker are in line, at crank angles of 0° and 180°, and a crank does '
            'not lead from one to the other'
        ),
    }
    for name, text in texts.items():
        lengths, positions, *_ = CASES[name]
        (defect,) = assess(design(lengths, positions)).defects
        assert defect.text == text


def test_crank_rocker_transmission_angle_equals_the_textbook_formula():
    """There cos μ = (b² + c² − (d ∓ a)²)/2bc (Norton, Design of Machinery, ch. 4)."""
    a, b, c, d = CRANK_ROCKER
    inward, outward = (acos((b * b + c * c - s * s) / (2.0 * b * c)) for s in (d - a, d + a))
    found = assess(design(CRANK_ROCKER, [(20, L), (90, L), (150, L)]))
    assert found.full_transmission == pytest.approx(min(inward, outward))
    assert found.transmission == pytest.approx(transmission(CRANK_ROCKER, radians(20)))
    assert found.at == pytest.approx(radians(20))
    passing = assess(design(CRANK_ROCKER, [(330, L), (20, L)]))
    assert passing.transmission == pytest.approx(inward)
    assert passing.at == pytest.approx(tau)
    # Past 180° first, where the angle is greater.
    assert inward < outward
    around = assess(design(CRANK_ROCKER, [(20, L), (140, L), (260, L), (10, L)]))
    assert around.transmission == pytest.approx(inward)
    assert around.at == pytest.approx(tau)


def test_defective_design_reports_the_transmission_angle_at_positions():
    found = assess(design(DOUBLE_ROCKER, [(55, L), (65, L), (80, R)]))
    angles = {t: transmission(DOUBLE_ROCKER, radians(t)) for t in (55, 65, 80)}
    at = min(angles, key=angles.__getitem__)
    assert found.transmission == pytest.approx(angles[at])
    assert found.at == pytest.approx(radians(at))


# The simulator.

STEP = radians(0.5)
NEAR = 1e-9


def follow(lengths: Lengths, start: float, first: complex, places: list, way: int) -> dict:
    """Move the crank one way to a turn or a toggle; return how far each place lies."""
    stops = {i: (way * (t - start)) % tau for i, (t, _) in enumerate(places)}
    stops = {i: 0.0 if tau - gone < NEAR else gone for i, gone in stops.items()}
    steps = sorted({*stops.values(), *np.arange(0.0, tau, STEP).tolist()})
    at, reached = first, {}
    for gone in steps:
        both = pins(lengths, start + way * gone)
        if both is None:
            break
        at = min(both, key=lambda pin: abs(pin - at))
        for i, stop in stops.items():
            if stop == gone and abs(places[i][1] - at) < NEAR * sum(lengths):
                reached[i] = gone
    return reached


def moves_through(lengths: Lengths, places: list) -> float | None:
    """Return how far the crank turns through all places in order, None if it cannot."""
    found = []
    for way in (1, -1):
        reached = follow(lengths, *places[0], places, way)
        if len(reached) == len(places) and all(
            p <= q for p, q in pairwise(reached[i] for i in range(len(places)))
        ):
            found.append(way * reached[len(places) - 1])
    return min(found, key=abs, default=None)


def components(lengths: Lengths) -> tuple:
    """Return where on a fine ring the loop closes, and the circuit of each place of both sides."""
    count = 3600
    closes = [pins(lengths, tau * (i + 0.5) / count) is not None for i in range(count)]
    label = {(i, side): (i, side) for i in range(count) for side in (0, 1) if closes[i]}

    def root(node: tuple) -> tuple:
        while label[node] != node:
            node = label[node]
        return node

    for i in range(count):
        following = (i + 1) % count
        if not closes[i]:
            continue
        if closes[following]:
            for side in (0, 1):
                label[root((i, side))] = root((following, side))
        else:
            label[root((i, 0))] = root((i, 1))
        if not closes[i - 1]:
            label[root((i, 0))] = root((i, 1))
    return count, root


def same_circuit(lengths: Lengths, places: list) -> bool:
    a, _, _, d = lengths
    count, root = components(lengths)
    roots = set()
    for direction, pin in places:
        crank_pin = a * complex(cos(direction), sin(direction))
        side = int(cross(d - crank_pin, pin - crank_pin) < 0.0)
        roots.add(root((int(direction % tau / tau * count), side)))
    return len(roots) == 1


def clear(lengths: Lengths) -> bool:
    """Return whether a four-bar is far from folding flat."""
    shortest, p, q, longest = sorted(lengths)
    return abs(shortest + longest - p - q) > 0.05 * longest and longest < shortest + p + q


def random_angles(rng: random.Random, lengths: Lengths) -> list[float]:
    """Return crank angles in degrees that close, mostly one way, not within a step of a toggle."""
    a, b, c, d = lengths
    begin = rng.uniform(-180.0, 180.0)
    span = rng.choice((40.0, 150.0, 350.0))
    angles = [begin + rng.uniform(0.0, span) for _ in range(30)]
    angles = [
        t
        for t in angles
        if abs(b - c) + 0.01
        < abs(d - a * complex(cos(radians(t)), sin(radians(t))))
        < b + c - 0.01
    ][: rng.choice((2, 3, 3, 4, 5))]
    return sorted(angles)[:: rng.choice((1, -1))] if rng.random() < 0.7 else angles


def test_random_four_bar_defects_equal_a_simulator():
    rng = random.Random(17)
    seen: dict = {}
    tried = 0
    while tried < 400:
        # Every other time a coupler that is short enough to turn.
        coupler = rng.choice((0.4, 1.0))
        lengths = tuple(
            size * rng.choice((0.5, 1.0, 2.0)) * rng.uniform(1.0, 2.0)
            for size in (1.0, coupler, 1.0, 1.0)
        )
        if not clear(lengths):
            continue
        angles = random_angles(rng, lengths)
        if len(angles) < 2:
            continue
        side = rng.choice((L, R))
        sides = [side if rng.random() < 0.9 else rng.choice((L, R)) for _ in angles]
        tried += 1
        places = [
            (radians(t), on(where, lengths, radians(t)))
            for t, where in zip(angles, sides, strict=True)
        ]
        made = design(
            lengths,
            list(zip(angles, sides, strict=True)),
            zeros=(rng.uniform(-3.0, 3.0), rng.uniform(-3.0, 3.0)),
            ground=rng.uniform(0.1, 3.0),
        )
        found = assess(made)
        names = [defect.name for defect in found.defects]
        travel = moves_through(lengths, places)
        assert (travel is not None) == (not names), (lengths, angles, sides, names)
        assert ('circuit' in names) == (not same_circuit(lengths, places))
        if 'circuit' not in names:
            assert ('branch' in names) == (len(set(sides)) == 2)
        if travel is not None:
            start, end = found.travel
            assert start == made.wanted[0].crank
            assert end - start == pytest.approx(travel, abs=1e-9)
        key = found.kind.code[:1], found.turns, *names
        seen[key] = seen.get(key, 0) + 1
    for key in (
        ('G', True), ('G', True, 'circuit'), ('G', True, 'order'), ('G', False),
        ('G', False, 'circuit'), ('G', False, 'branch'), ('R', False), ('R', False, 'branch'),
        ('R', False, 'order'), ('R', False, 'branch', 'order'),
    ):  # fmt: skip
        assert seen.get(key, 0) > 3, f'{key} is hardly tried: {seen}'


def test_least_transmission_angle_equals_a_dense_sweep():
    rng = random.Random(18)
    tried = 0
    while tried < 100:
        lengths = tuple(rng.uniform(1.0, 4.0) for _ in range(4))
        if not clear(lengths):
            continue
        angles = [rng.uniform(-180.0, 180.0), rng.uniform(-180.0, 180.0)]
        if any(pins(lengths, radians(t)) is None for t in angles):
            continue
        found = assess(design(lengths, [(t, R) for t in angles]))
        if found.travel is None:
            continue
        tried += 1
        start, end = found.travel
        sweep = [transmission(lengths, t) for t in np.linspace(start, end, 3001)]
        # Near its least place, at the ground line, the angle is as the square of the step.
        assert found.transmission <= min(sweep) + 1e-12
        assert found.transmission == pytest.approx(min(sweep), abs=1e-4)
        assert transmission(lengths, found.at) == pytest.approx(found.transmission, abs=1e-12)
        assert min(start, end) - 1e-12 <= found.at <= max(start, end) + 1e-12
        if found.turns:
            sweep = [transmission(lengths, t) for t in np.linspace(0.0, tau, 3601)]
            assert found.full_transmission == pytest.approx(min(sweep), abs=1e-9)


@pytest.mark.parametrize('delta', [2.0**-20, 2.0**-26, 2.0**-30])
@pytest.mark.parametrize(
    ('ground', 'direction', 'rocker', 'sign'), [(4.0, pi, 3.0, 1.0), (6.0, 0.0, 7.0, -1.0)]
)
def test_transmission_angle_stays_exact_near_folding(ground, direction, rocker, sign, delta):
    """
    A crank of 1 along the ground makes the diagonal 5, a coupler of 2 and a rocker nearly fit it.

    Of a rocker of 3 + δ, sin²(μ/2) = ((2 + c)² − 25)/8c = δ(10 + δ)/8c for the acute angle; of
    7 − δ it is (25 − (c − 2)²)/8c = δ(10 − δ)/8c.
    """
    c = rocker + sign * delta
    expected = 2.0 * asin((delta * (10.0 + sign * delta) / (8.0 * c)) ** 0.5)
    four_bar = FourBar.of_lengths(1.0, 2.0, c, ground)
    found = assess(Design(four_bar, (DesignRequest(direction),)))
    assert found.transmission == pytest.approx(expected, rel=1e-14, abs=0.0)
