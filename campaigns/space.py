# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
``python -m campaigns.space``: errors of spatial linkages, step by step and as a whole.

Random steps, far from toggles and down to 1e-9 from one, and whole linkages are compared with
closed forms of 80 digits.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from datetime import datetime
from functools import cache, partial
from math import atan2, cos, dist, hypot, pi, sin, sqrt
from random import Random
import sys
from typing import Any, NamedTuple

from bench import ROOT
from bench.report import Table
from campaigns.campaign import exit_code, machine_of, Page, parser_of, progress_lines, publish
from campaigns.space_reference import (
    angle_to_meet,
    dot,
    errors_of,
    exact_distance,
    hinge_angle,
    less,
    moved,
    slide_length,
    three_spheres,
    turned_about,
)
from linkage_ros.description import load
from linkage_ros.errors import LinkageError
from linkage_ros.kinematics import SpaceClosure, SpaceLinkage, SpatialJoint, Status
from linkage_ros.kinematics.space.joints import HingePair, SlidePair
from linkage_ros.kinematics.space.steps import (
    ClosedHinge,
    ClosedSlide,
    GROUND_FRAME,
    LinkState,
    Rod,
    STILL,
    ThreeDistances,
)
from mpmath import mp

LIMIT = 4.0
"""In u·κ."""

PAGE = Page(
    ROOT / 'docs' / 'accuracy' / 'space.md',
    'How exact spatial linkages are',
    """
Made by `python -m campaigns.space --write`, a part of `make accuracy`.

Errors are given in units of u·κ, as in [campaign.md](campaign.md). For a step κ goes over all that
it starts from: places, distances, velocities and accelerations. For a linkage it goes over all
places and axes, the length of each rod, which is a number of its own, the inputs, their rates and
their accelerations, and as in the plane over the point that a step passes to the next one, with
its velocity and acceleration, each with its own κ; a published angle counts as π at least. The
reference has 80 digits; its rates and accelerations are differences along the motion. *near*: 1e-9
to 1e-3 from a toggle. The limit is 4.
""",
)

ORDERS = ('position', 'rate', 'acceleration')


class Case(NamedTuple):
    """A case: its greatest errors in position, rate and acceleration, and what it was."""

    errors: Sequence[float]
    given: object


def _place(random: Random) -> list[float]:
    return [random.uniform(-1.0, 1.0) for _ in range(3)]


def _vector(place: Sequence[float]) -> tuple[float, float, float]:
    x, y, z = place
    return x, y, z


def _three(numbers: Sequence[Any], first: int) -> list[Any]:
    end = first + 3
    return [*numbers[first:end]]


def _distance(random: Random, near: bool) -> float:
    """Return a distance from a toggle: of angles, or of a length relative to it."""
    return 10.0 ** random.uniform(-9.0, -3.0) if near else random.uniform(0.05, pi - 0.05)


def _states_after(
    step: Any, ends: Sequence[Any], velocities: Sequence[Any], changes: Sequence[Any]
) -> tuple[LinkState, ...]:
    """Return the three states after a step that starts from points."""
    solved = LinkState([0.0], [GROUND_FRAME, *map(tuple, ends)])
    rates = LinkState([0.0], [STILL, *map(tuple, velocities)])
    accelerations = LinkState([0.0], [STILL, *map(tuple, changes)])
    pose = step.close(solved)
    assert pose.status is Status.CLOSED, step
    step.accelerations(pose, step.rates(pose, solved, rates), solved, rates, accelerations)
    return solved, rates, accelerations


def hinge_case(random: Random, near: bool = False) -> Case:
    """Return a hinge closed by a rod."""
    place, to, velocity, change = (_place(random) for _ in range(4))
    sign = random.choice((-1, 1))
    r, d, height = hypot(*place[:2]), hypot(*to[:2]), to[2] - place[2]
    apart = _distance(random, near)
    if near:
        low, high = hypot(height, d - r), hypot(height, d + r)
        rod = random.choice((low * (1.0 + apart), high * (1.0 - apart)))
    else:
        rod = sqrt(d * d + r * r - 2.0 * r * d * cos(apart) + height * height)
    direction = atan2(place[1], place[0])
    pair = HingePair(0, GROUND_FRAME)
    step: Any = ClosedHinge(pair, _vector(place), 1, Rod(rod), float(sign), 2, r, direction)
    found = [one.coordinates[1] for one in _states_after(step, [to], [velocity], [change])]
    errors = errors_of(
        lambda n, t: hinge_angle(n[:3], moved(n[3:6], n[7:10], n[10:], t), n[6], sign),
        [*place, *to, rod, *velocity, *change],
        found,
        floor=0,
    )
    return Case(errors, (sign, place, to, rod))


def slide_case(random: Random, near: bool = False) -> Case:
    """Return a slide closed by a rod."""
    place, to, velocity, change = (_place(random) for _ in range(4))
    sign = random.choice((-1, 1))
    rod = hypot(to[0] - place[0], to[1] - place[1]) * (1.0 + _distance(random, near))
    pair = SlidePair(0, GROUND_FRAME)
    step = ClosedSlide(pair, _vector(place), 1, Rod(rod), float(sign), 2)
    found = [one.coordinates[1] for one in _states_after(step, [to], [velocity], [change])]
    errors = errors_of(
        lambda n, t: slide_length(n[:3], moved(n[3:6], n[7:10], n[10:], t), n[6], sign),
        [*place, *to, rod, *velocity, *change],
        found,
    )
    return Case(errors, (sign, place, to, rod))


