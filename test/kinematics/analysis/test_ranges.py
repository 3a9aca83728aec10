# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Ranges of the input, what is found over them, and the names of four-bars."""

from cmath import rect
from dataclasses import replace
from itertools import product
from math import acos, asin, cos, degrees, hypot, inf, pi, radians, remainder, sin, sqrt, tau
from pathlib import Path
import random

from hypothesis import assume, given, strategies as st
from linkage_ros.description import load
from linkage_ros.kinematics import (
    AssemblyPose,
    Closure,
    describe_ranges,
    find_extremes,
    find_worst_states,
    follow_grid,
    four_bar_type,
    four_bars,
    grid_positions,
    Input,
    InputRange,
    InputSweep,
    Limits,
    Linkage,
    RevoluteJoint,
    sample_inputs,
    Status,
    transmission_angles,
    usual_inputs,
)
from mpmath import mp, mpf
import pytest

from ..linkages import class_3_linkage, four_bar_linkage, inverted_slider_crank_linkage
from ..reference import four_bar, inverted_slider_crank, UNIT_ROUNDOFF
from ..test_gallery import closure_of as shipped

# The range of the crank: its ends are where the loop stops closing.


# Lengths a, b, c, d.
FOUR_BARS = {
    'crank-rocker': (2.0, 7.0, 9.0, 6.0),
    'double crank': (5.0, 4.0, 6.0, 2.0),
    'parallelogram': (1.0, 2.0, 1.0, 2.0),
    'stretches': (6.0, 4.0, 5.0, 4.5),
    'folds': (4.0, 8.0, 3.0, 6.0),
    'both': (4.0, 5.5, 2.5, 5.0),
    'hardly opens': (4.0, 1.0, 1.0 + 2**-20, 6.0 - 2**-22),
    'hardly does not stretch': (4.0, 6.0, 3.0, 5.0 - 2**-40),
}

ERROR = 8.0
"""Limit for a range's ends, in u·κ."""


def end_of_range(a: float, b: float, c: float, d: float, span: str) -> tuple[mpf, mpf]:
    """Return the crank angle at which the diagonal is b + c, or |b - c| long, and its κ."""
    with mp.workdps(60):
        a, b, c, d = map(mpf, (a, b, c, d))
        limit = b + c if span == 'stretch' else abs(b - c)
        angle = mp.acos((a * a + d * d - limit * limit) / (2 * a * d))
        # Of a² + d² − 2ad·cos φ = limit², by each length:
        slope = a * d * mp.sin(angle)
        condition = (
            angle
            + (
                abs(a * (a - d * mp.cos(angle)))
                + abs(d * (d - a * mp.cos(angle)))
                + limit * (b + c)
            )
            / slope
        )
        return angle, condition


@pytest.mark.parametrize('name', FOUR_BARS)
def test_four_bar_range_ends_at_fold_and_stretch(name):
    check_ranges(FOUR_BARS[name])


def test_random_four_bar_ranges_end_at_fold_and_stretch():
    rng = random.Random(4)
    kinds = set()
    while len(kinds) < 4 or rng.random() > 1e-3:
        a, b, c, d = (10.0 ** rng.uniform(-1, 1) for _ in range(4))
        if 2 * max(a, b, c, d) < a + b + c + d:
            kinds.add(check_ranges((a, b, c, d)))


