# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Random platforms on three legs, and their branches by a fine walk over equations written apart.

A platform's place p and angle φ are the unknowns, three numbers and not twelve. A leg is an arm of
length l from an anchor A to the platform's point P = p + e^{iφ}·q, or a line through A along D on
which that lies::

    |P − A|² = l²        Im((P − A)·conj D) = 0

Of the first leg A moves with the input x, as A₀ + Σ e^{iwx}·a or as A₀ + x·a, and D turns with a
crank. The curve in (p, φ, x) is walked by its length, 1/250 of a radian or of a length at a time,
all platforms side by side, until x turns back or after some turns.
"""

from cmath import phase, rect
from collections.abc import Callable
from itertools import pairwise
from math import tau
import random
from typing import Any, NamedTuple

from linkage_ros.kinematics import AssemblyPose, Input, Linkage, Point, RevoluteJoint, Slider
import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
STEP = 1.0 / 250.0
_ANGLE, _X = 2, 3


class Leg(NamedTuple):
    """
    A leg; ``length`` is 0 where it is a line along ``direction``.

    ``reach`` turns with the input, or is what it slides along; ``more`` turns ``more_rate`` times
    as fast as the input, ``reach`` ``rate`` times.
    """

    anchor: complex
    reach: complex
    length: float
    direction: complex
    point: complex
    more: complex = 0j
    rate: float = 1.0
    more_rate: float = 0.0


class Platform(NamedTuple):
    """A platform in the pose (p, φ, x), whose input is a crank or a slide."""

    legs: tuple[Leg, Leg, Leg]
    pose: tuple[complex, float, float]
    turning: bool


def platform(rng: random.Random, *, turning: bool = True, lines: int = 0) -> Platform:
    """Return a random platform: of its legs the last ones are lines, the first one if three."""

    def place() -> complex:
        return complex(rng.uniform(-1.0, 1.0), rng.uniform(-1.0, 1.0))

    p, angle, x = place(), rng.uniform(-3.0, 3.0), rng.uniform(-3.0, 3.0)
    if not turning:
        x *= 0.1
    legs = []
    for index in range(3):
        anchor, there = 2.0 * place(), p + place()
        moved = place() if index == 0 else 0j
        if not turning and index == 0:
            moved /= abs(moved)
        point = (there - p) * rect(1.0, -angle)
        now = anchor + moved * (rect(1.0, x) if turning else x)
        if index == 0 and lines == 3:
            # A slot of the crank, through its pivot.
            direction = (there - anchor) * rect(1.0, -x if turning else 0.0)
            legs.append(Leg(anchor, 0j, 0.0, direction / abs(direction), point))
        elif index >= 3 - min(lines, 2):
            direction = there - anchor
            legs.append(Leg(anchor, 0j, 0.0, direction / abs(direction), point))
        else:
            legs.append(Leg(anchor, moved, abs(there - now), 0j, point))
    return Platform((legs[0], legs[1], legs[2]), (p, angle, x), turning)


def linkage_of(made: Platform, rng: random.Random) -> Linkage:
    """Return the linkage, its links in frames of their own."""
    p, angle, x = made.pose
    spots = [p + rect(1.0, angle) * leg.point for leg in made.legs]
    links: dict[str, dict[str, Point]] = {'ground': {}, 'driver': {}, 'platform': {}}
    sliders: dict[str, Slider] = {}

    def own(places: dict[str, complex], turn: float, origin: complex) -> dict[str, Point]:
        frame = rect(1.0, -turn)
        return {
            name: (((z - origin) * frame).real, ((z - origin) * frame).imag)
            for name, z in places.items()
        }

    ground = {'O': made.legs[0].anchor}
    driver = {'O': 0j}
    for index, leg in enumerate(made.legs):
        name = f'P{index}'
        if leg.length and index == 0:
            driver['A0'] = leg.reach if made.turning else 0j
        elif leg.length:
            ground[f'A{index}'] = leg.anchor
        elif index:
            ground[f'A{index}'] = leg.anchor
            way = (leg.direction.real, leg.direction.imag)
            sliders[f'line_{index}'] = Slider(name, 'ground', f'A{index}', way)
        else:
            way = (leg.direction.real, leg.direction.imag)
            sliders['line_0'] = Slider(name, 'driver', 'O', way)
        if leg.length:
            end = leg.anchor
            if index == 0:
                end += leg.reach * (rect(1.0, x) if made.turning else x)
            turn = rng.uniform(-3.0, 3.0)
            links[f'arm_{index}'] = own(
                {f'A{index}': end, name: spots[index]}, turn, spots[index] + 0.3
            )
    joints = {name: RevoluteJoint('ground', name) for name in ('platform', *list(links)[3:])}
    links['ground'] = own(ground, 0.0, 0j)
    if made.turning:
        links['driver'] = own(driver, 0.0, 0j)
        given = Input('crank', 'ground', 'driver')
    else:
        way = (made.legs[0].reach.real, made.legs[0].reach.imag)
        links['driver'] = {'A0': (0.0, 0.0), 'D': (0.0, 0.1)}
        sliders['drive'] = Slider('A0', 'ground', 'O', way, block='driver')
        given = Input('crank', slider='drive')
    links['platform'] = {
        f'P{index}': (leg.point.real, leg.point.imag) for index, leg in enumerate(made.legs)
    }
    return Linkage(
        links=links,
        inputs=(given,),
        assembly={},
        joints=joints,
        sliders=sliders,
        pose=AssemblyPose((x,), {f'P{index}': (z.real, z.imag) for index, z in enumerate(spots)}),
    )


class Walked(NamedTuple):
    """A walk to one side: (p, φ, x) at each step as rows (4,), and x at its end if it has one."""

    states: Array
    end: float | None


def residuals(made: Platform, p: complex, angle: float, x: float) -> list[float]:
    """Return what the three legs are off by, in lengths."""
    found = []
    for leg in made.legs:
        spot = p + rect(1.0, angle) * leg.point
        moved = leg.reach * (rect(1.0, leg.rate * x) if made.turning else x)
        moved += leg.more * rect(1.0, leg.more_rate * x)
        if leg.length:
            found.append(abs(spot - leg.anchor - moved) - leg.length)
        else:
            first = leg is made.legs[0] and made.turning
            way = leg.direction * (rect(1.0, x) if first else 1.0)
            found.append(((spot - leg.anchor) * way.conjugate()).imag)
    return found


def walks(
    made: list[Platform], signs: list[float], turns: float = 1.5, most: int = 12000
) -> list[Walked]:
    """Walk each platform to a side, until x turns back or has gone so far from the pose."""
    fields = [
        np.array([[getattr(leg, name) for leg in one.legs] for one in made])
        for name in Leg._fields
    ]
    anchor, reach, length, direction, point, more, rate, more_rate = fields
    sign = np.array(signs)
    turning = np.array([one.turning for one in made])
    state = np.array([(p.real, p.imag, angle, x) for one in made for p, angle, x in [one.pose]])
    first = state[:, _X].copy()
    turning_legs = turning[:, None] & (np.arange(3) == 0)

    def system(z: Array) -> tuple[Array, Array]:
        x = z[:, _X, None]
        arm = np.exp(1j * z[:, _ANGLE, None]) * point
        spot = z[:, 0, None] + 1j * z[:, 1, None] + arm
        crank, other = np.exp(1j * rate * x), np.exp(1j * more_rate * x)
        at = anchor + reach * np.where(turning[:, None], crank, x) + more * other
        slope = reach * np.where(turning[:, None], 1j * rate * crank, 1.0)
        slope = slope + 1j * more_rate * more * other
        between = spot - at
        way = direction * np.where(turning_legs, crank, 1.0)
        along = np.conj(np.where(length > 0.0, between, 1j * way))
        error = np.where(
            length > 0.0, 0.5 * (np.abs(between) ** 2 - length**2), (along * between).real
        )
        by_x = -(along * slope).real
        # Im(b·conj(e^{ix}·d)) changes with x by −Re(b·conj(e^{ix}·d)).
        by_x = np.where((length == 0.0) & turning_legs, -(np.conj(way) * between).real, by_x)
        rows = np.stack([along.real, -along.imag, (along * 1j * arm).real, by_x], axis=2)
        return error, rows

    def tangent(z: Array, ahead: Array) -> Array:
        rows = np.concatenate([system(z)[1], ahead[:, None, :]], axis=1)
        right = np.zeros((len(z), 4, 1))
        right[:, 3] = 1.0
        found = np.linalg.solve(rows, right)[:, :, 0]
        return found / np.linalg.norm(found, axis=1)[:, None]

    def corrected(start: Array, ahead: Array) -> Array:
        z = start
        for _ in range(2):
            error, slopes = system(z)
            rows = np.concatenate([slopes, ahead[:, None, :]], axis=1)
            off = np.sum(ahead * (z - start), axis=1)[:, None]
            right = -np.concatenate([error, off], axis=1)[:, :, None]
            z = z + np.linalg.solve(rows, right)[:, :, 0]
        return z

    _, slopes = system(state)
    ahead = np.linalg.svd(slopes)[2][:, -1, :]
    ahead = ahead * (sign * np.sign(ahead[:, _X]))[:, None]
    done: list[Walked | None] = [None] * len(made)
    rows = [state]
    for _ in range(most):
        new = corrected(state + STEP * ahead, ahead)
        after = tangent(new, ahead)
        turned = np.sum(after * ahead, axis=1)
        assert (turned > 0.9).all(), 'the walk is too coarse'
        back = sign * after[:, _X] <= 0.0
        far = np.abs(new[:, _X] - first) > turns * tau
        for k in np.flatnonzero(back | far).tolist():
            if done[k] is None:
                end = None
                if back[k]:
                    low, high = 0.0, STEP
                    for _ in range(40):
                        middle = 0.5 * (low + high)
                        there = corrected(state + middle * ahead, ahead)
                        on = sign[k] * tangent(there, ahead)[k, _X] > 0.0
                        low, high = (middle, high) if on else (low, middle)
                        end = float(there[k, _X])
                done[k] = Walked(np.array([row[k] for row in rows]), end)
        if all(one is not None for one in done):
            break
        state, ahead = new, after
        rows.append(state)
    # Of a line that gets parallel to another, the platform goes away for ever.
    return [one or Walked(np.array([row[k] for row in rows]), None) for k, one in enumerate(done)]


def platform_of(linkage: Linkage, size: float) -> Platform:
    """Return a platform (L2) on a crank (L1) and two arms, its lengths divided by a size."""
    points = {
        link: {name: complex(*point) / size for name, point in given.items()}
        for link, given in linkage.links.items()
    }
    ground, crank, plate = points['ground'], points['L1'], points['L2']
    arms = [points[name] for name in ('L3', 'L4', 'L5')]
    lengths = [abs(complex(*np.diff(list(arm.values())))) for arm in arms]
    assert linkage.pose is not None
    at = {name: complex(*point) / size for name, point in linkage.pose.points.items()}
    angle = phase((at['P5'] - at['P3']) / (plate['P5'] - plate['P3']))
    place = at['P3'] - rect(1.0, angle) * plate['P3']
    legs = (
        Leg(ground['P1'], crank['P2'] - crank['P1'], lengths[0], 0j, plate['P3']),
        Leg(ground['P4'], 0j, lengths[1], 0j, plate['P5']),
        Leg(ground['P6'], 0j, lengths[2], 0j, plate['P7']),
    )
    return Platform(legs, (place, angle, linkage.pose.inputs[0]), True)


def everything(made: Platform, x: float) -> list[tuple[complex, float]]:
    """
    Return all (p, φ) of a platform whose last two legs are arms, by going through all angles.

    To an angle φ the last two legs leave two places p; where the first leg fits, too, there is a
    pose. Poses that are nearer to each other than 1/20000 of a turn are missed.
    """
    others = made.legs[1:]

    def places(angle: float) -> list[complex]:
        turned = rect(1.0, angle)
        one, other = (leg.anchor - turned * leg.point for leg in others)
        apart = other - one
        a, b = others[0].length, others[1].length
        along = (a * a - b * b + abs(apart) ** 2) / (2.0 * abs(apart))
        square = a * a - along * along
        if square < 0.0:
            return []
        up = complex(along, square**0.5), complex(along, -(square**0.5))
        return [one + each * apart / abs(apart) for each in up]

    def off(angle: float, side: int) -> float | None:
        found = places(angle)
        return residuals(made, found[side], angle, x)[0] if found else None

    def halved(low: float, high: float, keeps: Callable[[float], bool]) -> float:
        """Return the last angle from the low one on at which something is so."""
        for _ in range(60):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if keeps(middle) else (low, middle)
        return low

    def same_sign(side: int, value: float) -> Callable[[float], bool]:
        return lambda angle: (off(angle, side) or 0.0) * value > 0.0

    angles = [tau * k / 20000 for k in range(20001)]
    reached = [bool(places(angle)) for angle in angles]
    # The ends of where the two legs reach, too: next to them are the toggles of the two.
    for k, (one, other) in enumerate(pairwise(reached)):
        if one != other:
            inside, outside = (angles[k], angles[k + 1]) if one else (angles[k + 1], angles[k])
            angles.append(halved(inside, outside, lambda angle: bool(places(angle))))
    angles.sort()
    poses = []
    for side in (0, 1):
        values = [off(angle, side) for angle in angles]
        for k, (low, high) in enumerate(pairwise(values)):
            if low is None or high is None or low * high > 0.0:
                continue
            found = halved(angles[k], angles[k + 1], same_sign(side, low))
            poses.append((places(found)[side], found))
    return poses
