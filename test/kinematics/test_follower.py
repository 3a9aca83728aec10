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
Followed points: each lies where its link carries it, and its rates are the slopes of its places.

Places are held against those of two named points of the link, which the closure places by steps of
their own; velocities and accelerations against differences of the places.
"""

from __future__ import annotations

from cmath import rect

from linkage_ros.kinematics.closure import Closure
from linkage_ros.scene.linkage_file import read_linkage
from linkage_ros.scene.yaml_file import read_yaml
import pytest

from .test_gallery import FOLDER

# The values of the inputs: at all of them every loop closes, away from toggles.
INPUTS = {
    'four_bar': (0.7,),
    'slider_crank': (2.5,),
    'excavator_bucket': (1.05,),
    'scotch_yoke': (2.0,),
    'inverted_slider_crank': (1.7,),
    'elliptic_trammel': (0.05,),
    'whitworth_quick_return': (2.0,),
    'class_3': (1.5,),
    'windscreen_wiper': (0.4,),
    'five_bar': (1.2, 1.9),
}
OFF = 0.03 - 0.05j
"""From the first point of a link to one that has no name, in the link's frame."""


@pytest.fixture(params=INPUTS)
def case(request):
    closure = Closure(read_linkage(read_yaml(FOLDER / f'{request.param}.yaml')[0]))
    names = [(link, name) for link, points in closure.structure.links.items() for name in points]
    frames = {
        link: complex(*next(iter(p.values()))) for link, p in closure.structure.links.items()
    }
    points = [(k, complex(*closure.structure.links[k][name])) for k, name in names]
    points += [(link, first + OFF) for link, first in frames.items()]
    return closure, INPUTS[request.param], names, points


def test_they_lie_where_their_links_carry_them(case):
    closure, inputs, names, points = case
    position = closure.position(*inputs)
    follower = closure.follower(points)
    places = follower.places(position)
    expected, angles = closure.points(position), closure.link_angles(position)
    wanted = [expected[name] for name in names]
    for link, carried in closure.structure.links.items():
        wanted.append(expected[link, next(iter(carried))] + rect(1.0, angles[link]) * OFF)
    for index, place in zip(follower.indices, wanted, strict=True):
        assert places[index] == pytest.approx(place, rel=1e-14, abs=1e-15)


def test_rates_are_slopes_of_places(case):
    closure, inputs, _, points = case
    follower, step = closure.follower(points), 1e-4
    rates, pulls = [0.9, -0.6][: len(inputs)], [0.4, 1.1][: len(inputs)]

    def at(t):
        moved = [q + v * t + 0.5 * a * t * t for q, v, a in zip(inputs, rates, pulls, strict=True)]
        return follower.places(closure.position(*moved))

    position = closure.position(*inputs)
    velocity = closure.velocity(position, *rates)
    acceleration = closure.acceleration(position, velocity, *pulls)
    places = follower.places(position)
    speeds = follower.velocities(position, velocity, places)
    changes = follower.accelerations(position, velocity, acceleration, places)
    before, after = at(-step), at(step)
    assert set(follower.indices) <= set(range(len(places)))
    for i in follower.indices:
        assert speeds[i] == pytest.approx((after[i] - before[i]) / (2 * step), abs=1e-6)
        bend = (after[i] - 2 * places[i] + before[i]) / step**2
        assert changes[i] == pytest.approx(bend, rel=1e-5, abs=1e-5)


def test_what_is_asked_twice_is_walked_once():
    closure = Closure(read_linkage(read_yaml(FOLDER / 'four_bar.yaml')[0]))
    follower = closure.follower([('coupler', 0.06 + 0j)] * 3)
    assert len(set(follower.indices)) == 1


def test_the_ground_stands():
    closure = Closure(read_linkage(read_yaml(FOLDER / 'four_bar.yaml')[0]))
    position = closure.position(1.0)
    velocity = closure.velocity(position, 5.0)
    follower = closure.follower([('ground', 0.3 + 0.4j)])
    places = follower.places(position)
    assert places == [0.3 + 0.4j]
    assert follower.velocities(position, velocity, places) == [0j]