def check_ranges(lengths: tuple[float, float, float, float]) -> tuple[bool, bool]:
    """Compare the ranges with the reference's limit angles; return what limits the crank."""
    a, b, c, d = lengths
    folds, stretches = abs(d - a) < abs(b - c), a + d > b + c
    ranges = Closure(four_bar_linkage(lengths, 'left')).input_ranges
    for low, high, *_ in ranges:
        if not folds and not stretches:
            assert (low, high) == (-pi, pi)
    ends = [abs(end) for low, high, *_ in ranges for end in (low, high)]
    if folds:
        angle, condition = end_of_range(*lengths, 'fold')
        # Behind the far side of the ground a range goes on, up to the same angle beyond.
        near = [end if end <= pi else 2 * pi - end for end in ends]
        met = min(near, key=lambda end: abs(end - float(angle)))
        # The far end is written as 2π less the near one, and rounded at that size.
        assert abs(met - angle) < ERROR * UNIT_ROUNDOFF * (condition + 2 * mp.pi), lengths
    if stretches:
        angle, condition = end_of_range(*lengths, 'stretch')
        met = min(ends, key=lambda end: abs(end - float(angle)))
        assert abs(met - angle) < ERROR * UNIT_ROUNDOFF * condition, lengths
    assert len(ranges) == (2 if folds and stretches else 1)
    return folds, stretches


@pytest.mark.sample(2)
@pytest.mark.parametrize('name', FOUR_BARS)
def test_four_bar_closes_only_inside_its_ranges(name):
    lengths = FOUR_BARS[name]
    closure = Closure(four_bar_linkage(lengths, 'right'))
    for i in range(1, 400):
        phi = -pi + i * pi / 200 + 1e-4
        inside = any(low <= phi + turn <= high for low, high, *_ in closure.input_ranges
                     for turn in (0.0, 2 * pi))  # fmt: skip
        status = closure.position(phi).status
        assert (status is not Status.OPEN) == inside
        assert inside == (four_bar(*lengths, phi, 1).gap <= 0)


@pytest.mark.sample(1)
@pytest.mark.parametrize('reach', [0.66, 0.68, 0.7])
def test_dyad_behind_a_platform_limits_the_range(reach):
    """Its pin is a pin of a platform on three arms, whose branch closes farther."""
    platform = class_3_linkage()
    linkage = replace(
        platform,
        links={
            **platform.links,
            'ground': {**platform.links['ground'], 'G': (1.6, 1.4)},
            'rod': {'P2': (0.0, 0.0), 'Q': (reach, 0.0)},
            'rocker': {'G': (0.0, 0.0), 'Q': (0.3, 0.0)},
        },
        assembly={'Q': 'left'},
    )
    (alone,), ranges = Closure(platform).input_ranges, Closure(linkage).input_ranges
    closure, at_platform = Closure(linkage), Closure(platform)
    count = 0
    for index in range(1, 200):
        crank = alone.lowest + (alone.highest - alone.lowest) * index / 200
        position = at_platform.position(crank)
        far = abs(position.points['P2'] - complex(1.6, 1.4))
        reached = reach - 0.3 <= far <= reach + 0.3
        count += reached
        assert any(one.lowest <= crank <= one.highest for one in ranges) == reached, crank
        assert closure.position(crank).status.has_pose == reached
    assert 10 < count < 190


@pytest.mark.parametrize(
    ('lengths', 'whole'),
    [
        ((0.15, 0.27, 0.02), True),
        ((0.27, 0.15, -0.12), True),
        ((0.15, 0.27, 0.2), False),
        ((0.2, 0.2, 0.3), False),
        ((0.2, 0.2, 0.0), True),
    ],
)
def test_inverted_slider_crank_range_ends_at_its_reach(lengths, whole):
    closure = Closure(inverted_slider_crank_linkage(lengths, 'ahead'))
    ((low, high, *_),) = closure.input_ranges
    if whole:
        assert (low, high) == (-pi, pi)
        return
    a, d, h = lengths
    angle, condition = end_of_range(a, abs(h), 0.0, d, 'stretch')
    assert abs(low - angle) < ERROR * UNIT_ROUNDOFF * condition
    assert abs(high - (2 * mp.pi - angle)) < ERROR * UNIT_ROUNDOFF * (condition + 2 * mp.pi)
    for phi in (low - 1e-6, low + 1e-6, pi, high - 1e-6, high + 1e-6):
        expected = inverted_slider_crank(*lengths, phi, 1).gap <= 0
        assert (closure.position(phi).status is Status.CLOSED) == expected


