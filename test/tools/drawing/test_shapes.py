# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Shapes in metres: what is drawn is where the closure says that it is."""

from itertools import accumulate, pairwise
from math import cos, pi, remainder, sin, tau
from pathlib import Path
import random

from hypothesis import given, strategies as st
from linkage_ros.description import parse_yaml, read_linkage, read_yaml
from linkage_ros.kinematics import (
    Circle,
    Closure,
    convex_hull,
    draw_shapes,
    draw_skeleton,
    drawn_once,
    GROUND,
    InputSweep,
    Polygon,
    round_corners,
    Segment,
    sweep_range,
    unwrap_angles,
    usual_inputs,
)
from linkage_ros.tools.drawing import Label, place_labels
import pytest

LINKAGES = Path(__file__).parents[3] / 'config' / 'linkages'
FILES = sorted(LINKAGES.glob('*.yaml'))
SIZE = 0.002
coordinates = st.integers(-50, 50)
places = st.builds(complex, coordinates, coordinates)


def drawn(name: str) -> tuple[Closure, dict[tuple[str, str], complex], list[object]]:
    closure = Closure(read_linkage(read_yaml(LINKAGES / f'{name}.yaml')[0]))
    inputs = usual_inputs(closure)
    way = InputSweep(closure, inputs)
    position = closure.position(*inputs)
    interval = way.range_about(inputs[0])
    assert interval is not None
    found = draw_shapes(closure, position, SIZE, sweep_range(way, interval).travels)
    return closure, closure.points(position), list(found)


def left_of(point: complex, start: complex, end: complex) -> float:
    edge, onward = end - start, point - start
    return edge.real * onward.imag - edge.imag * onward.real


def contains(polygon: Polygon, point: complex) -> bool:
    """Return whether a convex polygon, counter-clockwise, contains a point."""
    corners = polygon.corners
    edges = zip(corners, (*corners[1:], corners[0]), strict=True)
    return all(left_of(point, start, end) >= -1e-12 for start, end in edges)


SLIDER_CRANK = """
links:
  ground: {O2: [0, 0], G: [0, 0]}
  crank: {O2: [0, 0], A: [0.05, 0]}
  rod: {A: [0, 0], B: [0.15, 0]}
sliders: {guide: {point: B, along: ground, through: G, direction: [1, 0]}}
input: {joint: crank_joint, parent: ground, child: crank}
assembly: {guide: ahead}
joints: {slide: {slider: guide}}
"""


@given(st.lists(places, min_size=1, max_size=12))
def test_convex_hull_contains_all_points(points):
    corners = convex_hull(points)
    assert set(corners) <= set(points)
    if len(corners) < 3:
        # All in line: the two farthest.
        farthest = max((abs(p - q) for p in points for q in points), default=0.0)
        assert abs(corners[-1] - corners[0]) == farthest
        return
    for i, corner in enumerate(corners):
        following = corners[(i + 1) % len(corners)]
        assert all(left_of(p, corner, following) >= -0.011 for p in points)


@given(st.lists(places, min_size=1, max_size=8), st.floats(0.1, 3.0))
def test_rounded_outline_keeps_its_distance(points, radius):
    corners = convex_hull(points)
    for place in round_corners(corners, radius):
        assert min(abs(place - corner) for corner in corners) == pytest.approx(radius)


@pytest.mark.sample(7)
@pytest.mark.parametrize('file', FILES, ids=lambda file: file.stem)
def test_every_pin_is_drawn_as_a_circle(file):
    closure, points, found = drawn(file.stem)
    circles = {shape.name: shape.centre for shape in found if isinstance(shape, Circle)}
    carriers: dict[str, int] = {}
    for named in closure.linkage.links.values():
        for point in named:
            carriers[point] = carriers.get(point, 0) + 1
    assert {point for point, count in carriers.items() if count > 1} <= set(circles)
    for (_, point), place in points.items():
        if point in circles:
            assert abs(circles[point] - place) < 1e-12


