# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Markers: where things are drawn, when they are sent, and what stands in the place of no pose."""

from cmath import phase, rect
from fractions import Fraction
from itertools import pairwise
from math import acos, cos, hypot, log, pi, radians, remainder, tau

from hypothesis import given, settings, strategies as st
from linkage_ros.description import parse_scene
from linkage_ros.kinematics import (
    carried_shapes,
    GROUND,
    InputSweep,
    Polygon,
    shape_outline,
    usual_inputs,
)
from linkage_ros.messages import JointStateWriter
from linkage_ros.tick import Pipeline
import pytest

from ...support.messages import read_joint_state, STORE
from ...support.scenes import LINKAGES, pipeline_of

TYPE = 'visualization_msgs/msg/MarkerArray'
SECOND = 1_000_000_000
MS = 1_000_000
BEGIN = 1_700_000_000 * SECOND
GALLERY = sorted(file.stem for file in LINKAGES.glob('*.yaml'))
LINE_STRIP, TRIANGLE_LIST, DELETE = 4, 11, 2
RED = (0.88, 0.14, 0.11)


def built(linkage, text):
    return pipeline_of(f'{text}\n', (LINKAGES / f'{linkage}.yaml').read_bytes())


def extra(pipeline, tick, topic='~/markers'):
    """Return the message of a topic, read; nothing where there is none."""
    topics = [each.topic for each in pipeline.extras]
    data = tick.extras[topics.index(topic)] if tick.extras else b''
    kind = pipeline.extras[topics.index(topic)].message
    return STORE.deserialize_cdr(data, kind) if data else None


class Held:
    """A linkage whose crank is put where it is wanted, a tick a second."""

    def __init__(self, linkage, effects='markers: {}'):
        self.pipeline = built(linkage, f'drive: {{topic: {{}}}}\neffects: {{{effects}}}')
        (line,) = self.pipeline.linkages
        self.closure = line.closure
        self._write = JointStateWriter(line.scene_linkage.input_names).write
        self._now = BEGIN

    def at(self, *inputs):
        """Return the tick at these inputs."""
        self._now += SECOND
        nothing = (0.0,) * len(inputs)
        assert self.pipeline.offer(self._write(self._now, inputs, nothing), self._now) is None
        return self.pipeline.tick(self._now)

    def markers(self, *inputs):
        return extra(self.pipeline, self.at(*inputs)).markers


def places(marker):
    """Return where the points of a marker are, in the frame that all stand in."""
    turned = marker.pose.orientation
    assert (turned.x, turned.y) == (0.0, 0.0)
    way = complex(turned.w, turned.z) ** 2
    origin = complex(marker.pose.position.x, marker.pose.position.y)
    return [origin + way * complex(point.x, point.y) for point in marker.points]


def named(markers, ns):
    return [marker for marker in markers if marker.ns == ns]


def colour(marker):
    return marker.color.r, marker.color.g, marker.color.b


def some_inputs(closure):
    """Return inputs all over the range of the first one."""
    start = usual_inputs(closure)
    way = InputSweep(closure, start)
    span = way.range_about(start[0])
    steps = (0.03, 0.2, 0.45, 0.7, 0.97)
    found = [way.inputs_at(span.lowest + (span.highest - span.lowest) * part) for part in steps]
    return [inputs for inputs in found if closure.position(*inputs).joints]


# Positions.


@pytest.mark.sample(7)
@pytest.mark.parametrize('linkage', GALLERY)
def test_link_markers_equal_the_drawing_of_the_pose(linkage):
    held = Held(linkage)
    closure = held.closure
    extent = size = None
    compared = 0
    for inputs in some_inputs(closure):
        markers = held.markers(*inputs)
        position = closure.position(*inputs)
        if size is None:
            size = named(markers, 'pins')[0].scale.x / 1.1
            travels = dict.fromkeys(closure.linkage.sliders, (0.0, 0.0))
            extent = max(abs(place) for place in closure.points(position).values())
        # Rails are as long as they are used, which this drawing is not told: links without.
        rails = {each.along for each in closure.linkage.sliders.values()}
        rails |= {each.block for each in closure.linkage.sliders.values()}
        drawn = [
            shape for link, shape in carried_shapes(closure, position, size, travels)
            if isinstance(shape, Polygon) and link not in rails | {GROUND} and shape.name == link
        ]  # fmt: skip
        edges = [places(marker) for marker in named(markers, 'edges')]
        for shape in drawn:
            # Which corner an outline begins at depends on how the link is turned.
            apart = [
                max(min(abs(p - q) for q in edge) for p in shape_outline(shape)) for edge in edges
            ]
            assert min(apart) < 1e-9 * extent, shape.name
            compared += 1
    assert compared or linkage in ALL_RAILS