@pytest.mark.parametrize('angle', [0.7, -2.0])
def test_input_range_shifts_with_the_crank_frame(angle):
    lengths = FOUR_BARS['both']
    plain = Closure(four_bar_linkage(lengths, 'left')).input_ranges
    turned = Closure(four_bar_linkage(lengths, 'left', {'crank': (0.1, 0.2, angle)})).input_ranges
    for (low, high, *_), (turned_low, turned_high, *_) in zip(plain, turned, strict=True):
        assert (turned_low, turned_high) == pytest.approx((low - angle, high - angle), abs=1e-14)


def test_ranges_are_described_in_words():
    words = {
        name: describe_ranges(Closure(four_bar_linkage(lengths, 'left')).input_ranges)
        for name, lengths in FOUR_BARS.items()
    }
    assert words['crank-rocker'] == 'every crank angle'
    angle, _ = end_of_range(*FOUR_BARS['stretches'], 'stretch')
    assert words['stretches'] == f'-{float(angle):.6g} to {float(angle):.6g} rad'
    assert words['both'].count(' to ') == 2
    assert ' or ' in words['both']


def carried(phi: float) -> complex:
    """Return where a point of the rocker of a crank-rocker lies, by two circles."""
    a, b, c, d = 2.0, 7.0, 9.0, 6.0
    pin = rect(a, phi)
    between = d - pin
    s = abs(between)
    along = (b * b - c * c + s * s) / (2.0 * s)
    joint = pin + between / s * complex(along, (b * b - along * along) ** 0.5)
    return d + (joint - d) * rect(0.6, 0.7)


def chain(one: float, other: float) -> Linkage:
    """Return that crank-rocker with a dyad of two lengths from the rocker to the ground."""
    point = rect(9.0 * 0.6, 0.7)
    return Linkage(
        links={
            'ground': {'O': (0.0, 0.0), 'D': (6.0, 0.0), 'E': (20.0, 4.0)},
            'crank': {'O': (0.0, 0.0), 'A': (2.0, 0.0)},
            'coupler': {'A': (0.0, 0.0), 'B': (7.0, 0.0)},
            'rocker': {'D': (0.0, 0.0), 'B': (9.0, 0.0), 'F': (point.real, point.imag)},
            'link': {'F': (0.0, 0.0), 'G': (one, 0.0)},
            'arm': {'E': (0.0, 0.0), 'G': (other, 0.0)},
        },
        inputs=(Input('crank_joint', 'ground', 'crank'),),
        assembly={'B': 'left', 'G': 'left'},
        joints={'arm_joint': RevoluteJoint('ground', 'arm')},
        sliders={},
    )


@pytest.mark.parametrize('narrow', [1e-4, 1e-8, 1e-10])
@pytest.mark.parametrize('gap', [False, True], ids=['a part', 'a gap'])
def test_range_search_finds_parts_narrower_than_its_samples(narrow, gap):
    # The distance from the rocker's point to the ground's has one summit over the turn. A dyad
    # that reaches all but the last of it leaves a gap there; one that needs it closes only there.
    def distance(phi: float) -> float:
        return abs(20.0 + 4.0j - carried(phi))

    summit = max((2.0 * pi * i / 20_000 for i in range(20_000)), key=distance)
    for step in (1e-4, 1e-6, 1e-8):
        summit = max((summit + k * step for k in range(-100, 101)), key=distance)
    limit = distance(summit) - narrow
    lengths = (limit - 1.5, 1.5) if gap else (limit + 1.5, 1.5)
    closure = Closure(chain(*lengths))
    ends = []
    for side in (-1.0, 1.0):
        inside, outside = 0.0, 0.3
        for _ in range(60):
            middle = 0.5 * (inside + outside)
            higher = distance(summit + side * middle) > limit
            inside, outside = (middle, outside) if higher else (inside, middle)
        ends.append(summit + side * inside)
    found = [end for interval in closure.input_ranges for end in interval[:2]]
    for end in ends:
        assert min(abs(remainder(end - one, 2.0 * pi)) for one in found) < 1e-7


