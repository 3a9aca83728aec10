# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
Errors of spatial linkages, step by step and as a whole.

Random steps, far from toggles and down to 1e-9 from one, and whole linkages are compared with
closed forms of more than 50 digits, in power series of `campaigns.series`.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cache, partial
from math import atan2, cos, dist, hypot, pi, remainder, sin, sqrt, tau
from random import Random
from typing import Any, NamedTuple

from bench import ROOT
from bench.report import Table
from campaigns.accuracy.run import accuracy_table, LIMIT, worst_table
from campaigns.campaign import Findings, Page, Part, parts_of, tallies_of
from campaigns.series import CORRECT, ORDER, Row, Series, Tape, UNIT_ROUNDOFF
from campaigns.tally import Judgement, QUANTITIES
from flint import arb
from linkage_ros.description import load
from linkage_ros.errors import LinkageError
from linkage_ros.kinematics import SpaceClosure, SpaceLinkage, SpatialJoint, Status
from linkage_ros.kinematics.space.joints import HingePair, SlidePair
from linkage_ros.kinematics.space.steps import ClosedHinge, ClosedSlide, Rod
from linkage_ros.kinematics.space.three_distances import order_ends, ThreeDistances
from linkage_ros.kinematics.space.vectors import GROUND_FRAME, STILL
from linkage_ros.kinematics.step import LinkState

PAGE = Page(
    ROOT / 'docs' / 'accuracy' / 'space.md',
    'How exact spatial linkages are',
    """
Made by `python -m campaigns space --write`, a part of `make accuracy`; `--cases` sets how many.

Errors are given in units of u·κ, as in [campaign.md](campaign.md). For a step κ goes over all that
it starts from: places, distances, velocities and accelerations. For a linkage it goes over all
places and axes, the length of each rod, which is a number of its own, the inputs, their rates and
their accelerations, and as in the plane over the point that a step passes to the next one, with
its velocity and acceleration, each with its own κ; a published angle counts as π at least. The
reference has more than fifty digits; rates and accelerations are coefficients of power series in
time. *near*: 1e-9 to 1e-3 from a toggle. The limit is 4.
""",
)


def errors_of(
    result: Series,
    found: Sequence[float],
    floor: float | None = None,
    passed: Sequence[Series] = (),
) -> list[float]:
    """
    Return the errors of a value, its rate and its acceleration at the time 0, in u·κ.

    With a ``floor`` the value is an angle modulo 2π, which counts as the floor at least.
    ``passed`` are the coordinates of a point that a step passes to the next one. Its place,
    velocity and acceleration are rounded, so each counts with its own κ.
    """
    given = result.tape.widths
    kappa = result.sizes(given | {part.index: part.sizes(given) for part in passed})
    off = [arb(one) - order for one, order in zip(found, result.orders(), strict=True)]
    if floor is not None:
        kappa[0] += max(floor - abs(float(result.value[0])), 0.0)
        off[0] -= 2 * round(float(off[0]) / (2 * pi)) * arb.pi()
    errors = []
    for error, size in zip(off, kappa, strict=True):
        assert float(error.rad()) <= CORRECT * size, 'fewer than fifty digits are proven'
        errors.append(abs(float(error)) / (UNIT_ROUNDOFF * size) if error != 0 else 0.0)
    return errors


def dot(one: Row, other: Row) -> Series:
    """Return the scalar product."""
    pairs = [*zip(one, other, strict=True)]
    first, *more = (a.value * b.value for a, b in pairs)
    sources = [part for a, b in pairs for part in ((a, b.value), (b, a.value))]
    return Series(one[0].tape, sum(more, first), *sources)


def cross(one: Row, other: Row) -> Row:
    """Return the cross product."""
    (a, b, c), (d, e, f) = one, other
    return [b * f - c * e, c * d - a * f, a * e - b * d]


def less(one: Row, other: Row) -> Row:
    """Return the difference."""
    return [a - b for a, b in zip(one, other, strict=True)]


def unit(vector: Row) -> Row:
    """Return the direction of a vector."""
    size = dot(vector, vector).sqrt()
    return [part / size for part in vector]