def three_distances_case(random: Random, near: bool = False) -> Case:
    """Return a coordinate of a point above the plane of three others, near it for a toggle."""
    ends, velocities, changes = ([_place(random) for _ in range(3)] for _ in range(3))
    sign, apart = random.choice((-1, 1)), _distance(random, near)
    a, b = random.uniform(-1.0, 1.5), random.uniform(-1.0, 1.5)
    x, y = ([q - p for p, q in zip(ends[0], end, strict=True)] for end in ends[1:])
    n = [x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]]
    up = sign * (sqrt(2.0 * apart) if near else sin(apart)) / hypot(*n)
    place = [p + a * u + b * v + up * w for p, u, v, w in zip(ends[0], x, y, n, strict=True)]
    rods = [dist(place, end) for end in ends]
    step = ThreeDistances((1, 2, 3), tuple(map(Rod, rods)), float(sign), 4)
    states = _states_after(step, ends, velocities, changes)
    flat = [n for rows in (ends, [rods], velocities, changes) for row in rows for n in row]
    axis = random.randrange(3)

    def coordinate(n: Sequence[Any], t: Any) -> Any:
        parts = ([_three(n, first + k) for k in (0, 3, 6)] for first in (0, 12, 21))
        now = [moved(*each, t) for each in zip(*parts, strict=True)]
        return three_spheres(now, n[9:12], sign)[axis]

    errors = errors_of(coordinate, flat, [state.pins[4][axis] for state in states])
    return Case(errors, (sign, axis, ends, rods))


def random_rssr(random: Random) -> SpaceLinkage:
    """Return a crank and a rocker about skew axes, with a rod between them."""

    def vector(reach: float = 1.0) -> Any:
        return tuple(random.uniform(-reach, reach) for _ in range(3))

    return SpaceLinkage(
        points={'A': vector(0.4), 'B': vector()},
        links={'crank': ('A',), 'rod': ('A', 'B'), 'rocker': ('B',)},
        hinges={
            'crank': SpatialJoint('ground', 'crank', vector(), vector(0.1)),
            'rocker': SpatialJoint('ground', 'rocker', vector(), vector()),
        },
        slides={},
        struts={},
        driven=('crank',),
        published=('rocker',),
    )


def rssr_case(random: Random) -> Case:
    """Return a random RSSR in a random state."""
    while True:
        linkage = random_rssr(random)
        state = [random.uniform(-1.0, 1.0) for _ in range(3)]
        try:
            closure = SpaceClosure(linkage)
        except LinkageError:
            continue  # It is drawn at a toggle.
        if closure.position(state[0]).status.has_rates:
            break
    crank, rocker = linkage.hinges.values()
    places = (*linkage.points.values(), crank.at, crank.axis, rocker.at, rocker.axis)
    sign = sign_of(closure, 'rocker')

    def pin(numbers: Sequence[Any], t: Any) -> Any:
        q, w, change = numbers[19:]
        a, at, axis = (_three(numbers, 3 * k) for k in (0, 2, 3))
        return turned_about(a, at, axis, q + w * t + change * t * t / 2)

    def angle(numbers: Sequence[Any], now: Any) -> Any:
        b, at, axis = (_three(numbers, 3 * k) for k in (1, 4, 5))
        return angle_to_meet(b, at, axis, now, numbers[18], sign)

    # The length of the rod is a number of its own, which is rounded wherever it comes from. If κ
    # took it for a function of the ends, it would be 0 at the pose even next to a toggle.
    numbers = [*(n for place in places for n in place), exact_distance(*places[:2]), *state]
    (found,) = joint_orders(closure, *([number] for number in state))
    return Case(errors_of(angle, numbers, found, pi, pin), (linkage, state))


_ANKLE = {'m1': ('b1', 'c1'), 'm2': ('b2', 'c2')}
"""For each motor the points of its bar and of the foot."""


@cache
def _load_shipped(name: str) -> Any:
    return load(ROOT / 'config' / 'linkages' / 'space' / f'{name}.yaml')