# Results over a range: its limits in the user's units, extremes, residuals, four-bars.


LINKAGES = Path(__file__).parents[3] / 'config' / 'linkages'
FILES = sorted(LINKAGES.glob('*.yaml'))


def of_lengths(a: float, b: float, c: float, d: float) -> InputSweep:
    return InputSweep(Closure(four_bar_linkage((a, b, c, d), 'left')))


def test_full_turn_range_begins_at_zero():
    assert of_lengths(2.0, 7.0, 9.0, 6.0).ranges == (InputRange(0.0, tau),)


def test_single_change_point_range_covers_two_turns():
    assert of_lengths(1.0, 4.0, 3.0, 2.0).ranges == (InputRange(0.0, 2.0 * tau),)
    assert of_lengths(1.0, 2.0, 1.0, 2.0).ranges == (InputRange(0.0, tau),)  # a parallelogram: one


MOST_TURNS = 8
"""Turns of a range that are listed at most."""


@given(
    st.tuples(st.integers(-40, 40), st.integers(-40, 40)).map(sorted),
    st.sampled_from(['both', 'lower', 'upper']),
    st.floats(0.0, 0.999),
)
def test_wide_limits_list_the_turns_about_their_middle(turns, given_limits, fraction):
    # The crank swings about 0, so a range lies in each turn.
    lengths = 4.0, 8.0, 3.0, 6.0
    (whole,) = of_lengths(*lengths).ranges
    low = tau * (turns[0] + fraction) if given_limits != 'upper' else -inf
    high = tau * (turns[1] + 1 + fraction) if given_limits != 'lower' else inf
    linkage = four_bar_linkage(lengths, 'left')
    crank = replace(linkage.inputs[0], limits=Limits(low, high))
    parts = InputSweep(Closure(replace(linkage, inputs=(crank,)))).ranges
    within = [
        turn
        for turn in range(-60, 60)
        if whole.lowest + tau * turn < high and whole.highest + tau * turn > low
    ]
    listed = [
        turn
        for part in parts
        for turn in within
        if whole.lowest <= 0.5 * (part.lowest + part.highest) - tau * turn <= whole.highest
    ]
    assert listed == [*range(listed[0], listed[0] + min(len(within), MOST_TURNS))]
    assert set(listed) <= set(within)
    if given_limits == 'lower':
        assert listed[0] == within[0]
    elif given_limits == 'upper':
        assert listed[-1] == within[-1]
    else:
        assert abs((listed[0] + listed[-1]) - (within[0] + within[-1])) <= 2


def test_peaucellier_range_is_symmetric_about_zero():
    """Its limit follows from one triangle: O, B and a point that is 0.075 m from B."""
    ((low, high, *_),) = InputSweep(shipped('peaucellier')).ranges
    # The arms close where |OB| = 0.125 − 0.05, and |OB| = 2·0.05·cos(φ/2).
    limit = 2.0 * acos(0.75)
    assert low == pytest.approx(-limit, abs=1e-14)
    assert high == pytest.approx(limit, abs=1e-14)


@pytest.mark.parametrize('file', FILES, ids=lambda file: file.stem)
def test_gallery_linkage_has_its_usual_pose_inside_its_range(file):
    closure = shipped(file.stem)
    inputs = usual_inputs(closure)
    assert closure.position(*inputs).status is Status.CLOSED
    interval = InputSweep(closure, inputs).range_about(inputs[0])
    assert interval is not None
    assert interval.lowest < inputs[0] < interval.highest