def angle_of(x: Series, y: Series) -> Series:
    """Return the angle of a vector in a plane, by integration of its rate."""
    a, b = x.value, y.value
    over = (a * a + b * b).inv()
    turn = (a * b.derivative() - b * a.derivative()) * over
    value = turn.integral() + arb.atan2(b[0], a[0])
    return Series(x.tape, value, (x, -b * over), (y, a * over))


def hinge_angle(place: Row, to: Row, rod: Series, sign: int) -> Series:
    """Return the angle about z that brings a place to a distance from a point."""
    (a, b, h), (x, y, z) = place, to
    rest = h - z
    r, d = dot([a, b], [a, b]), dot([x, y], [x, y])
    even = r + d + (rest * rest - rod * rod)
    turn = angle_of(even, ((r * d) * 4.0 - even * even).sqrt())
    return angle_of(x, y) - angle_of(a, b) + turn * sign


def slide_length(place: Row, to: Row, rod: Series, sign: int) -> Series:
    """Return the slide along z that brings a place to a distance from a point."""
    x, y, z = less(to, place)
    return z + (rod * rod - dot([x, y], [x, y])).sqrt() * sign


def three_spheres(ends: Sequence[Row], rods: Row, sign: int) -> Row:
    """Return the point of three spheres: on the line of two planes, by a quadratic equation."""
    start, one, other = ends
    d, e = less(one, start), less(other, start)
    normal = cross(d, e)
    # (X − P0)·d = (l0² − l1² + |d|²)/2, likewise e.
    first = rods[0] * rods[0]
    sides = [
        (first - rod * rod + dot(edge, edge)) * 0.5 for rod, edge in ((rods[1], d), (rods[2], e))
    ]
    square = dot(normal, normal)
    ways = zip(cross(e, normal), cross(normal, d), strict=True)
    foot = [dot(sides, [*pair]) / square for pair in ways]
    height = ((first - dot(foot, foot)) / square).sqrt() * sign
    return [s + f + height * n for s, f, n in zip(start, foot, normal, strict=True)]


def turned_about(point: Row, at: Row, axis: Row, angle: Series) -> Row:
    """Return a point turned about an axis of any length that passes a place (Rodrigues)."""
    arm, way = less(point, at), unit(axis)
    c, s = angle.cos_sin()
    along = dot(way, arm)
    parts = zip(at, arm, cross(way, arm), way, strict=True)
    weights = [c, s, along - c * along]
    return [a + dot(weights, [*rest]) for a, *rest in parts]


def angle_to_meet(point: Row, at: Row, axis: Row, to: Row, rod: Series, sign: int) -> Series:
    """Return the angle about an axis that brings a point to a distance from another one."""
    z, arm = unit(axis), less(point, at)
    along = dot(arm, z)
    x = unit([a - along * part for a, part in zip(arm, z, strict=True)])
    frame = (x, cross(z, x), z)
    place, beside = ([dot(way, each) for way in frame] for each in (arm, less(to, at)))
    return hinge_angle(place, beside, rod, sign)


def root_near(orders: Sequence[Sequence[float]], gaps: Callable[[Row], Iterable[Series]]) -> Row:
    """Return two unknowns whose two gaps are 0, by Newton's method from found orders."""
    values = [Tape().number(*each).value for each in orders]
    while True:
        tape = Tape()
        unknowns = [Series(tape, value) for value in values]
        left = [*gaps(unknowns)]
        (a, b), (c, d) = ([gap.slopes()[one.index] for one in unknowns] for gap in left)
        over = (b * c - a * d).inv()
        rows = (d * over, -b * over), (-c * over, a * over)
        steps = [p * left[0].value + q * left[1].value for p, q in rows]
        values = [value + step for value, step in zip(values, steps, strict=True)]
        # The next step would be about the square of this one.
        if max(abs(float(step[k])) for step in steps for k in range(ORDER)) < 2.0**-90:
            return [
                Series(tape, value, *zip(left, row, strict=True))
                for value, row in zip(values, rows, strict=True)
            ]


class Case(NamedTuple):
    """A case: its greatest errors in position, rate and acceleration, and what it was."""

    errors: Sequence[float]
    given: object