ALL_RAILS = {'elliptic_trammel', 'inverted_slider_crank', 'scotch_yoke'}
"""Linkages of which every link carries a rail, or is one link."""


@pytest.mark.sample(7)
@pytest.mark.parametrize('linkage', GALLERY)
def test_pin_and_block_markers_lie_at_their_points(linkage):
    held = Held(linkage)
    closure = held.closure
    for inputs in some_inputs(closure):
        markers = held.markers(*inputs)
        points = closure.points(closure.position(*inputs))
        scale = max(map(abs, points.values()))
        rim, face = named(markers, 'pins')
        assert places(rim) == places(face)
        shared = {
            point for link, named_points in closure.structure.links.items()
            for point in named_points
            if sum(point in other for other in closure.structure.links.values()) > 1
        }  # fmt: skip
        expected = {point: place for (_, point), place in points.items() if point in shared}
        assert len(rim.points) == len(expected)
        for place in expected.values():
            assert min(abs(place - pin) for pin in places(rim)) < 1e-9 * scale
        for marker in named(markers, 'sliders'):
            middle = sum(places(marker)) / len(marker.points)
            assert any(abs(middle - place) < 2.0 * rim.scale.x for place in points.values())


def test_marker_heights_follow_the_drawing_order():
    markers = Held('excavator_bucket').markers(1.0)
    heights = [marker.pose.position.z for marker in markers if marker.ns in ('links', 'sliders')]
    assert heights == sorted(set(heights))
    assert min(heights) > 0.0
    highest = max(heights)
    size = named(markers, 'pins')[0].scale.x / 1.1
    assert highest < len(heights) * size
    assert {marker.pose.position.z for marker in named(markers, 'ground')} == {0.0}
    assert all(marker.pose.position.z > highest for marker in named(markers, 'pins'))


def test_bar_markers_have_the_thickness_of_the_scene():
    for share in (0.01, 0.05):
        markers = Held('four_bar', f'markers: {{thickness: {share}}}').markers(1.0)
        (crank,) = [edge for edge in named(markers, 'edges')
                    if max(map(abs, places(edge))) < 0.06]  # fmt: skip
        along = [place * rect(1.0, -1.0) for place in places(crank)]
        assert all(-0.01 < place.real < 0.05 for place in along)
        width = max(place.imag for place in along) - min(place.imag for place in along)
        assert width == pytest.approx(share * EXTENT, rel=0.1)


EXTENT = hypot(0.196, 0.115)
"""Of the four-bar, roughly: from −0.04 to 0.156 m, and from −0.04 to 0.076 m."""


def test_trace_markers_follow_the_traced_points():
    held = Held('four_bar')
    (curve,) = named(held.markers(1.0), 'traces')
    assert curve.type == LINE_STRIP
    path = places(curve)
    assert len(path) > 300
    assert abs(path[0] - path[-1]) < 1e-9  # a whole turn
    for theta in (0.3, 2.0, 4.0):
        place = held.closure.points(held.closure.position(theta))['coupler', 'P']
        assert min(abs(place - known) for known in path) < 5e-4
    assert not named(Held('five_bar').markers(*usual_inputs(Held('five_bar').closure)), 'traces')


def test_timed_trace_marker_keeps_the_last_seconds():
    held = Held('five_bar', 'markers: {rate: 2, trace: 2.0}')
    start = usual_inputs(held.closure)
    gone = []
    for step in range(8):
        inputs = (start[0] + 0.02 * step, start[1])
        (trace,) = named(held.markers(*inputs), 'traces')
        (name,) = held.closure.linkage.traced
        points = held.closure.points(held.closure.position(*inputs))
        gone.append(next(place for (_, point), place in points.items() if point == name))
        # Five places from the start on: those not gone to yet are where it is.
        expected = (gone + [gone[-1]] * 5)[:5] if len(gone) < 5 else gone[-5:]
        assert places(trace) == pytest.approx(expected, abs=1e-12)


# Times.


def ticked(effects, times, scene='rate: 1000'):
    """Return at which of some times, in [ns] since the first tick, messages come."""
    pipeline = built(
        'four_bar', f'drive: {{constant_rate: {{rate: 1.0}}}}\n{scene}\neffects: {{{effects}}}'
    )
    found = [(time, extra(pipeline, pipeline.tick(BEGIN + time))) for time in times]
    return [(time, message) for time, message in found if message is not None]


