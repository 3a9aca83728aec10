# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The URDF of a linkage: valid, with limits that its joints keep, and read back."""

from collections import Counter
from math import pi, remainder, tau
from xml.etree import ElementTree as ET

from linkage_ros.description import linkage_text, load, load_scene
from linkage_ros.errors import LinkageError
from linkage_ros.kinematics import Closure, InputSweep, sample_inputs, usual_inputs
from linkage_ros.messages import JointStateWriter
from linkage_ros.tick import Pipeline
from linkage_ros.tools.models import (
    make_scene_model,
    model_of,
    ModelPart,
    PartError,
    urdf_model,
)
import pytest

from .odd import closure_of, ODD, UNTOLD
from .walked import BEGIN, heard, moving, moving_text, MS, said, Walked
from ...support.robots import robot_of
from ...support.scenes import linkage_of, LINKAGES, ONE_INPUT, scene_of, size_of

# The URDF of a linkage: valid, reproducible, with limits that its joints keep.


SCENES = LINKAGES.parent / 'scenes'
CASES = [*ONE_INPUT, 'five_bar', *ODD]
URDF_KINDS = {'revolute', 'continuous', 'prismatic', 'fixed'}


def closure(name):
    return closure_of(name) if name in ODD else load(LINKAGES / f'{name}.yaml')


def numbers(element, key):
    return [float(part) for part in element.get(key).split()]


@pytest.mark.sample(12)
@pytest.mark.parametrize('name', CASES)
def test_written_urdf_is_valid(name):
    """As check_urdf has it, and what robot_state_publisher warns of."""
    robot = ET.fromstring(urdf_model('it', [ModelPart(closure(name))]))
    links = [link.get('name') for link in robot.findall('link')]
    joints = robot.findall('joint')
    names = [joint.get('name') for joint in joints]
    assert max(Counter(links).values()) == max(Counter(names).values()) == 1
    children = [joint.find('child').get('link') for joint in joints]
    assert max(Counter(children).values()) == 1, 'a link with two parents'
    assert set(links) - set(children) == {'ground'}, 'not one root'
    above = {j.find('child').get('link'): j.find('parent').get('link') for j in joints}
    for link in children:
        seen = [link]
        while seen[-1] != 'ground':
            seen.append(above[seen[-1]])
            assert len(seen) <= len(links), 'a ring'
    own = {j.get('name') for j in joints if j.find('mimic') is None}
    for joint in joints:
        kind, limit = joint.get('type'), joint.find('limit')
        assert kind in URDF_KINDS
        if kind == 'fixed':
            continue
        assert sum(x * x for x in numbers(joint.find('axis'), 'xyz')) == pytest.approx(1.0)
        assert float(limit.get('effort')) > 0.0 < float(limit.get('velocity'))
        if kind != 'continuous':
            assert float(limit.get('lower')) < float(limit.get('upper'))
        if (mimic := joint.find('mimic')) is not None:
            assert mimic.get('joint') in own
    assert robot.find("link[@name='ground']/inertial") is None
    for inertia in robot.iter('inertia'):
        ixx, iyy, izz = (float(inertia.get(key)) for key in ('ixx', 'iyy', 'izz'))
        assert ixx == iyy == izz / 2
    colours = Counter(material.get('name') for material in robot.iter('material') if len(material))
    assert set(colours.values()) == {1}, 'a colour is said twice'


@pytest.mark.parametrize('name', CASES[::7])
def test_same_linkage_gives_the_same_urdf_bytes(name):
    assert urdf_model('it', [ModelPart(closure(name))]) == urdf_model(
        'it', [ModelPart(closure(name))]
    )


def limits_of(data):
    return {
        joint.get('name'): (joint.get('type'), joint.find('limit'))
        for joint in ET.fromstring(data).findall('joint')
        if joint.get('type') != 'fixed'
    }