@pytest.mark.parametrize('file', FILES, ids=lambda file: file.stem)
def test_worst_state_of_gallery_linkages_closes_to_rounding(file):
    closure = shipped(file.stem)
    worst = find_worst_states(closure)
    assert worst is not None
    assert worst.residual < 1e-14 * closure.scale
    assert closure.residual(closure.position(*worst.inputs)) == worst.residual
    assert worst.positions > 400


# A wheel loader: the boom's angle and a cylinder from the chassis to a bell crank on the boom.
LOADER = """
units: mm
angles: degrees
links:
  ground: {A: [0, 0], G: [120, -350]}
  boom: {A: [0, 0], H: [1400, 180]}
  tube: {G: [0, 0]}
  rod: {D: [0, 0]}
  bell: {H: [0, 0], D: [0, 620]}
sliders:
  bore: {point: D, block: rod, along: tube, through: G, direction: [1, 0]}
input:
  - {joint: boom_joint, parent: ground, child: boom}
  - {joint: tilt_cylinder, slider: bore}
pose:
  inputs: [-20, 1500]
  points: {D: [1500, 400]}
joints:
  bell_joint: {parent: boom, child: bell}
"""


def test_worst_states_of_a_loader_equal_a_grid_scan(tmp_path):
    file = tmp_path / 'loader.yaml'
    file.write_text(LOADER)
    closure = load(file)
    worst = find_worst_states(closure)
    positions = [(at, one) for at, one in grid_positions(closure) if one.status.has_pose]
    assert worst.positions == len(positions)
    assert worst.residual == max(closure.residual(one) for _, one in positions)
    assert closure.residual(closure.position(*worst.inputs)) == worst.residual
    least = min(closure.singularity_margin(one).conditioning for _, one in positions)
    assert worst.margin.conditioning == pytest.approx(least, abs=1e-9)


def test_five_bar_is_nearest_singular_at_straightest_forearms():
    closure = shipped('five_bar')
    worst = find_worst_states(closure)
    assert worst is not None
    assert worst.margin is not None

    def angle(inputs):
        """Return the angle between the forearms, folded into [0, π/2]: of their lengths."""
        points = closure.points(closure.position(*inputs))
        left = points['left_forearm', 'P'] - points['left_forearm', 'A']
        right = points['right_forearm', 'P'] - points['right_forearm', 'B']
        return abs(asin((left.conjugate() * right).imag / (abs(left) * abs(right))))

    assert worst.margin.conditioning == pytest.approx(sqrt(2.0) * sin(angle(worst.nearest) / 2.0))
    for inputs in product([radians(each) for each in (60, 75, 90, 105, 120)], repeat=2):
        if closure.position(*inputs).joints:
            assert angle(inputs) >= angle(worst.nearest) - 1e-12


# A pose, and the start of a linkage with it; for a crank-rocker, and one that folds.
POSES = {
    'none': ((2.0, 7.0, 9.0, 6.0), None, radians(60.0)),
    'a start': ((2.0, 7.0, 9.0, 6.0), AssemblyPose((0.436,), {}), 0.436),
    'a start some turns away': ((2.0, 7.0, 9.0, 6.0), AssemblyPose((-20.0,), {}), -20.0),
    'a start of one that folds': ((4.0, 8.0, 3.0, 6.0), AssemblyPose((2.5,), {}), 2.5),
    # It closes beyond acos(27/48) only: from there to as far on the other side, two thirds.
    'a start where it is open': ((4.0, 8.0, 3.0, 6.0), AssemblyPose((0.5,), {}),
                                 acos(0.5625) + (tau - 2.0 * acos(0.5625)) * 2.0 / 3.0),
    'as drawn': ((2.0, 7.0, 9.0, 6.0), AssemblyPose((0.436,), {'A': (1.8, 0.8)}), 0.436),
}  # fmt: skip