def _place(random: Random, reach: float = 1.0) -> Any:
    return tuple(random.uniform(-reach, reach) for _ in range(3))


def _distance(random: Random, near: bool) -> float:
    """Return a distance from a toggle: of angles, or of a length relative to it."""
    return 10.0 ** random.uniform(-9.0, -3.0) if near else random.uniform(0.05, pi - 0.05)


def _states_after(
    step: Any, ends: Sequence[Any], velocities: Sequence[Any], changes: Sequence[Any]
) -> tuple[LinkState, ...]:
    """Return the three states after a step that starts from points."""
    solved = LinkState([0.0], [GROUND_FRAME, *ends])
    rates, accelerations = (LinkState([0.0], [STILL, *part]) for part in (velocities, changes))
    pose = step.close(solved)
    assert pose.status is Status.CLOSED, step
    step.accelerations(pose, step.rates(pose, solved, rates), solved, rates, accelerations)
    return solved, rates, accelerations


def hinge_case(random: Random, near: bool = False) -> Case:
    """Return a hinge closed by a rod."""
    place, *motion = (_place(random) for _ in range(4))
    to, sign = motion[0], random.choice((-1, 1))
    r, d, height = hypot(*place[:2]), hypot(*to[:2]), to[2] - place[2]
    apart = _distance(random, near)
    if near:
        low, high = hypot(height, d - r), hypot(height, d + r)
        # A point near the axis has two toggles next to each other.
        apart = min(apart, 0.5 * (high - low) / high)
        rod = random.choice((low * (1.0 + apart), high * (1.0 - apart)))
    else:
        rod = sqrt(d * d + r * r - 2.0 * r * d * cos(apart) + height * height)
    direction = atan2(place[1], place[0])
    pair = HingePair(0, GROUND_FRAME)
    step = ClosedHinge(pair, place, 1, Rod(rod), float(sign), 2, r, direction)
    return _joint_case(step, motion, hinge_angle, floor=0.0)


def slide_case(random: Random, near: bool = False) -> Case:
    """Return a slide closed by a rod."""
    place, *motion = (_place(random) for _ in range(4))
    to, sign = motion[0], random.choice((-1, 1))
    rod = hypot(to[0] - place[0], to[1] - place[1]) * (1.0 + _distance(random, near))
    step = ClosedSlide(SlidePair(0, GROUND_FRAME), place, 1, Rod(rod), float(sign), 2)
    return _joint_case(step, motion, slide_length)


def _joint_case(
    step: Any, motion: Sequence[Any], solve: Callable[..., Any], floor: float | None = None
) -> Case:
    found = [one.coordinates[1] for one in _states_after(step, *([part] for part in motion))]
    tape = Tape()
    value = solve(tape.row(step.place), tape.row(*motion), tape.number(step.rod[0]), step.sign)
    return Case(errors_of(value, found, floor), (step, motion))


def three_distances_case(random: Random, near: bool = False) -> Case:
    """Return a coordinate of a point above the plane of three others, near it for a toggle."""
    motion = ends, *_ = [[_place(random) for _ in range(3)] for _ in range(3)]
    sign, apart = random.choice((-1, 1)), _distance(random, near)
    a, b = random.uniform(-1.0, 1.5), random.uniform(-1.0, 1.5)
    x, y = ([q - p for p, q in zip(ends[0], end, strict=True)] for end in ends[1:])
    n = [x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]]
    up = sign * (sqrt(2.0 * apart) if near else sin(apart)) / hypot(*n)
    place = [p + a * u + b * v + up * w for p, u, v, w in zip(ends[0], x, y, n, strict=True)]
    rods = [dist(place, end) for end in ends]
    order = order_ends(tuple(place), ends)
    side = sign if order in ([0, 1, 2], [1, 2, 0], [2, 0, 1]) else -sign
    lengths = tuple(Rod(rods[end]) for end in order)
    step = ThreeDistances(tuple(end + 1 for end in order), lengths, float(side), 4)
    axis, tape = random.randrange(3), Tape()
    given = [tape.row(*each) for each in zip(*motion, strict=True)]
    point = three_spheres(given, tape.row(rods), sign)
    found = [state.pins[4][axis] for state in _states_after(step, *motion)]
    return Case(errors_of(point[axis], found), (step, axis, motion))