@pytest.mark.sample(5)
@pytest.mark.parametrize('name', [*ONE_INPUT, *ODD])
def test_urdf_limits_enclose_the_published_joints_closely(name):
    """A node that starts where the linkage starts publishes nothing beyond the limits."""
    file = LINKAGES / f'{name}.yaml'
    pipeline = moving_text(ODD[name]) if name in ODD else moving(file)
    limits = limits_of(urdf_model('it', [ModelPart(pipeline.closures[0])]))
    size = size_of(pipeline.closures[0])
    seen = {}
    for names, positions in said(pipeline, every=25_000_000, count=280):
        for joint, value in zip(names, positions, strict=True):
            seen.setdefault(joint, []).append(value)
    for joint, values in seen.items():
        kind, limit = limits[joint]
        if kind == 'continuous':
            # The sine over 96 % of a range stays 0.29 rad below where bar and tube come to π.
            turns = max(values) - min(values) > 2.0 * pi - 0.1
            assert turns or max(map(abs, values)) > pi - 0.3, 'neither turns nor comes to π'
            continue
        lower, upper = float(limit.get('lower')), float(limit.get('upper'))
        assert lower <= min(values)
        assert max(values) <= upper
        # A sine over 96 % of a range leaves out much where joints go as the root of it.
        slack = 0.35 * (upper - lower) + 0.01 * (size if kind == 'prismatic' else 1.0)
        assert min(values) - lower < slack
        assert upper - max(values) < slack


def from_topic(text, angles):
    """Return a scene of a linkage that messages turn."""
    return scene_of(f'rate: 0\npublish_input: true\nangles: {angles}\n', text)


def swept(pipeline, name, values):
    """Yield what is said while an input goes through values."""
    writer = JointStateWriter([name])
    for index, value in enumerate(values):
        now = BEGIN + index * MS
        assert pipeline.offer(writer.write(now, [value], [0.0]), now) is None
        if message := pipeline.tick(now).message:
            yield heard(message)