@pytest.mark.parametrize('kind', POSES)
def test_linkage_starts_at_the_inputs_of_its_pose(kind):
    lengths, pose, expected = POSES[kind]
    linkage = replace(four_bar_linkage(lengths, 'left'), pose=pose)
    assert usual_inputs(Closure(linkage)) == (pytest.approx(expected, abs=1e-14),)


@pytest.mark.parametrize(
    ('inputs', 'expected'),
    [((1.3, 1.7), (1.3, 1.7)), ((pi, 0.0), (radians(60.0), radians(60.0)))],
    ids=['closes', 'open: the elbows are 0.3 m apart, 0.22 at most'],
)
def test_five_bar_starts_at_the_inputs_of_its_pose(inputs, expected):
    linkage = replace(shipped('five_bar').linkage, pose=AssemblyPose(inputs, {}))
    assert usual_inputs(Closure(linkage)) == pytest.approx(expected)


def test_input_sweep_holds_the_other_inputs():
    """The elbows of the five-bar are 0.22 m apart at the ends of the left crank's way."""
    closure = shipped('five_bar')
    way = InputSweep(closure, (radians(60.0), radians(60.0)))
    ((low, high, *_),) = way.ranges
    b = complex(0.12 + 0.09 * cos(radians(60.0)), 0.09 * sin(radians(60.0)))
    for end in (low, high):
        a = complex(0.09 * cos(end), 0.09 * sin(end))
        assert abs(b - a) == pytest.approx(0.22, abs=1e-14)
    assert way.is_closed(radians(60.0))
    assert not way.is_closed(high + 1e-9)


def test_a_range_is_found_from_any_turn():
    way = of_lengths(4.0, 8.0, 3.0, 6.0)  # folds: its range is about 180 degrees
    (interval,) = way.ranges
    middle = 0.5 * (interval.lowest + interval.highest)
    found = way.range_about(middle - 3.0 * tau)
    assert found is not None
    assert found.lowest == pytest.approx(interval.lowest - 3.0 * tau)
    assert way.range_about(0.0) is None


@pytest.mark.parametrize('whole', [True, False])
def test_samples_cover_the_range_from_end_to_end(whole):
    interval = InputRange(0.0, tau) if whole else InputRange(-0.7, 1.1)
    values = sample_inputs(interval, 50)
    assert values[0] == interval.lowest
    assert values[-1] == interval.highest
    assert values == sorted(values)
    assert len(values) == 51


@given(st.floats(-3.0, 3.0), st.floats(0.05, 2.0), st.floats(0.0, 0.9), st.integers(1, 7))
def test_extremes_of_a_periodic_function_are_found(place, size, other, times):
    """A cosine with a smaller one of a higher order: lowest value known where they agree."""

    def function(x: float) -> float:
        return -size * cos(x - place) - other * 0.1 * size * cos(times * (x - place))

    found = find_extremes(function, [InputRange(0.0, tau)])
    assert found.lowest.value == pytest.approx(function(place), rel=1e-12)
    # A value within 1e-13 of the best counts as the best: at a curvature of the size, so far off.
    off = sqrt(2e-13 / size)
    assert any(abs(remainder(at - place, tau)) < 1.1 * off for at in found.lowest.at)


def test_constant_function_has_extremes_at_no_input():
    found = find_extremes(lambda _: 1.25, [InputRange(0.0, tau)])
    assert found == ((1.25, ()), (1.25, ()))


def test_extremes_include_the_ends_of_a_range():
    found = find_extremes(lambda x: x, [InputRange(-0.5, 2.0)])
    assert found == ((-0.5, (-0.5,)), (2.0, (2.0,)))