@pytest.mark.sample(7)
@pytest.mark.parametrize('file', FILES, ids=lambda file: file.stem)
def test_every_link_is_drawn_around_its_points(file):
    closure, points, found = drawn(file.stem)
    for link, named in closure.linkage.links.items():
        if link == GROUND:
            continue
        blocks = [s for s, slider in closure.linkage.sliders.items() if slider.block == link]
        bodies = [s for s in found if isinstance(s, Polygon) and s.name in (link, *blocks)]
        assert bodies
        for point in named:
            assert any(contains(body, points[link, point]) for body in bodies)


def test_ground_pivots_stand_on_hatched_ground():
    _, points, found = drawn('four_bar')
    tips = [s.corners[0] for s in found if isinstance(s, Polygon) and s.role == 'ground']
    assert tips == [points[GROUND, 'O2'], points[GROUND, 'O4']]
    assert sum(isinstance(s, Segment) and s.role == 'hatch' for s in found) >= 6


def test_driven_links_are_drawn_on_top():
    _, _, found = drawn('four_bar')
    links = [
        s.name for s in found if isinstance(s, Polygon) and s.role in ('link', 'plate', 'input')
    ]
    assert links == ['coupler', 'rocker', 'crank']


def test_three_points_form_a_plate_collinear_points_a_bar():
    _, _, found = drawn('klann_leg')
    assert {s.name: s.role for s in found if isinstance(s, Polygon)}['leg'] == 'plate'
    _, _, found = drawn('hoeken')
    assert {s.name: s.role for s in found if isinstance(s, Polygon)}['coupler'] == 'link'


def test_cylinder_is_drawn_as_rod_in_a_tube():
    _, points, found = drawn('excavator_bucket')
    tube = next(s for s in found if isinstance(s, Polygon) and s.role == 'tube')
    rod = next(s for s in found if isinstance(s, Polygon) and s.name == 'cylinder_rod')
    assert any(contains(tube, corner) for corner in rod.corners)
    assert not contains(tube, points['cylinder_rod', 'C'])
    _, points, found = drawn('slider_crank')
    block = next(s for s in found if isinstance(s, Polygon) and s.role == 'block')
    assert sum(block.corners) / 4 == pytest.approx(points['connecting_rod', 'B'])


def test_skeleton_lines_run_from_pin_to_pin():
    closure, points, _ = drawn('four_bar')
    position = closure.position(*usual_inputs(closure))
    lines = {frozenset((line.start, line.end)) for line in draw_skeleton(closure, position)}
    assert frozenset((points['crank', 'O2'], points['crank', 'A'])) in lines
    assert len(lines) == 5  # crank, rocker, and three sides of the coupler


@given(st.lists(st.floats(-3.1, 3.1), min_size=1, max_size=60), st.integers(-3, 3))
def test_unwrapped_angles_differ_by_whole_turns(steps, turns):
    angles = list(accumulate(steps, initial=0.5))
    wrapped = [remainder(angle + turns * tau, tau) for angle in angles]
    assert unwrap_angles(wrapped) == pytest.approx(angles)


def test_traced_point_of_a_peaucellier_cell_moves_straight():
    closure = Closure(read_linkage(read_yaml(LINKAGES / 'peaucellier.yaml')[0]))
    way = InputSweep(closure)
    path = sweep_range(way, way.ranges[0]).paths['P']
    assert len(path) > 700
    assert all(abs(place.real - 0.13125) < 1e-14 for place in path)


def test_path_there_and_back_is_drawn_once():
    turn = [tau * i / 720 for i in range(721)]
    arc = [complex(cos(sin(t)), sin(sin(t))) for t in turn]  # as a rocker's end goes
    there = drawn_once(arc)
    assert len(there) == 361
    assert {there[0], there[-1]} == {arc[180], arc[540]}
    loop = [complex(cos(t), 0.1 * sin(t)) for t in turn]
    assert drawn_once(loop) == tuple(loop)