@settings(max_examples=30)
@given(
    rate=st.sampled_from(['30', '25', '7.5', '0.3', '1000', '59.94']),
    steps=st.lists(st.integers(1, 40 * MS), min_size=2, max_size=60),
)
def test_first_tick_of_each_period_publishes_markers(rate, steps):
    times = [sum(steps[:index]) for index in range(len(steps))]
    came = [time for time, _ in ticked(f'markers: {{rate: {rate}}}', times)]
    # Exact, as fractions: the double that stands for the rate is one.
    periods = [Fraction(BEGIN + time, SECOND) * Fraction(float(rate)) // 1 for time in times]
    before = [None, *periods]
    expected = [time for n, time in enumerate(times) if periods[n] != before[n]]
    assert came == expected


def test_static_markers_are_published_once_a_second():
    came = ticked('markers: {rate: 10}', [100 * MS * index + MS for index in range(35)])
    assert len(came) == 35
    whole = [time for time, message in came if named(message.markers, 'ground')]
    assert whole == [MS, SECOND + MS, 2 * SECOND + MS, 3 * SECOND + MS]
    assert whole == [time for time, message in came if named(message.markers, 'traces')]


@pytest.mark.parametrize(
    ('rate', 'scene', 'moves', 'stays'),
    [
        ('30', 'rate: 1000', 1.0, 3.0),
        ('1', 'rate: 1000', 3.0, 3.0),
        ('0.1', 'rate: 1000', 30.0, 30.0),
        ('30', 'rate: 0.5', 6.0, 6.0),
    ],
)
def test_marker_lifetime_covers_the_publish_period(rate, scene, moves, stays):
    ((_, message),) = ticked(f'markers: {{rate: {rate}}}', [0], scene)
    for marker in message.markers:
        lifetime = marker.lifetime.sec + marker.lifetime.nanosec * 1e-9
        assert lifetime == (stays if marker.ns in ('ground', 'traces') else moves)


def test_markers_of_sample_driven_ticks_never_expire():
    pipeline = built('four_bar', 'rate: 0\neffects: {markers: {}}')
    stamp = BEGIN + 5
    pipeline.offer(JointStateWriter(['crank_joint']).write(stamp, [1.0], [0.0]), stamp)
    for marker in extra(pipeline, pipeline.tick(stamp)).markers:
        assert (marker.lifetime.sec, marker.lifetime.nanosec) == (0, 0)
        assert marker.header.stamp.nanosec == 5


def test_marker_ids_stay_the_same():
    held = Held('excavator_bucket', 'markers: {}')
    first, second = ([(m.ns, m.id) for m in held.markers(x)] for x in (0.8, 1.1))
    assert first == second
    assert len(set(first)) == len(first)


def test_sensor_effects_do_not_change_markers():
    noisy = 'bias: {joints: {rocker_joint: 0.5}}, encoder: {joints: {coupler_joint: {counts: 4}}}'
    (_, plain), (_, read) = (
        ticked(effects, [0])[0] for effects in ('markers: {}', f'markers: {{}}, {noisy}')
    )
    assert repr(plain) == repr(read)


# Frames and topics.


@pytest.mark.parametrize(
    ('said', 'frame'), [('markers: {}', 'ground'), ('markers: {frame: base_link}', 'base_link')]
)
def test_markers_use_the_frame_of_the_scene(said, frame):
    assert {marker.header.frame_id for marker in Held('four_bar', said).markers(1.0)} == {frame}


def test_each_linkage_publishes_its_own_markers():
    four_bar = (LINKAGES / 'four_bar.yaml').read_bytes()
    text = (
        'linkages: [{name: left, linkage: l.yaml}, {name: right, linkage: l.yaml}]\n'
        'drive: {constant_rate: {rate: 1.0}}\neffects: {markers: {}}\n'
    )
    pipeline = Pipeline(
        parse_scene('scene', 'here', {'scene.yaml': text.encode(), 'linkage_1.yaml': four_bar,
                                      'linkage_2.yaml': four_bar})
    )  # fmt: skip
    tick = pipeline.tick(BEGIN)
    for side in ('left', 'right'):
        markers = extra(pipeline, tick, f'~/{side}/markers').markers
        assert {marker.header.frame_id for marker in markers} == {f'{side}_ground'}


# Failures.


def transmission_angle(theta):
    """Return that of the double rocker: 200, 80, 200 mm on 160 mm, folded to [0, π/2]."""
    s2 = 0.2**2 + 0.16**2 - 2.0 * 0.2 * 0.16 * cos(theta)
    mu = acos((0.08**2 + 0.2**2 - s2) / (2.0 * 0.08 * 0.2))
    return min(mu, pi - mu)


@settings(max_examples=40)
@given(theta=st.floats(radians(36.88), radians(101.5)), limit=st.sampled_from([0.0, 0.2, 0.6]))
def test_link_markers_turn_red_near_a_toggle(theta, limit):
    markers = DOUBLE_ROCKER[limit].markers(theta)
    red = [m.id for m in named(markers, 'links') if colour(m) == pytest.approx(RED, abs=0.01)]
    # The crank is no part of the dyad that folds.
    assert len(red) == (2 if transmission_angle(theta) < limit else 0)
    assert all(
        colour(marker) != pytest.approx(RED, abs=0.01) for marker in named(markers, 'edges')
    )


DOUBLE_ROCKER = {
    limit: Held('double_rocker', f'markers: {{near_toggle: {limit}}}') for limit in (0.0, 0.2, 0.6)
}


def test_link_markers_at_a_toggle_are_red():
    held = Held('double_rocker')
    # An end of the range, to the last float.
    tick = held.at(held.closure.input_ranges[0].lowest)
    assert tick.message
    links = named(extra(held.pipeline, tick).markers, 'links')
    assert sum(colour(link) == pytest.approx(RED, abs=0.01) for link in links) == 2


def test_open_loop_deletes_moving_markers_and_shows_the_gap():
    held = Held('double_rocker', 'markers: {}, velocity: {}')
    closed = {(m.ns, m.id): m.action for m in held.markers(1.0)}
    assert closed['status', 0] == DELETE
    tick = held.at(2.0)
    assert tick.message == b''
    opened = {(m.ns, m.id): m for m in extra(held.pipeline, tick).markers}
    assert opened.keys() == closed.keys()
    for (ns, _), marker in opened.items():
        if ns in ('ground', 'traces'):
            assert marker.action == 0
        elif ns != 'status':
            assert (marker.action, len(marker.points)) == (DELETE, 0)
    # The rocker's pin is farther away than coupler and right rocker, in line, reach.
    s = abs(0.16 - 0.2 * rect(1.0, 2.0))
    gap = s - 0.28
    assert opened['status', 0].text == f'open: the links miss each other by {gap:.3g} m'
    assert opened['status', 0].action == 0
    again = {(m.ns, m.id): m.action for m in held.markers(1.0)}
    assert again == closed


def test_open_linkage_deletes_only_its_own_markers():
    text = (
        'linkages:\n'
        '- {name: a, linkage: l.yaml, drive: {profile: {table: [[0, 2.0], [9, 2.0]]}}}\n'
        '- {name: b, linkage: m.yaml, drive: {constant_rate: {rate: 1.0}}}\n'
        'effects: {markers: {}}\n'
    )
    files = {
        'scene.yaml': text.encode(),
        'linkage_1.yaml': (LINKAGES / 'double_rocker.yaml').read_bytes(),
        'linkage_2.yaml': (LINKAGES / 'four_bar.yaml').read_bytes(),
    }
    pipeline = Pipeline(parse_scene('scene', 'here', files))
    tick = pipeline.tick(BEGIN)
    assert tick.message
    for name, action in (('a', DELETE), ('b', 0)):
        links = named(extra(pipeline, tick, f'~/{name}/markers').markers, 'links')
        assert {link.action for link in links} == {action}
    # A tick later no marker is due, and the joint states are there alone.
    assert not any(pipeline.tick(BEGIN + MS).extras)


def test_markers_need_a_crank_and_a_reading():
    pipeline = built('four_bar', 'effects: {markers: {}}')
    assert pipeline.tick(BEGIN).extras == ()
    silent = built(
        'four_bar',
        'drive: {constant_rate: {rate: 1}}\neffects: {markers: {}, delay: {seconds: 1}}',
    )
    assert silent.tick(BEGIN).extras == ()


# Forces.

WEIGHT = 9.81 * (0.025 + 0.100 + 0.050)
LOADED = 'loads: {gravity: [0, -9.81]}\ndrive: {constant_rate: {start: %s, rate: %s}}\n'


@pytest.mark.parametrize(('start', 'rate'), [(1.0, 0.0), (1.0, 30.0), (4.0, 0.01)])
@pytest.mark.parametrize('scale', [0.0, 0.02])
def test_force_arrow_marker_equals_the_published_force(start, rate, scale):
    effects = f'effects: {{pin_forces: {{}}, markers: {{force_scale: {scale}}}}}'
    pipeline = built('four_bar', LOADED % (start, rate) + effects)
    tick = pipeline.tick(BEGIN)
    told = extra(pipeline, tick, '~/pin_forces')
    markers = extra(pipeline, tick).markers
    arrows = named(markers, 'forces')
    (linkage,) = pipeline.linkages
    points = linkage.closure.points(linkage.closure.position(start))
    pins = {point: place for (_, point), place in points.items()}
    size = named(markers, 'pins')[0].scale.x / 1.1
    seen = 0
    for name, wrench, arrow in zip(told.joint_names, told.wrench, arrows, strict=True):
        force = complex(wrench.force.x, wrench.force.y)
        if arrow.action == DELETE:
            assert abs(force) * (scale or 1.0) < max(size, WEIGHT)
            continue
        seen += 1
        begin, end = places(arrow)
        assert abs(begin - pins[name]) < 1e-12
        assert abs(remainder(phase(end - begin) - phase(force), tau)) < 1e-9
        if scale:
            assert abs(end - begin) == pytest.approx(scale * abs(force), rel=1e-9)
        else:
            eighth = abs(end - begin) / log(1.0 + abs(force) / WEIGHT)
            assert eighth == pytest.approx(EXTENT / 8.0, rel=0.1)
    assert seen >= 3
    assert not named(markers, 'efforts')


@pytest.mark.parametrize('start', [0.5, 2.5, 5.5])
def test_effort_marker_is_an_arc_in_push_direction(start):
    effects = 'effects: {effort: {}, markers: {force_scale: 0.02}}'
    pipeline = built('four_bar', LOADED % (start, 0.0) + effects)
    tick = pipeline.tick(BEGIN)
    state = read_joint_state(tick.message)
    markers = extra(pipeline, tick).markers
    (arc,) = named(markers, 'efforts')
    size = named(markers, 'pins')[0].scale.x / 1.1
    drawn = places(arc)[:13]  # then comes the head
    assert [abs(place) for place in drawn] == pytest.approx([8.0 * size] * 13)
    assert phase(drawn[0] * rect(1.0, -start)) == pytest.approx(0.0, abs=1e-9)
    turn = sum(phase(b / a) for a, b in pairwise(drawn))
    expected = 0.02 * state.effort[0] / (8.0 * size) / (8.0 * size)
    assert turn == pytest.approx(expected, rel=1e-9)
    assert not named(markers, 'forces')


def test_cylinder_effort_marker_is_a_straight_arrow():
    pipeline = built(
        'excavator_bucket',
        'loads: {gravity: [0, -9.81]}\ndrive: {profile: {table: [[0, 1.0], [9, 1.0]]}}\n'
        'effects: {effort: {}, markers: {force_scale: 1.0e-4}}',
    )
    tick = pipeline.tick(BEGIN)
    effort = read_joint_state(tick.message).effort[0]
    begin, end = places(named(extra(pipeline, tick).markers, 'efforts')[0])[:2]
    (linkage,) = pipeline.linkages
    points = linkage.closure.points(linkage.closure.position(1.0))
    rod, tube = points['cylinder_rod', 'C'], points['cylinder_tube', 'K']
    way = (rod - tube) / abs(rod - tube)
    assert abs(begin - rod) < 1e-12
    assert abs((end - begin) - 1e-4 * effort * way) < 1e-12


def test_force_markers_are_deleted_at_a_toggle():
    linkage = (LINKAGES / 'double_rocker.yaml').read_text()
    masses = ''.join(
        f'  {link}: {{mass: 1.0, center: [0.05, 0], inertia: 0.1}}\n'
        for link in ('left_rocker', 'coupler', 'right_rocker')
    )
    lowest = DOUBLE_ROCKER[0.0].closure.input_ranges[0].lowest
    for value, action in ((lowest, DELETE), (lowest + 0.3, 0)):
        drive = f'drive: {{profile: {{table: [[0, {value!r}], [9, {value!r}]]}}}}\n'
        loads = 'loads: {gravity: [0, -9.81]}\n'
        effects = f'{loads}effects: {{pin_forces: {{}}, effort: {{}}, markers: {{}}}}'
        pipeline = pipeline_of(f'{drive}{effects}\n', f'{linkage}masses:\n{masses}')
        markers = extra(pipeline, pipeline.tick(BEGIN)).markers
        arrows = [*named(markers, 'forces'), *named(markers, 'efforts')]
        assert [marker.action for marker in arrows] == [action] * 5