def test_crank_rocker_transmission_angle_equals_the_textbook_formula():
    """It is met where the crank lies along the ground: cos μ = (b² + c² − (d ∓ a)²)/(2bc)."""
    rng = random.Random(7)
    for _ in range(20):
        a = rng.uniform(0.5, 1.0)
        b, c, d = (rng.uniform(2.0, 3.0) for _ in range(3))
        if a + max(b, c, d) >= b + c + d - max(b, c, d):
            continue
        angles = [acos((b * b + c * c - s * s) / (2.0 * b * c)) for s in (d - a, d + a)]
        folded = [min(angle, pi - angle) for angle in angles]
        ((_, found),) = transmission_angles(of_lengths(a, b, c, d)).items()
        assert found.lowest.value == pytest.approx(min(folded), abs=1e-12)
        assert found.lowest.at == (pytest.approx((0.0, pi)[folded.index(min(folded))], abs=1e-6),)
        if angles[0] < pi / 2.0 < angles[1]:
            assert found.highest.value == pytest.approx(pi / 2.0, abs=1e-12)


def test_slider_crank_transmission_angle_equals_the_textbook_formula():
    ((_, found),) = transmission_angles(InputSweep(shipped('slider_crank'))).items()
    assert degrees(found.lowest.value) == pytest.approx(degrees(acos(0.05 / 0.14)), abs=1e-9)
    assert [degrees(at) for at in found.lowest.at] == [pytest.approx(270.0, abs=1e-5)]


def test_watt_linkage_lists_both_of_its_four_bars():
    first, second = four_bars(shipped('watt_1').structure)
    assert first.links == ('crank', 'coupler', 'rocker', 'ground')
    assert first.kind == four_bar_type(*first.lengths)
    assert second.links == ('rocker', 'output_link', 'upper_link', 'coupler')
    # B to D on the rocker, D to E, E to C, C to B on the coupler.
    known = (hypot(0.01, 0.05), 0.1, 0.08, hypot(0.03, 0.05))
    assert second.lengths == pytest.approx(known, rel=1e-15)


@pytest.mark.parametrize(
    ('name', 'count'), [('klann_leg', 1), ('stephenson_3', 1), ('five_bar', 0)]
)
def test_five_link_loops_do_not_count_as_four_bars(name, count):
    assert len(list(four_bars(shipped(name).structure))) == count


def test_cylinder_loop_does_not_count_as_four_bar():
    (bar,) = four_bars(shipped('excavator_bucket').structure)
    assert bar.links == ('rocker', 'bucket_link', 'bucket', 'ground')


def test_position_grid_covers_all_inputs():
    found = list(grid_positions(shipped('five_bar'), 6))
    assert len({inputs for inputs, _ in found}) == len(found) == 36


def without_limits(closure):
    return type(closure)(closure.linkage.with_limits(dict.fromkeys(closure.input_names, Limits())))


def test_grid_followed_from_the_pose_finds_all_closed_states():
    """Of two motors of an ankle that turn fully, a fifth is open; not all of that is tried."""
    closure, tried = without_limits(shipped('ankle_motors')), []
    expected = [at for at, one in grid_positions(closure) if one.status.has_pose]
    close = closure.close_unlimited
    closure.close_unlimited = lambda *inputs: tried.append(inputs) or close(*inputs)
    assert [inputs for inputs, _ in follow_grid(closure)] == expected
    assert len(expected) < len({*tried}) == len(tried) < len(list(grid_positions(closure)))


# The name of a four-bar: Barker's fourteen types, and Grashof's inequality for the motion.


# Barker's fourteen types as R. L. Norton, Design of Machinery, ch. 2, lists them: by which link
# is shortest (Grashof, change point) or longest (triple rocker). Input, coupler, output, frame.
BARKER = {
    'GCCC': (3.0, 4.0, 3.5, 2.0),
    'GCRR': (2.0, 4.0, 3.5, 3.0),
    'GRCR': (3.0, 2.0, 3.5, 4.0),
    'GRRC': (3.0, 4.0, 2.0, 3.5),
    'RRR1': (2.0, 3.0, 2.5, 4.0),
    'RRR2': (4.0, 3.0, 2.5, 2.0),
    'RRR3': (3.0, 4.0, 2.5, 2.0),
    'RRR4': (3.0, 2.5, 4.0, 2.0),
    'SCCC': (2.0, 4.0, 3.0, 1.0),
    'SCRR': (1.0, 4.0, 3.0, 2.0),
    'SRCR': (2.0, 1.0, 3.0, 4.0),
    'SRRC': (2.0, 4.0, 1.0, 3.0),
    'S2X': (2.0, 3.0, 2.0, 3.0),
    'S3X': (2.0, 2.0, 2.0, 2.0),
}