def rssr_case(random: Random) -> Case:
    """Return a random RSSR, a crank and a rocker about skew axes, in a random state."""
    links = {'crank': ('A',), 'rod': ('A', 'B'), 'rocker': ('B',)}
    while True:
        a, b, *joints = (_place(random, reach) for reach in (0.4, 1.0, 1.0, 0.1, 1.0, 1.0))
        hinges = {
            'crank': SpatialJoint('ground', 'crank', *joints[:2]),
            'rocker': SpatialJoint('ground', 'rocker', *joints[2:]),
        }
        linkage = SpaceLinkage({'A': a, 'B': b}, links, hinges, {}, {}, ('crank',), ('rocker',))
        state = [random.uniform(-1.0, 1.0) for _ in range(3)]
        try:
            closure = SpaceClosure(linkage)
        except LinkageError:
            continue  # It is drawn at a toggle.
        if closure.position(state[0]).status.has_rates:
            break
    tape = Tape()
    axis = _axis_on(tape, linkage, 'crank')
    pin = turned_about(tape.row(linkage.points['A']), *axis, tape.number(*state))
    (found,) = joint_orders(closure, *([number] for number in state))
    return Case(_held_errors(tape, closure, ('rocker', 'B', 'A'), pin, found), (linkage, state))


def _axis_on(tape: Tape, linkage: SpaceLinkage, hinge: str) -> tuple[Row, Row]:
    return tape.row(linkage.hinges[hinge].at), tape.row(linkage.hinges[hinge].axis)


def _held_errors(
    tape: Tape, closure: Any, names: Sequence[str], pin: Row, found: Sequence[float]
) -> list[float]:
    """Return the errors of a hinge, one of whose points a rod holds at a distance from a pin."""
    hinge, point, other = names
    places = closure.linkage.points
    # The length of the rod is a number of its own, which is rounded wherever it comes from. If κ
    # took it for a function of the ends, it would be 0 at the pose even next to a toggle.
    rod, axis = tape.distance(places[point], places[other]), _axis_on(tape, closure.linkage, hinge)
    place, drawn = tape.row(places[point]), tape.row(places[other])
    # In the pose the hinge is 0: this tells the assembly.
    sides = {sign: angle_to_meet(place, *axis, drawn, rod, sign) for sign in (1, -1)}
    sign = min(sides, key=lambda sign: abs(remainder(float(sides[sign].value[0]), tau)))
    angle = angle_to_meet(place, *axis, pin, rod, sign)
    return errors_of(angle, found, pi, pin)


_ANKLE = (('m1', 'b1', 'c1'), ('m2', 'b2', 'c2'))
"""Each motor with the points of its bar and of the foot."""


@cache
def _load_shipped(name: str) -> Any:
    return load(ROOT / 'config' / 'linkages' / 'space' / f'{name}.yaml')


def _ankle_in_a_state(random: Random, name: str, reach: float) -> tuple[Any, list[list[float]]]:
    closure = _load_shipped(name)
    while True:
        states = [[random.uniform(-most, most) for _ in range(2)] for most in (reach, 1.0, 1.0)]
        if closure.position(*states[0]).status.has_rates:
            return closure, states


def _feet(tape: Tape, linkage: SpaceLinkage, pitch: Series, roll: Series) -> list[Row]:
    """Return where the rods hold the foot."""
    first, second = (_axis_on(tape, linkage, name) for name in ('pitch', 'roll'))
    points = [tape.row(linkage.points[point]) for *_, point in _ANKLE]
    rolled = (turned_about(point, *second, roll) for point in points)
    return [turned_about(point, *first, pitch) for point in rolled]


def ankle_case(random: Random) -> Case:
    """Return the shipped ankle in a random state; each motor is a closed form of both joints."""
    closure, states = _ankle_in_a_state(random, 'ankle', 0.5)
    tape = Tape()
    joints = (tape.number(*motion) for motion in zip(*states, strict=True))
    pins = _feet(tape, closure.linkage, *joints)
    motors = zip(_ANKLE, pins, joint_orders(closure, *states), strict=True)
    return Case([*map(max, *(_held_errors(tape, closure, *each) for each in motors))], states)