def ankle_case(random: Random) -> Case:
    """Return the shipped ankle in a random state; each motor is a closed form of both joints."""
    closure = _load_shipped('ankle')
    linkage: SpaceLinkage = closure.linkage
    while True:
        states = [[random.uniform(-reach, reach) for _ in range(2)] for reach in (0.5, 1.0, 1.0)]
        if closure.position(*states[0]).status.has_rates:
            break
    errors = []
    for motor, orders in zip(_ANKLE, joint_orders(closure, *states), strict=True):
        bar, foot = _ANKLE[motor]
        hinges = [linkage.hinges[name] for name in ('pitch', 'roll', motor)]
        places = [linkage.points[bar], linkage.points[foot]]
        places += [part for hinge in hinges for part in (hinge.at, hinge.axis)]
        sign = sign_of(closure, motor)

        def pin(numbers: Sequence[Any], t: Any) -> Any:
            c, at1, axis1, at2, axis2 = (_three(numbers, 3 * n) for n in range(1, 6))
            pitch, roll = moved(numbers[25:27], numbers[27:29], numbers[29:], t)
            return turned_about(turned_about(c, at2, axis2, roll), at1, axis1, pitch)

        def angle(numbers: Sequence[Any], now: Any, sign: int = sign) -> Any:
            b, at, axis = (_three(numbers, 3 * n) for n in (0, 6, 7))
            return angle_to_meet(b, at, axis, now, numbers[24], sign)

        rod = exact_distance(*places[:2])
        numbers = [*(n for place in places for n in place), rod]
        numbers += [part for state in states for part in state]
        errors.append(errors_of(angle, numbers, orders, pi, pin))
    return Case([max(each) for each in zip(*errors, strict=True)], states)


def ankle_motors_case(random: Random) -> Case:
    """Return the shipped ankle from its motors: pitch and roll close only together."""
    closure = _load_shipped('ankle_motors')
    linkage: SpaceLinkage = closure.linkage
    while True:
        states = [[random.uniform(-reach, reach) for _ in range(2)] for reach in (0.6, 1.0, 1.0)]
        position = closure.position(*states[0])
        if position.status.has_rates:
            break
    ends = list(_ANKLE.values())
    hinges = [linkage.hinges[name] for name in ('pitch', 'roll', *_ANKLE)]
    places = [linkage.points[point] for pair in ends for point in pair]
    rods = [exact_distance(*(linkage.points[point] for point in pair)) for pair in ends]
    places += [part for hinge in hinges for part in (hinge.at, hinge.axis)]
    numbers = [*(n for place in places for n in place), *rods]
    numbers += [part for state in states for part in state]

    @cache
    def angles(given: tuple[Any, ...], t: Any) -> Any:
        points = [_three(given, 3 * n) for n in range(4)]
        joints = [(_three(given, 12 + 6 * n), _three(given, 15 + 6 * n)) for n in range(4)]
        motors = [given[38 + n] + given[40 + n] * t + given[42 + n] * t * t / 2 for n in range(2)]

        def gaps(pitch: Any, roll: Any) -> list[Any]:
            found = []
            for n in range(2):
                bar = turned_about(points[2 * n], *joints[2 + n], motors[n])
                foot = turned_about(points[2 * n + 1], *joints[1], roll)
                arm = less(turned_about(foot, *joints[0], pitch), bar)
                found.append(dot(arm, arm) - given[36 + n] ** 2)
            return found

        return mp.findroot(gaps, position.joints)

    errors = [
        errors_of(lambda given, t, k=k: angles(tuple(given), t)[k], numbers, orders, floor=pi)
        for k, orders in enumerate(joint_orders(closure, *states))
    ]
    return Case([max(each) for each in zip(*errors, strict=True)], states)


def joint_orders(
    closure: Any, inputs: Sequence[float], rates: Sequence[float], changes: Sequence[float]
) -> list[tuple[float, float, float]]:
    """Return position, rate and acceleration of each published joint."""
    position = closure.position(*inputs)
    velocity = closure.velocity(position, *rates)
    acceleration = closure.acceleration(position, velocity, *changes)
    orders = position.joints, velocity.joints, acceleration.joints
    return [*zip(*orders, strict=True)]


def sign_of(closure: Any, joint: str) -> int:
    """Return the sign of the step that closes a joint, as the check of a file names it."""
    (group,) = (one for one in closure.groups if one.method.startswith(f'{joint},'))
    return 1 if group.assembly.startswith('+') else -1


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
SLOWER = {'ankle, motors to joints': 10}
"""How many cases of others take as long: the reference is Newton's method with 80 digits."""


def main() -> int:
    """Run the campaign, and return the exit code."""
    begin = datetime.now().astimezone()
    parser = parser_of('space', __doc__, page=PAGE, jobs=1)
    parser.add_argument('--cases', type=int, default=2000, help='cases of each family')
    arguments = parser.parse_args()
    table = Table('Worst errors, in u·κ', ('family', 'cases', *ORDERS))
    counts = {name: max(arguments.cases // SLOWER.get(name, 1), 1) for name in FAMILIES}
    advance = progress_lines(sum(counts.values()), 'cases')
    worst = 0.0
    for name, draw in FAMILIES.items():
        random = Random(f'{arguments.seed} {name}')
        greatest = [0.0, 0.0, 0.0]
        for _ in range(counts[name]):
            greatest = [*map(max, greatest, draw(random).errors)]
            advance(1)
        worst = max(worst, *greatest)
        table.rows.append((name, f'{counts[name]:,}', *(f'{one:.2f}' for one in greatest)))
    machine: Any = machine_of(begin, arguments, 'cases', sum(counts.values()))
    publish([table, machine], PAGE if arguments.write else None)
    return int(not worst <= LIMIT)


if __name__ == '__main__':
    sys.exit(exit_code(main))
