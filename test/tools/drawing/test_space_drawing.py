# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A spatial linkage in a picture: true projection, every point, readable names."""

from itertools import combinations
from math import degrees

from linkage_ros.description import load
from linkage_ros.kinematics import Circle, prepare_view, SpaceDrawing
from linkage_ros.resources import spatial_linkage_names
from linkage_ros.tools.drawing import Camera, choose_camera, draw_linkage
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from .test_pictures import box, drawn, nearer
from ...support.spatial import load_in_space

# A leg of two cylinders and a rail on a link that turns: what the gallery lacks.
LIFT = """
points: {p: [0, 0, 0], q: [0.2, 0, 0.1], r: [0.15, 0.02, 0.1], g: [0.1, 0.1, 0]}
links: {ground: [p, g], arm: [q], shoe: [r], rod: [r, g]}
hinges: {lift: {parent: ground, child: arm, at: [0.3, 0, 0], axis: [0, 1, 0]}}
slides: {rail: {parent: arm, child: shoe, axis: [1, 0, 0]}}
struts: {ram: [p, q]}
input: ram
"""


def test_camera_projection_is_a_rotation_with_z_upright():
    random = np.random.default_rng(1)
    for azimuth, elevation in random.uniform((-7, -1.5), (7, 1.5), (50, 2)):
        places = random.normal(size=(20, 3))
        seen, near = Camera(azimuth, elevation).project(places)
        # The camera's direction becomes x, what is right of it y, and up z.
        turned = Rotation.from_euler('zy', (-azimuth, elevation)).apply(places)
        assert near == pytest.approx(turned[:, 0], abs=1e-14)
        assert seen.real == pytest.approx(turned[:, 1], abs=1e-14)
        assert seen.imag == pytest.approx(turned[:, 2], abs=1e-14)
    upright = Camera(0.3, 0.4).project(np.array([[0.0, 0.0, 1.0]]))[0][0]
    assert upright.real == pytest.approx(0.0, abs=1e-15)
    assert upright.imag > 0.0


@pytest.mark.sample(2)
@pytest.mark.parametrize('name', spatial_linkage_names())
def test_spatial_points_and_joints_are_drawn_in_depth_order(name):
    closure = load(name)
    model = SpaceDrawing(closure)
    inputs = tuple(value + 0.05 for value in closure.linkage.pose.inputs)
    shapes = draw_linkage(prepare_view(closure, inputs), (0.4, 0.5)).shapes
    position = closure.position(*inputs)
    points = closure.points(position)
    dots = {each.name: each.centre for each in shapes if isinstance(each, Circle)}
    # Three hinges through one point are a ball.
    assert dots.keys() - closure.linkage.hinges.keys() == points.keys()
    for point, place in points.items():
        (seen,), _ = Camera(0.4, 0.5).project(np.array([place]))
        assert dots[point] == pytest.approx(seen, abs=1e-12)
    # What two links carry is in one place, in whatever pose.
    places = model.places(position)
    for part in (one for one in model.parts if one.role in ('hinge', 'base')):
        middle = places[list(part.corners)].mean(axis=0)
        bodies = [one for one in model.bodies if one.name in part.joins]
        for body in bodies:
            apart = np.linalg.norm(places[list(body.corners)] - middle, axis=1)
            assert apart.min() < 1e-9
    # The farthest link is painted first, and a ball after the links that it joins.
    order = [(each.role, each.name) for each in shapes]
    _, near = Camera(0.4, 0.5).project(places)
    bodies = sorted(model.bodies, key=lambda one: order.index((one.role, one.name)))
    depths = [near[list(body.corners)].mean() for body in bodies]
    assert depths == sorted(depths)
    for ball in (part for part in model.parts if part.role in ('base', 'ball')):
        joined = [(body.role, body.name) for body in bodies if body.name in ball.joins]
        at = order.index((ball.role, ball.name))
        assert all(order.index(each) < at for each in joined)


@pytest.mark.sample(1)
@pytest.mark.parametrize('name', spatial_linkage_names())
def test_spatial_names_do_not_overlap(name):
    closure = load(name)
    figure = drawn(name)
    written = [box(text) for text in figure.axes[0].texts]
    linkage = closure.linkage
    named = {*linkage.points, *linkage.hinges, *linkage.links} - {'ground'}
    single = {link for link, points in linkage.links.items() if len(points) == 1}
    assert named - single <= {text for text, _ in written}
    names = [each for each in written if each[0] not in (*'xyz',) or each[0] in named]
    assert nearer(names, 0.0) == []
    low, high = figure.bbox.min, figure.bbox.max
    others = [*written, box(figure.axes[0]._left_title)]
    assert [text for text, b in others if (b.min < low).any() or (b.max > high).any()] == []


def test_camera_is_chosen_unless_given():
    closure = load('delta')
    model = SpaceDrawing(closure)
    places = model.places(closure.position(*closure.linkage.pose.inputs))
    chosen = choose_camera(model, places)
    # From above or along an arm, some of its points would be one behind the other.
    seen, _ = chosen.project(np.array([*closure.points(closure.position(0.0, 0.0, 0.0)).values()]))
    assert min(abs(one - other) for one, other in combinations(seen, 2)) > 2.0 * model.size
    assert choose_camera(model, places, 1.0, 0.5) == (1.0, 0.5)
    assert choose_camera(model, places, 1.0).azimuth == 1.0
    title = drawn('rssr', camera=(1.0, 0.5)).axes[0].get_title(loc='left')
    assert title.endswith(f'from azimuth {degrees(1.0):.4g}°, elevation {degrees(0.5):.4g}°')


def test_strut_is_drawn_as_rod_in_a_tube(tmp_path):
    (tmp_path / 'lift.yaml').write_text(LIFT)
    lift = load_in_space(tmp_path / 'lift.yaml')
    model = SpaceDrawing(lift)
    (tube,) = (part for part in model.parts if part.name == 'ram' and part.width > 1.0)
    lengths = []
    (rail,) = (part for part in model.parts if part.role == 'rail')
    (block,) = (part for part in model.parts if part.name == 'rail' and part.width > 1.0)
    for ram in (0.22, 0.224, 0.227):
        position = lift.position(ram)
        places = model.places(position)
        start, end = (places[row] for row in tube.corners)
        lengths.append(float(np.linalg.norm(end - start)))
        assert np.linalg.norm(places[model.points['q']] - start) == pytest.approx(ram)
        ends, moved = (places[list(part.corners)].mean(axis=0) for part in (rail, block))
        slide = dict(zip(lift.joint_names, position.joints, strict=True))['rail']
        assert np.linalg.norm(moved - ends) == pytest.approx(abs(slide), abs=1e-12)
    assert np.ptp(lengths) < 1e-12
