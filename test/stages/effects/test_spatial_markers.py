# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Markers of spatial linkages: rods, joints, plates, traces, arrows."""

from linkage_ros.messages import JointStateWriter
from linkage_ros.resources import shipped_path
import numpy as np
import pytest
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from .test_forces_in_space import BEGIN, pipeline, RSSR
from ...support.messages import read_joint_state, STORE
from ...support.scenes import pipeline_of

TYPE = 'visualization_msgs/msg/MarkerArray'
CYLINDER, LINE_STRIP, SPHERE_LIST, TRIANGLE_LIST, DELETE = 3, 4, 7, 11, 2
MS = 1_000_000
TURN = """
drive: {{constant_rate: {{rate: 9, start: 0.3}}}}
effects: {{markers: {{{}}}}}
"""


def messages(at_work, tick):
    """Return each message beside the joint states, by its topic."""
    kinds = {each.topic: each.message for each in at_work.extras}
    return {
        topic: STORE.deserialize_cdr(data, kind)
        for (topic, kind), data in zip(kinds.items(), tick.extras, strict=True)
        if data
    }


def markers_at(at_work, now=BEGIN):
    return messages(at_work, at_work.tick(now))['~/markers'].markers


def markers_of(name, *inputs):
    """Return the markers of a shipped linkage at its inputs, those of its pose by default."""
    linkage = shipped_path(f'linkages/space/{name}.yaml').read_bytes()
    at_work = pipeline_of(b'drive: {topic: {}}\neffects: {markers: {}}\n', linkage)
    (line,) = at_work.linkages
    inputs = inputs or line.closure.linkage.pose.inputs
    sample = JointStateWriter(line.scene_linkage.input_names).write
    assert at_work.offer(sample(BEGIN, inputs, (0.0,) * len(inputs)), BEGIN) is None
    return markers_at(at_work)


def vector(of):
    return np.array([of.x, of.y, of.z])


def places(marker):
    """Return where the points of a marker are; of a cylinder its ends."""
    at, turn = vector(marker.pose.position), marker.pose.orientation
    turned = Rotation.from_quat([turn.x, turn.y, turn.z, turn.w])
    if marker.type == CYLINDER:
        return at + turned.apply([[0, 0, -0.5 * marker.scale.z], [0, 0, 0.5 * marker.scale.z]])
    return at + turned.apply([vector(point) for point in marker.points])


def named(markers, ns):
    return [marker for marker in markers if marker.ns == ns]


def test_rods_lie_between_the_balls_of_an_rssr():
    at_work = pipeline_of(TURN.format('').encode(), RSSR)
    rod_length = np.linalg.norm([0.06, 0.02, 0.12])
    for count in range(9):
        now = BEGIN + 41 * MS * count
        theta = 0.3 + 9 * 0.041 * count
        ball = 0.04 * np.array([np.cos(theta), np.sin(theta), 0.0])
        crank, rod, rocker = [places(each) for each in named(markers_at(at_work, now), 'links')]
        assert crank == pytest.approx(np.array([ball, np.zeros(3)]), abs=1e-12)
        assert rod[0] == pytest.approx(ball, abs=1e-12)
        assert np.linalg.norm(rod[1] - rod[0]) == pytest.approx(rod_length, abs=1e-12)
        # The other ball stays on its circle about the rocker's axis.
        centre, axis = np.array([0.15, 0.05, 0.03]), np.array([0, 1, 0.3]) / np.hypot(1, 0.3)
        arm, drawn = rod[1] - centre, np.array([0.1, 0.02, 0.12]) - centre
        assert arm @ axis == pytest.approx(drawn @ axis, abs=1e-12)
        assert np.linalg.norm(arm) == pytest.approx(np.linalg.norm(drawn), abs=1e-12)
        assert rocker == pytest.approx(np.array([rod[1], centre]), abs=1e-12)


def test_legs_follow_their_inputs_and_the_platform_stays_whole():
    legs = 0.33, 0.34, 0.33, 0.35, 0.33, 0.34
    markers = markers_of('hexapod', *legs)
    (plate,) = (each for each in named(markers, 'links') if each.type == TRIANGLE_LIST)
    corners = places(plate).reshape(-1, 3, 3)
    sides = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    flat = [[85, -85], [85, 85], [31, 116], [-116, 31], [-116, -31], [31, -116]]
    expected = ConvexHull(np.array(flat) / 1e3).volume  # of two dimensions: its area
    assert 0.5 * np.linalg.norm(sides, axis=1).sum() == pytest.approx(expected, rel=1e-9)
    # Each leg is a rod within a tube, both from the same place.
    rods = [places(each) for each in named(markers, 'joints') if each.type == CYLINDER]
    found = sorted(float(np.linalg.norm(end - start)) for start, end in rods)
    assert [each for each in found if each > 0.29] == pytest.approx(sorted(legs), abs=1e-9)