@pytest.mark.sample(10)
@pytest.mark.parametrize('angles', ['continuous', 'wrapped'])
@pytest.mark.parametrize('name', [*ONE_INPUT, *ODD])
def test_urdf_limits_enclose_the_whole_input_range(name, angles):
    """Wherever in its range the input is when the node starts, and whichever way it goes on."""
    text = ODD[name].encode() if name in ODD else (LINKAGES / f'{name}.yaml').read_bytes()
    scene = from_topic(text, angles)
    closures = Pipeline(scene).closures
    limits = limits_of(make_scene_model(scene, closures, urdf_model))
    (given,) = closures[0].linkage.inputs
    interval = InputSweep(closures[0]).range_about(*usual_inputs(closures[0]))
    values = sample_inputs(interval, 300)
    seen = 0
    for first in range(0, len(values), len(values) // 4):
        for way in (values[first:], values[first::-1]):
            for names, positions in swept(Pipeline(scene, closures), given.joint, way):
                for joint, value in zip(names, positions, strict=True):
                    kind, limit = limits[joint]
                    if kind != 'continuous':
                        lower, upper = float(limit.get('lower')), float(limit.get('upper'))
                        assert lower <= value <= upper, joint
                    seen += 1
    assert seen > 4 * 300


@pytest.mark.parametrize(
    ('angles', 'limits', 'kind'),
    [
        ('continuous', '[2.0, 4.0]', 'revolute'),
        ('wrapped', '[2.0, 4.0]', 'continuous'),
        ('wrapped', '[-4.0, 2.0]', 'continuous'),
        ('wrapped', '[0.5, 3.0]', 'revolute'),
        ('wrapped', '[0.5, .inf]', 'continuous'),
    ],
)
def test_wrapped_angles_beyond_limits_become_continuous_joints(angles, limits, kind):
    crank = f'input: {{limits: {limits}, effort: 2}}'
    text = f'four_bar: {{a: 0.04, b: 0.12, c: 0.08, d: 0.1, {crank}}}'
    scene = from_topic(text.encode(), angles)
    model = make_scene_model(scene, Pipeline(scene).closures, urdf_model)
    found, limit = limits_of(model)['crank_joint']
    assert found == kind
    assert limit.get('effort') == '2'


def test_urdf_limits_equal_the_dead_centre_angles():
    """The rocker of a crank-rocker turns back where crank and coupler are in line."""
    limits = limits_of(urdf_model('it', [ModelPart(closure('four_bar'))]))
    # Of the triangles 0.16, 0.1, 0.08 and 0.08, 0.1, 0.08: the angle at O4, from the ground's x.
    expected = (0.9569, 2.2460)
    kind, limit = limits['rocker_joint']
    assert kind == 'revolute'
    assert float(limit.get('lower')) == pytest.approx(expected[0], abs=2e-3)
    assert float(limit.get('upper')) == pytest.approx(expected[1], abs=2e-3)
    assert limits['crank_joint'][0] == limits['coupler_joint'][0] == 'continuous'
    assert limits['crank_joint'][1].get('lower') is None
    # The piston between its dead centres: sqrt((0.14 ± 0.04)² − 0.01²).
    _, limit = limits_of(urdf_model('it', [ModelPart(closure('slider_crank'))]))['piston_slide']
    assert float(limit.get('lower')) == pytest.approx((0.10**2 - 0.01**2) ** 0.5, abs=4e-4)
    assert float(limit.get('upper')) == pytest.approx((0.18**2 - 0.01**2) ** 0.5, abs=4e-4)
    assert (
        limits_of(urdf_model('it', [ModelPart(closure('five_bar'))]))['left_elbow'][0]
        == 'continuous'
    )


@pytest.mark.parametrize('name', UNTOLD)
def test_urdf_refuses_undetermined_links_with_a_remedy(name):
    text, remedy = UNTOLD[name]
    linkage = linkage_of(text)
    with pytest.raises(PartError) as caught:
        urdf_model('it', [ModelPart(Closure(linkage))])
    assert str(caught.value) == f'joints: the published joints do not determine where {remedy}'
    # What the remedy says is one.
    added = str(caught.value).partition('add to joints: ')[2]
    whole = text.replace('joints: {', f'joints: {{{added}, ')
    urdf_model('it', [ModelPart(Closure(linkage_of(whole)))])


def test_urdf_of_two_linkages_has_prefixes_and_one_root():
    data = model_of(str(SCENES / 'two_fingers.yaml'), urdf_model)
    model = Walked(data)
    pipeline = Pipeline(load_scene(SCENES / 'two_fingers.yaml'))
    count = 0
    for names, positions in said(pipeline, every=20_000_000, count=100):
        model.pose(names, positions)
        for side in ('left', 'right'):
            one, other = (f'{side}_B_on_{side}_{link}' for link in ('coupler', 'rocker'))
            assert abs(model.place(one) - model.place(other)) < 1e-12 * 0.12
        count += 1
    assert count == 100
    assert model.model.base_link == 'world'


def test_urdf_contains_the_toleranced_links():
    """A scene with tolerances publishes the joints of the linkage as it was made."""
    file = SCENES / 'worn_press.yaml'
    scene = load_scene(file)
    model, made = model_of(str(file), urdf_model), Pipeline(scene).closures[0].linkage
    assert made.links != scene.linkages[0].linkage.links
    (place,) = (
        joint.find('origin')
        for joint in ET.fromstring(model).iter('joint')
        if joint.get('type') and joint.get('name') == 'rod_joint'
    )
    (x0, _), (x1, _) = made.links['crank']['O2'], made.links['crank']['A']
    assert numbers(place, 'xyz')[0] == x1 - x0


def test_urdf_refuses_duplicate_prefixed_names(tmp_path):
    four_bar = LINKAGES / 'four_bar.yaml'
    other = tmp_path / 'other.yaml'
    other.write_text(four_bar.read_text().replace('crank_joint', 'b_crank_joint'))
    scene = tmp_path / 'scene.yaml'
    scene.write_text(
        'linkages:\n'
        f'  - {{name: a, linkage: {other}, drive: {{constant_rate: {{rate: 1}}}}}}\n'
        f'  - {{name: a_b, linkage: {four_bar}, drive: {{constant_rate: {{rate: 1}}}}}}\n'
    )
    with pytest.raises(LinkageError, match='a second linkage publishes a_b_crank_joint'):
        model_of(str(scene), urdf_model)


@pytest.mark.parametrize('name', ONE_INPUT)
def test_pinocchio_reads_the_urdf(name):
    """A reader that uses urdfdom, as robot_state_publisher does."""
    pinocchio = pytest.importorskip('pinocchio')
    data = urdf_model('it', [ModelPart(closure(name))])
    model = pinocchio.buildModelFromXML(data.decode())
    assert set(model.names) - {'universe'} == set(limits_of(data))


# Linkage to URDF and back: the joints have the same values over the whole range.


WITHIN = 1e-12


def back(closure):
    """Return a linkage that went through URDF and through the text of a linkage file."""
    robot = robot_of(urdf_model('it', [ModelPart(closure)]))
    return Closure(linkage_of(linkage_text(robot.linkage)))


def inputs_of(closure):
    """Return inputs all over the range, but for its very ends, where rounding opens loops."""
    if len(closure.linkage.inputs) > 1:
        return [(1.3 + 0.05 * i, 1.8 - 0.03 * i) for i in range(15)]
    interval = InputSweep(closure).widest_range
    return [(value,) for value in sample_inputs(interval, 200)[1:-1]]


def differences(one, other):
    """Yield by how much each joint of the one differs in the other, of its size."""
    places = {name: i for i, name in enumerate(other.linkage.joints)}
    for inputs in inputs_of(one):
        here, there = one.position(*inputs), other.position(*inputs)
        assert here.joints
        assert there.joints, inputs
        for name, value, turns in zip(one.linkage.joints, here.joints, one.turning, strict=True):
            if name in places:
                off = there.joints[places[name]] - value
                yield abs(remainder(off, tau)) if turns else abs(off) / size_of(one)


@pytest.mark.sample(7)
@pytest.mark.parametrize('name', [*ONE_INPUT, 'five_bar'])
def test_gallery_linkage_survives_the_urdf_round_trip(name):
    closure = load(LINKAGES / f'{name}.yaml')
    again = back(closure)
    assert list(again.linkage.joints) == list(closure.linkage.joints)
    assert again.linkage.limits == closure.linkage.limits
    assert [e.joint for e in again.linkage.inputs] == [e.joint for e in closure.linkage.inputs]
    assert max(differences(closure, again)) <= WITHIN
    weighed = {link for link, mass in again.linkage.masses.items() if mass.mass}
    assert weighed == {link for link, mass in closure.linkage.masses.items() if mass.mass}
    for link, mass in closure.linkage.masses.items():
        origin = next(iter(again.linkage.links[link].values()))
        assert origin == (0.0, 0.0)
        assert again.linkage.masses[link].mass == mass.mass
        assert again.linkage.masses[link].inertia == pytest.approx(mass.inertia, rel=1e-15)


@pytest.mark.sample(6)
@pytest.mark.parametrize('name', ODD)
def test_odd_frames_survive_the_urdf_round_trip(name):
    closure = closure_of(name)
    again = back(closure)
    lost = set(closure.linkage.joints) - set(again.linkage.joints)
    assert len(lost) <= LOST.get(name, 0)
    assert max(differences(closure, again)) <= WITHIN


LOST = {'one more than needed, and the crank once more': 3, 'a rod that only slides hold': 1}
"""Joints that no link hangs by; those of links that others tell of are left out."""