@pytest.mark.parametrize('code', BARKER)
def test_four_bar_type_names_each_barker_type(code):
    assert four_bar_type(*BARKER[code]).code == code


@pytest.mark.parametrize(
    ('lengths', 'word'),
    [
        ((0.04, 0.12, 0.08, 0.1), 'crank-rocker'),
        ((0.08, 0.07, 0.09, 0.04), 'drag link'),
        ((0.3, 1.6, 0.3, 1.6), 'parallelogram'),
        ((0.3, 0.3, 1.6, 1.6), 'kite'),
        ((1.6, 0.3, 0.3, 1.6), 'kite'),
        ((0.2, 0.08, 0.2, 0.16), 'double rocker'),  # Chebyshev's straight-line linkage
        ((0.2, 0.3, 0.25, 0.4), 'triple rocker'),
        ((0.1, 0.1, 0.1, 0.1), 'rhombus'),
    ],
)
def test_four_bar_type_contains_the_common_name(lengths, word):
    assert word in four_bar_type(*lengths).name


def test_decimal_lengths_that_cancel_give_a_change_point():
    assert 0.1 + 0.7 != 0.3 + 0.5  # in floats
    assert four_bar_type(0.1, 0.7, 0.5, 0.3) == ('SCRR', 'change-point crank-rocker', 0.0)


def test_four_bar_type_margin_equals_the_grashof_difference():
    assert four_bar_type(2.0, 4.0, 3.5, 3.0).margin == 0.5
    assert four_bar_type(4.0, 3.0, 2.5, 2.0).margin == -0.5


def test_four_bar_that_never_closes_has_no_type():
    no_loop = four_bar_type(1.0, 2.0, 3.0, 7.0)
    assert no_loop.code == ''
    assert no_loop.name.startswith('no loop')
    assert no_loop.margin == -3.0
    assert four_bar_type(1.0, 2.0, 3.0, 6.0).code == 'RRR1'  # closes in one place, flat


sides = st.floats(0.1, 10.0)


@given(sides, sides, sides, sides)
def test_reversed_four_bar_swaps_input_and_output_types(a, b, c, d):
    assume(2.0 * max(a, b, c, d) < 0.999 * (a + b + c + d))
    here, there = four_bar_type(a, b, c, d).code, four_bar_type(c, b, a, d).code
    swapped = {'GCRR': 'GRRC', 'SCRR': 'SRRC', 'RRR2': 'RRR4'}
    swapped |= {other: one for one, other in swapped.items()}
    assert there == swapped.get(here, here)


@given(sides, sides, sides, sides)
def test_four_bar_type_predicts_full_turns_of_the_input(a, b, c, d):
    """Against the closure, whose ranges know nothing of Grashof."""
    assume(2.0 * max(a, b, c, d) < 0.999 * (a + b + c + d))
    kind = four_bar_type(a, b, c, d)
    assume(kind.margin == 0.0 or abs(kind.margin) > 1e-9)
    ranges = Closure(four_bar_linkage((a, b, c, d), 'left')).input_ranges
    if kind.code.startswith('G'):
        assert ranges[0].is_whole == (kind.code[1] == 'C')
    elif kind.code.startswith('R'):
        assert not any(interval.is_whole for interval in ranges)
        assert max(high - low for low, high, *_ in ranges) < 2.0 * pi < inf
