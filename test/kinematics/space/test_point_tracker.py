# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""Points and turns of links in space, against differences of points and frames by time."""

from random import Random
import struct

from linkage_ros.kinematics.compiling import Compiled
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from .test_linkages import closure_of, NAMES, states_of

WEIGHTS = (1.0 / 90.0, -3.0 / 20.0, 1.5, -49.0 / 18.0, 1.5, -3.0 / 20.0, 1.0 / 90.0)
"""Of the second derivative at seven places: the error falls as the sixth power of the step."""

SLOPES = (-1.0 / 60.0, 3.0 / 20.0, -0.75, 0.0, 0.75, -3.0 / 20.0, 1.0 / 60.0)
"""Of the first one."""

STEP = 2e-3


def points_of(closure):
    """Return a point of each link: on the axis of a rod that may spin, elsewhere of others."""
    random, places = Random(closure.name), closure.linkage.points
    for link in closure.linkage.link_names:
        if link in closure.idle:
            one, other = (np.array(places[end]) for end in closure.linkage.links[link][:2])
            yield link, tuple(one + random.random() * (other - one))
        else:
            yield link, tuple(closure.scale * random.uniform(-1.0, 1.0) for _ in range(3))


def by_frames(closure, points, position):
    """Return places of points, and the rotations of links, by `frames` and `points` alone."""
    linkage = closure.linkage
    drawn = closure.frames(closure.position(*linkage.pose.inputs))
    frames, known = closure.frames(position), closure.points(position)
    places, turns = [], []
    for link, place in points:
        origin, turn = frames[link][0], Rotation.from_quat(frames[link][1]).as_matrix()
        if link in closure.idle:
            one, other, *_ = linkage.links[link]
            start, along = np.array(linkage.points[one]), np.subtract(
                linkage.points[other], linkage.points[one]
            )  # fmt: skip
            share = (np.array(place) - start) @ along / (along @ along)
            places.append((1.0 - share) * np.array(known[one]) + share * np.array(known[other]))
        else:
            places.append(origin + turn @ (np.array(place) - drawn[link][0]))
        turns.append(turn)
    return np.array(places), np.array(turns)


@pytest.mark.sample(5)
@pytest.mark.parametrize('name', NAMES)
def test_point_velocities_and_accelerations_equal_numerical_derivatives(name):
    closure = closure_of(name)
    points = list(points_of(closure))
    links = [link for link, _ in points if link not in closure.idle]
    tracker = closure.point_tracker(points, links)
    framed = [number for number, (link, _) in enumerate(points) if link in links]
    for inputs, rates, changes in states_of(closure, 3, 0.2):
        q, w, a = map(np.array, (inputs, rates, changes))
        position = closure.position(*inputs)
        velocity = closure.velocity(position, *rates)
        acceleration = closure.acceleration(position, velocity, *changes)
        track = [
            by_frames(closure, points, closure.position(*(q + w * t + 0.5 * a * t * t)))
            for t in STEP * np.arange(-3, 4)
        ]
        places, turns = (np.array(part) for part in zip(*track, strict=True))
        now = tracker.places(position)
        assert now == pytest.approx(places[3], abs=1e-13 * closure.scale)
        found = tracker.velocities(position, velocity, now)
        slopes = np.tensordot(SLOPES, places, 1) / STEP
        size = 1.0 + np.abs(slopes).max()
        assert found == pytest.approx(slopes, abs=1e-8 * size)
        found = tracker.accelerations(position, velocity, acceleration, now)
        bends = np.tensordot(WEIGHTS, places, 1) / STEP**2
        assert found == pytest.approx(bends, abs=1e-6 * (size + np.abs(bends).max()))
        # Rᵀ·Ṙ is the spin in the axes of the link, which lie in its own way in the pose.
        spins = np.array([closure._plan.pose_frames[link][:3] for link in links])
        slopes, bends = (np.tensordot(of, turns, 1) for of in (SLOPES, WEIGHTS))
        found = tracker.turn_rates(position, velocity)
        more = tracker.turn_changes(position, velocity, acceleration)
        for axes, number, spin, change in zip(spins, framed, found, more, strict=True):
            turn = turns[3][number]
            own = turn.T @ slopes[number] / STEP
            expected = axes @ (own[2, 1], own[0, 2], own[1, 0])
            assert spin == pytest.approx(expected, abs=1e-7)
            own = turn.T @ bends[number] / STEP**2
            expected = 0.5 * axes @ (own[2, 1] - own[1, 2], own[0, 2] - own[2, 0], own[1, 0] - own[0, 1])  # fmt: skip # noqa: E501
            assert change == pytest.approx(expected, abs=1e-5)


@pytest.mark.parametrize('name', ['rssr', 'delta'])
def test_rod_turn_rate_equals_its_relative_end_velocity(name):
    closure = closure_of(name)
    places = closure.linkage.points
    rods = {link: closure.linkage.links[link][:2] for link in closure.idle}
    assert rods
    ends = [(link, places[end]) for link, both in rods.items() for end in both]
    tracker = closure.point_tracker(ends, list(rods))
    for inputs, rates, changes in states_of(closure, 3):
        position = closure.position(*inputs)
        velocity = closure.velocity(position, *rates)
        acceleration = closure.acceleration(position, velocity, *changes)
        for ends_move, turns in (
            (tracker.velocities(position, velocity), tracker.turn_rates(position, velocity)),
            (
                tracker.accelerations(position, velocity, acceleration),
                tracker.turn_changes(position, velocity, acceleration),
            ),
        ):
            apart = np.array(ends_move[1::2]) - ends_move[::2]
            assert turns == pytest.approx(apart, abs=1e-12)


@pytest.mark.parametrize('name', ['rssr', 'delta', 'ankle', 'ankle_motors', 'wishbone'])
def test_compiled_point_motion_equals_the_interpreted_one(name):
    closure = closure_of(name)
    points = list(points_of(closure))
    tracker = closure.point_tracker(points, [link for link, _ in points])

    def wanted(motion):
        position, velocity, acceleration = motion
        if velocity is None:
            return []
        lists = (
            tracker.places(position),
            tracker.velocities(position, velocity),
            tracker.accelerations(position, velocity, acceleration),
            tracker.turn_rates(position, velocity),
            tracker.turn_changes(position, velocity, acceleration),
        )
        # Adding 0.0 makes 0.0 of −0.0: numbers that are 0 are left out of sums, symbols are not.
        return [[part + 0.0 for vector in of for part in vector] for of in lists]

    joints, compiled = Compiled(closure, 2), Compiled(closure, 2, wanted)
    traced = 0
    for state in states_of(closure, 8):
        numbers = [number for part in state for number in part]
        fast, slow = compiled.fast(*numbers), compiled.run_interpreted(*numbers)
        # The points take the path of the joints, and decide nothing.
        assert (fast is None) is (joints.fast(*numbers) is None)
        if fast is not None:
            traced += 1
            assert _bits(fast) == _bits(slow.values)
    assert traced > 4


def _bits(groups):
    return [struct.pack(f'{len(group)}d', *group) for group in groups]