def test_all_faces_of_a_body_are_covered():
    linkage = RSSR.replace(b'B: [', b'C: [0, 0.03, 0.01], D: [0.02, 0, -0.03], B: [')
    linkage = linkage.replace(b'crank: [A]', b'crank: [A, C, D]')
    at_work = pipeline_of(TURN.format('').encode(), linkage)
    body = named(markers_at(at_work, BEGIN + 77 * MS), 'links')[0]
    corners = places(body)
    hull = ConvexHull(corners)
    triangles = corners.reshape(-1, 3, 3)
    sides = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    assert 0.5 * np.linalg.norm(sides, axis=1).sum() == pytest.approx(hull.area, rel=1e-9)


def test_spatial_markers_draw_curves_and_trails_of_traced_points():
    linkage = RSSR + b'traced: [B]\n'
    whole = pipeline_of(TURN.format('').encode(), linkage)
    (curve,) = named(markers_at(whole), 'traces')
    way = places(curve)
    centre, axis = np.array([0.15, 0.05, 0.03]), np.array([0, 1, 0.3]) / np.hypot(1, 0.3)
    far = np.linalg.norm(np.array([0.1, 0.02, 0.12]) - centre)
    assert np.linalg.norm(way - centre, axis=1) == pytest.approx(far, abs=1e-9)
    assert np.ptp((way - centre) @ axis) < 1e-9
    # It is also the end of the rod, at each instant.
    trailed = pipeline_of(TURN.format('rate: 10, trace: 0.2').encode(), linkage)
    gone = []
    for count in range(5):
        markers = markers_at(trailed, BEGIN + 100 * MS * count)
        gone.append(places(named(markers, 'links')[1])[1])
        trail = places(named(markers, 'traces')[0])
        assert trail == pytest.approx(np.array((gone + [gone[-1]] * 3)[:3] if count < 2
                                               else gone[-3:]), abs=1e-12)  # fmt: skip


def test_arrows_show_the_published_forces_and_effort():
    at_work = pipeline('pin_forces: {}, effort: {}, markers: {force_scale: 0.02}')
    for now in (BEGIN, BEGIN + 170 * MS):
        tick = at_work.tick(now)
        told = messages(at_work, tick)
        markers = told['~/markers'].markers
        crank, rod, _ = [places(each) for each in named(markers, 'links')]
        begins = {'crank_joint': crank[1], 'A': rod[0], 'B': rod[1]}
        wrenches = told['~/pin_forces']
        for name, wrench, arrow in zip(
            wrenches.joint_names, wrenches.wrench, named(markers, 'forces'), strict=True
        ):
            if arrow.action == DELETE:
                continue
            start, end = places(arrow)
            assert end - start == pytest.approx(0.02 * vector(wrench.force), abs=1e-12)
            if name in begins:
                assert start == pytest.approx(begins[name], abs=1e-12)
        # The arc lies about the z axis, and its length is that of the effort's force there.
        (arc,) = named(markers, 'efforts')
        drawn = places(arc)[:13]
        radius = np.hypot(drawn[:, 0], drawn[:, 1])
        assert radius == pytest.approx(radius[0])
        assert np.ptp(drawn[:, 2]) < 1e-15
        angles = np.unwrap(np.arctan2(drawn[:, 1], drawn[:, 0]))
        effort = read_joint_state(tick.message).effort[0]
        assert angles[-1] - angles[0] == pytest.approx(0.02 * effort / radius[0] ** 2, rel=1e-9)


def test_spatial_markers_show_toggles_and_open_loops():
    name = 'spherical_four_bar'
    near = markers_of(name, 91.1370 * np.pi / 180)
    away = markers_of(name, 0.0)
    red = [marker.id for marker in named(near, 'links') if marker.color.g < 0.2]
    assert red == [1]  # of the two that fold, the one that is placed by the other
    assert not [marker for marker in named(away, 'links') if marker.color.g < 0.2]
    opened = markers_of(name, 1.7)
    assert {marker.ns: marker.action for marker in opened}['links'] == DELETE
    (said,) = named(opened, 'status')
    assert said.text.startswith('open: the links miss each other by ')
    assert {(m.ns, m.id) for m in opened} == {(m.ns, m.id) for m in away}


@pytest.mark.parametrize(
    'name', ['ankle', 'bennett', 'delta', 'hooke_joint', 'spatial_slider_crank', 'wishbone']
)
def test_every_part_has_a_marker_of_its_own(name):
    markers = markers_of(name)
    assert len({(marker.ns, marker.id) for marker in markers}) == len(markers)
    assert named(markers, 'links')
    for marker in markers:
        if marker.ns in ('links', 'joints'):
            assert marker.type in (CYLINDER, LINE_STRIP, SPHERE_LIST, TRIANGLE_LIST)
            assert np.isfinite(places(marker)).all()
            assert np.linalg.norm(np.ptp(places(marker), axis=0)) > 0 or marker.type == SPHERE_LIST
