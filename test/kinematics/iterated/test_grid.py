# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The cells of a grid come from the inputs alone, along straight lines that end at folds.

They do not come from any state that was asked for before.
"""

from math import floor, hypot, inf, log10, sqrt
import random

from linkage_ros.kinematics.iterated.grid import Grid, GridInput
import numpy as np
import pytest


class Sphere:
    """
    One unknown z over one or two inputs: z² = r² − |x − c|², singular at the rim.

    At one of three places, by their digits, no solution is found.
    """

    def __init__(self, centre, radius):
        self.centre, self.radius = centre, radius

    def error(self, inputs, z):
        return 0.5 * (z * z - self.radius**2 + hypot(*self.away(inputs)) ** 2)

    def away(self, inputs):
        return [x - c for x, c in zip(inputs, self.centre, strict=True)]

    def shortfall(self, inputs):
        return 0.0

    def proof(self, inputs, unknowns):
        (z,) = unknowns
        return abs(self.error(inputs, z) / z) * abs(1.0 / z) if z else inf

    def solve_from(self, inputs, unknowns):
        (z,) = unknowns
        if floor(sum(inputs) * 977.0) % 3 == 1:
            return None
        for _ in range(60):
            step = self.error(inputs, z) / z if z else inf
            if abs(step) <= 4e-16:
                return [z]
            z -= step
        return None

    def forms_at(self, inputs, unknowns):
        (z,) = unknowns
        slopes = [-x / z for x in self.away(inputs)]
        count, bends = len(slopes), []
        for i in range(count):
            for k in range(i, count):
                both = (float(i == k) + slopes[i] * slopes[k]) / -z
                bends.append((both if i != k else 0.5 * both,))
        return [(slope,) for slope in slopes], bends

    def forms_along(self, inputs, unknowns, direction):
        (z,) = unknowns
        slope = -sum(x * d for x, d in zip(self.away(inputs), direction, strict=True)) / z
        return (slope,), (-0.5 * (sum(d * d for d in direction) + slope * slope) / z,)


class NearCrossing(Sphere):
    """Two sheets z² − (x − c)·z + d² = 0 over an input x, with a gap |x − c| < 2·d between."""

    def __init__(self, centre, half_gap):
        self.centre, self.half_gap = centre, half_gap

    @property
    def start(self):
        """Return the smaller root at x = 0; the one beyond the gap looks as its continuation."""
        return -0.5 * self.centre + sqrt(0.25 * self.centre**2 - self.half_gap**2)

    def matrix(self, inputs, z):
        return 2.0 * z - (inputs[0] - self.centre)

    def error(self, inputs, z):
        return z * z - (inputs[0] - self.centre) * z + self.half_gap**2

    def proof(self, inputs, unknowns):
        (z,) = unknowns
        matrix = self.matrix(inputs, z)
        return abs(self.error(inputs, z) / matrix) * abs(2.0 / matrix) if matrix else inf

    def solve_from(self, inputs, unknowns):
        (z,) = unknowns
        for _ in range(60):
            step = self.error(inputs, z) / self.matrix(inputs, z)
            z -= step
            if abs(step) <= 4e-16:
                return [z]
        return None

    def forms_at(self, inputs, unknowns):
        (z,) = unknowns
        slope = z / self.matrix(inputs, z)
        return [(slope,)], [((slope - slope * slope) / self.matrix(inputs, z),)]

    def forms_along(self, inputs, unknowns, direction):
        ((slope,),), ((bend,),) = self.forms_at(inputs, unknowns)
        return (slope * direction[0],), (bend * direction[0] ** 2,)


class Flat(Sphere):
    """One unknown that is 0 everywhere."""

    def __init__(self, places):
        self.places = places

    def proof(self, inputs, unknowns):
        return 0.0

    def solve_from(self, inputs, unknowns):
        self.places.append(inputs)
        return [0.0]

    def forms_at(self, inputs, unknowns):
        return [(0.0,)] * 2, [(0.0,)] * 3


def sphere_grid(rng, count):
    """Return a function that makes grids of a random sphere, and inputs up to beyond its rim."""
    centre = [rng.uniform(-0.3, 0.3) for _ in range(count)]
    radius = rng.uniform(0.8, 2.0)
    sphere = Sphere(centre, radius)
    start = sqrt(radius**2 - hypot(*centre) ** 2)
    inputs = [GridInput(0.0, -inf, inf, False)] * count

    def make():
        return Grid(sphere, inputs, range(count), [start])

    def draw(states):
        far = 1.05 * radius
        return [tuple(c + rng.uniform(-far, far) for c in centre) for _ in range(states)]

    return make, draw


@pytest.mark.sample(8)
@pytest.mark.parametrize('count', [1, 2])
@pytest.mark.parametrize('seed', range(12))
def test_grid_cells_do_not_depend_on_earlier_queries(seed, count):
    rng = random.Random(seed)
    make, draw = sphere_grid(rng, count)
    states = draw(40)
    fresh = [make()(*inputs) for inputs in states]
    assert any(fresh)
    for order in (states, sorted(states), sorted(states, reverse=True), rng.sample(states, 40)):
        grid = make()
        found = {inputs: grid(*inputs) for inputs in order}
        assert [found[inputs] for inputs in states] == fresh


@pytest.mark.sample(5)
@pytest.mark.parametrize('seed', range(12))
def test_grid_reach_does_not_depend_on_earlier_queries(seed):
    rng = random.Random(seed)
    make, draw = sphere_grid(rng, 2)
    states = draw(20)
    fresh = [make().reach(inputs) for inputs in states]
    grid = make()
    for inputs in draw(40):
        grid(*inputs)
    assert [grid.reach(inputs) for inputs in states] == fresh


@pytest.mark.parametrize('count', [1, 2])
@pytest.mark.parametrize('states', [0, 1, 30])
def test_grid_batch_returns_the_cells_of_single_inputs(states, count):
    make, draw = sphere_grid(random.Random(states), count)
    inputs, one_by_one = draw(states), make()
    rows, found = make().rows_at(*np.array(inputs).reshape(states, count).T)
    for number, given in enumerate(inputs):
        cell = one_by_one(*given)
        assert found[number] == (cell is not None)
        assert cell is None or tuple(rows[:, number]) == cell


@pytest.mark.parametrize('seed', range(8))
def test_way_to_a_cell_bends_by_an_eighth_of_its_length(seed):
    rng = random.Random(seed)
    end = rng.uniform(-15.0, 15.0), rng.choice([-15.0, 15.0])
    places = []
    grid = Grid(Flat(places), [GridInput(0.0, -inf, inf, False)] * 2, range(2), [0.0])
    assert grid(*end)
    assert len(places) >= 120
    for along, across in places:
        assert abs(along - end[0] * across / end[1]) < abs(end[1]) / 8.0 + grid.widths[0]


@pytest.mark.parametrize('seed', range(100))
def test_no_line_passes_over_a_gap_of_a_fiftieth_radian(seed):
    rng = random.Random(seed)
    centre = rng.uniform(0.3, 1.5)
    sheets = NearCrossing(centre, 10.0 ** rng.uniform(log10(0.006), log10(0.1)))
    beyond = centre + 2.0 * sheets.half_gap + rng.uniform(0.0, 4.0)
    grid = Grid(sheets, [GridInput(0.0, -inf, inf, False)], range(1), [sheets.start])
    assert grid(beyond) is None
    place, left = grid.reach((beyond,))
    assert place.inputs[0] <= centre - 2.0 * sheets.half_gap
    assert left >= 4.0 * sheets.half_gap