def ankle_motors_case(random: Random) -> Case:
    """Return the shipped ankle from its motors: pitch and roll close only together."""
    closure, states = _ankle_in_a_state(random, 'ankle_motors', 0.6)
    linkage, found = closure.linkage, joint_orders(closure, *states)

    def gaps(joints: Row) -> Iterator[Series]:
        tape = joints[0].tape
        for (motor, bar, foot), pin, motion in zip(
            _ANKLE, _feet(tape, linkage, *joints), zip(*states, strict=True), strict=True
        ):
            axis, angle = _axis_on(tape, linkage, motor), tape.number(*motion)
            arm = less(pin, turned_about(tape.row(linkage.points[bar]), *axis, angle))
            rod = tape.distance(linkage.points[bar], linkage.points[foot])
            yield dot(arm, arm) - rod * rod

    pairs = zip(root_near(found, gaps), found, strict=True)
    return Case([*map(max, *(errors_of(*pair, floor=pi) for pair in pairs))], states)


def joint_orders(
    closure: Any, inputs: Sequence[float], rates: Sequence[float], changes: Sequence[float]
) -> list[tuple[float, float, float]]:
    """Return position, rate and acceleration of each published joint."""
    position = closure.position(*inputs)
    velocity = closure.velocity(position, *rates)
    acceleration = closure.acceleration(position, velocity, *changes)
    orders = position.joints, velocity.joints, acceleration.joints
    return [*zip(*orders, strict=True)]


FAMILIES: dict[str, Callable[[Random], Case]] = {
    'hinge and rod': hinge_case,
    'hinge and rod, near': partial(hinge_case, near=True),
    'slide and rod': slide_case,
    'slide and rod, near': partial(slide_case, near=True),
    'three distances': three_distances_case,
    'three distances, near': partial(three_distances_case, near=True),
    'RSSR': rssr_case,
    'ankle, joints to motors': ankle_case,
    'ankle, motors to joints': ankle_motors_case,
}
SLOWER = dict.fromkeys([*FAMILIES][6:], 10)
"""How many cases of a step take as long: a whole linkage is made, of several steps."""

_PART = 200
"""Number of cases in a part: up to a second's work."""


def draw_case(seed: int, family: str, number: int) -> Case:
    """Return a case of a family."""
    return FAMILIES[family](Random(f'{seed}/{family}/{number}'))


def judge_part(part: Part) -> Iterator[tuple[int, Judgement]]:
    """Compare the cases of a part with the reference."""
    errors = [draw_case(part.seed, part.family, number).errors for number in part.numbers]
    judged = Judgement(Counter(cases=part.size))
    for quantity, found in zip(QUANTITIES, zip(*errors, strict=True), strict=True):
        judged.errors[quantity] = [(case, 0, error) for case, error in enumerate(found)]
    yield part.first, judged


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of this campaign."""
    parser.add_argument('--cases', type=int, default=1_000_000, help='cases of each step')


def show(options: argparse.Namespace) -> None:
    """Print a case, named by FIRST:CASE."""
    family, place = options.show
    print(draw_case(options.seed, family, sum(map(int, place.split(':')))))


def run(options: argparse.Namespace) -> Findings:
    """Compare steps and linkages with the reference."""
    counts = {name: max(options.cases // SLOWER.get(name, 1), 1) for name in options.only}
    work = parts_of(options.seed, counts, _PART)
    tallies = tallies_of(judge_part, work, options.jobs, 'cases')['']
    table, above = accuracy_table(tallies), worst_table(tallies, LIMIT)
    rows = [(name, f'{counts[name]:,}', *cells) for name, *cells in table.rows]
    table = Table(table.title, ('family', 'cases', *table.head[1:]), [*rows])
    facts = [('cases', f'{sum(counts.values()):,}')]
    return Findings([table, above], [' '.join(row) for row in above.rows], facts)