def test_labels_do_not_overlap():
    rng = random.Random(3)
    labels = [
        Label((complex(rng.uniform(100, 500), rng.uniform(100, 300)),), 40.0, 10.0, 6.0)
        for _ in range(25)
    ]
    placed = place_labels(labels, [], (0j, 600.0 + 400.0j))
    for i, one in enumerate(placed):
        for other in placed[:i]:
            apart = one.centre - other.centre
            assert abs(apart.real) >= 40.0 or abs(apart.imag) >= 10.0


def test_label_avoids_lines_and_stays_on_the_paper():
    line = [complex(x, 50.0) for x in range(0, 200, 3)]
    (found,) = place_labels([Label((100.0 + 50.0j,), 30.0, 8.0, 4.0)], line, (0j, 200.0 + 100.0j))
    assert abs(found.centre.imag - 50.0) >= 4.0
    (corner,) = place_labels([Label((0j,), 30.0, 8.0, 4.0)], [], (0j, 200.0 + 100.0j))
    assert corner.centre.real >= 15.0
    assert corner.centre.imag >= 4.0


def test_rounded_point_is_a_16_cornered_circle():
    outline = round_corners([0j], 1.0)
    assert len(outline) == 16
    assert all(abs(place) == pytest.approx(1.0) for place in outline)
    assert tau / len(outline) == pytest.approx(pi / 8.0)


GEARED = """
links:
  ground: {O: [0, 0], P: [0.06, 0], Q: [0.15, 0]}
  sun: {O: [0, 0], A: [0.03, 0]}
  planet: {P: [0, 0], B: [0.02, 0]}
  rod: {B: [0, 0], C: [0.09, 0]}
  lever: {Q: [0, 0], C: [0.05, 0]}
input: {joint: sun_joint, parent: ground, child: sun}
assembly: {C: left}
joints: {planet_joint: {parent: ground, child: planet}}
ratios: {planet_joint: {of: sun_joint, ratio: -2}}
"""


def test_pitch_circles_are_closed_and_round():
    """A chord leaves its circle by less than a tenth of a pixel of a circle 200 pixels wide."""
    closure = Closure(read_linkage(parse_yaml(GEARED.encode(), 'x.yaml')))
    shapes = draw_shapes(closure, closure.position(0.4), 0.002, {})
    chords = [s for s in shapes if isinstance(s, Segment) and s.name == 'planet_joint']
    for centre, radius in ((0j, 0.04), (0.06, 0.02)):  # as the ratio divides the distance
        ends = [s for s in chords if abs(abs(s.start - centre) - radius) < 1e-12]
        ends = [s for s in ends if abs(abs(s.end - centre) - radius) < 1e-12]
        assert all(one.end == other.start for one, other in pairwise(ends))
        assert ends[0].start == pytest.approx(ends[-1].end, abs=1e-12)
        sagitta = max(radius - abs(0.5 * (s.start + s.end) - centre) for s in ends)
        assert sagitta / radius < 0.1 / 100.0


@pytest.mark.parametrize('ratio', [1.0, 1e3, 1e6, 1e9])
def test_rail_of_any_length_has_few_hatch_strokes(ratio):
    closure = Closure(read_linkage(parse_yaml(SLIDER_CRANK.encode(), 'slider_crank.yaml')))
    position = closure.position(0.3)
    drawn = draw_shapes(closure, position, 0.01, {'guide': (0.1, 0.1 + ratio)})
    hatched = [shape for shape in drawn if shape.role == 'hatch']
    assert 3 <= len(hatched) <= 300
    # They reach from end to end.
    rail = max((s for s in drawn if s.role == 'rail'), key=lambda s: abs(s.end - s.start))
    for end in (rail.start, rail.end):
        apart = min(abs(stroke.start - end) for stroke in hatched)
        assert apart < 0.02 * abs(rail.end - rail.start) + 0.02
