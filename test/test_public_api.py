# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""`import linkage_ros` offers names, errors with a remedy, short texts and pictures."""

import ast
from collections.abc import Callable
import doctest
import json
from pathlib import Path
import pydoc
import re
import subprocess
import sys
from typing import Any
import xml.etree.ElementTree as ET

import linkage_ros as lr
from linkage_ros.resources import shipped_path
import pytest

PACKAGE = Path(lr.__file__).parent
FOUR_BAR, FIVE_BAR = lr.load('four_bar'), lr.load('five_bar')
ROCKER = lr.load('double_rocker')
POSITION, OPEN = FOUR_BAR.position(0.7), ROCKER.position(2.5)
RANGES = ((1.0, 2.0), (0.8, 1.8), (2.4, 3.9))
SCENE = shipped_path('scenes/demo.yaml')
VELOCITY = FOUR_BAR.velocity(POSITION, 3.0)


def test_docstring_examples_of_the_package_run():
    failed, tried = doctest.testmod(lr)
    assert failed == 0
    assert tried > 15


@pytest.mark.parametrize(
    ('program', 'absent'),
    [
        ('import linkage_ros', ('linkage_ros.errors', 'yaml')),
        ('import linkage_ros as lr; lr.load("jansen_leg").position(0.7)["leg_joint"]', ()),
        ('import linkage_ros as lr; lr.svg(lr.load("four_bar"))', ('matplotlib',)),
    ],
    ids=['import', 'position', 'picture'],
)
def test_import_loads_no_unused_modules(program, absent):
    absent = (*absent, 'numpy', 'rclpy')
    program += f'; import sys; assert not {{*{absent!r}}} & {{*sys.modules}}'
    subprocess.run([sys.executable, '-c', program], check=True)


# Said here once more: a name that goes, or comes, is a decision, which the stub alone would not
# show.
NAMES = {
    *('Bag', 'BagError', 'BagMessage', 'read_bag', 'JointStateReader', 'Rejection'),
    *('ArrayFunctions', 'Batch', 'Closure', 'InputRange', 'Status'),
    *('Acceleration', 'Position', 'Velocity', 'load', 'linkage_names', 'svg', 'LinkagePage'),
    *('Input', 'Limits', 'Linkage', 'Mass', 'Ratio', 'RevoluteJoint', 'SlideJoint', 'Slider'),
    *('PlanarClosure', 'SpaceClosure', 'SpaceLinkage', 'SpatialJoint', 'SpatialMass'),
    *('Pipeline', 'Scene', 'Tick', 'load_scene', 'recorded_scene', 'scene_names'),
    *('DefinitionError', 'FileError', 'LinkageError', 'SynthesisError'),
    *('Assessment', 'Design', 'PathTask', 'Pose', 'assess', 'from_fixed_pivots'),
    *('from_moving_pivots', 'generate_function', 'generate_path'),
}


def test_type_stub_names_equal_the_public_names():
    stub = ast.parse((PACKAGE / '__init__.pyi').read_text('utf-8'))
    homes = {
        name.asname: (node.module, name.name)
        for node in stub.body
        if isinstance(node, ast.ImportFrom)
        for name in node.names
    }
    assert {*homes} == {*lr.__all__} == NAMES
    for name, (module, original) in homes.items():
        assert getattr(lr, name) is getattr(sys.modules[module], original)
    assert (PACKAGE / 'py.typed').exists()


def test_dir_and_help_list_every_public_name():
    assert {*NAMES, '__version__'} <= {*dir(lr)}
    text = pydoc.plain(pydoc.render_doc(lr))
    assert [name for name in sorted(NAMES) if not re.search(rf'\b{name}\b', text)] == []
    assert 'Close the loops.' in text


def test_position_maps_joint_names_to_values():
    acceleration = FOUR_BAR.acceleration(POSITION, VELOCITY, 0.5)
    for found in (POSITION, VELOCITY, acceleration):
        assert dict(found) == dict(zip(FOUR_BAR.linkage.joints, found.joints, strict=True))
        assert found['rocker_joint'] == found.joints[1]
    assert 'rocker_joint' in POSITION
    assert 'crank_joint' not in POSITION


@pytest.mark.parametrize('name', ['four_bar', 'elliptic_trammel', 'five_bar', 'class_3'])
def test_position_knows_its_inputs_and_points(name):
    closure = lr.load(name)
    inputs = tuple(0.5 * (r.lowest + r.highest) for r in closure.input_ranges[:1]) or (2.0, 1.0)
    position = closure.position(*inputs)
    assert position.inputs == inputs
    for (_, point), place in closure.points(position).items():
        assert position.points[point] == pytest.approx(place, abs=1e-12)


def test_positions_of_two_equal_closures_are_equal():
    again = lr.load('four_bar')
    assert again.position(0.7) == POSITION != again.position(0.8)
    assert again.velocity(again.position(0.7), 3.0) == VELOCITY


@pytest.mark.parametrize(
    ('shown', 'text'),
    [
        (FOUR_BAR, '<PlanarClosure four_bar: 1 input, 2 joints>'),
        (FIVE_BAR, '<PlanarClosure five_bar: 2 inputs, 2 joints>'),
        (lr.Closure(FOUR_BAR.linkage), '<PlanarClosure: 1 input, 2 joints>'),
        (lr.load_scene('two_fingers'), '<Scene two_fingers: 2 linkages, 500 Hz>'),
        (POSITION, '<Position closed: coupler_joint -0.346042, rocker_joint 1.00103>'),
        (OPEN, '<Position open by 0.0619 m>'),
        (VELOCITY, '<Velocity: coupler_joint -3.49184, rocker_joint 0.843928>'),
    ],
)
def test_repr_of_public_objects_is_short(shown, text):
    assert repr(shown) == text


@pytest.mark.parametrize('name', [*lr.linkage_names(), 'wishbone', 'rssr'])
def test_notebook_shows_a_picture_of_every_linkage(name):
    closure = lr.load(name)
    root = ET.fromstring(closure._repr_svg_())
    box = [float(number) for number in root.attrib['viewBox'].split()]
    assert 400.0 < max(box) < 440.0
    title, *shapes = root
    assert title.text == repr(closure)
    assert {shape.tag.rpartition('}')[2] for shape in shapes} == {'polyline', 'circle'}
    pixels = [
        tuple(map(float, pixel.split(',')))
        for shape in shapes
        for pixel in shape.get('points', '').split()
    ]
    assert all(0.0 <= x <= box[2] and 0.0 <= y <= box[3] for x, y in pixels)


def test_picture_places_the_pins_to_scale():
    root = ET.fromstring(POSITION._repr_svg_())
    circles = [shape for shape in root if shape.tag.endswith('circle')]
    pins = [complex(float(pin.attrib['cx']), -float(pin.attrib['cy'])) for pin in circles]
    points = [POSITION.points[name] for name in ('O2', 'O4', 'A', 'B')]
    scale = abs(pins[1] - pins[0]) / abs(points[1] - points[0])
    for pin, point in zip(pins, points, strict=True):
        assert pin - pins[0] == pytest.approx(scale * (point - points[0]), abs=0.2)


def test_open_position_has_no_picture():
    assert OPEN._repr_svg_() is None
    with pytest.raises(lr.LinkageError, match='open, the links miss each other'):
        lr.svg(OPEN)


# What is no input and no rate: test/kinematics/test_wrong_inputs.py.
ERRORS: list[tuple[Callable[[], Any], type[Exception], str]] = [
    (lambda: lr.laod, AttributeError, "module 'linkage_ros' has no attribute 'laod'"),
    (lambda: lr.load('jansen'), lr.FileError, 'jansen: is neither a file nor the name'),
    (lambda: lr.load('jansen'), lr.FileError, "did you mean 'jansen_leg'?"),
    (lambda: lr.load('demo'), lr.FileError, 'demo: is a shipped scene, not a linkage; name a'),
    (lambda: lr.load('x'), lr.FileError, 'or one of andrews_squeezer, class_3, '),
    (lambda: lr.load('hoeken.yaml'), lr.FileError, "is not a file; did you mean 'hoeken'?"),
    (lambda: lr.load('none.yaml'), lr.FileError, 'none.yaml: cannot be read'),
    (lambda: lr.load(''), lr.FileError, "'': is neither a file nor the name"),
    (lambda: lr.load(3), TypeError, '3 is neither a path nor a name; name a file, or one of a'),
    (lambda: lr.load(SCENE), lr.FileError, 'demo.yaml: is a scene; name its linkage, '),
    (lambda: lr.Pipeline('demo'), TypeError, "scene: 'demo' is not a Scene; load_scene() reads"),
    (lambda: lr.load_scene('dem'), lr.FileError, "did you mean 'demo'?"),
    (lambda: FIVE_BAR.position(1, None), TypeError, 'inputs: None is not a number; solve()'),
    (lambda: FOUR_BAR.position(1j), TypeError, 'inputs: 1j is not a number; solve()'),
    (lambda: lr.Closure('four_bar'), TypeError, "'four_bar' is not a Linkage or SpaceL"),
    (lambda: lr.svg('four_bar'), TypeError, "svg: 'four_bar' is not drawn; give a Closure or a"),
    (lambda: POSITION['rocker'], KeyError, "'rocker' is not a published joint; use coupler_joint"),
    (lambda: POSITION[1], KeyError, '1 is not a published joint; use coupler_joint, rocker_joint'),
    (lambda: OPEN['coupler_joint'], ValueError, '<Position open by 0.0619 m> has no joint values'),
    (
        lambda: OPEN.points, ValueError,
        'points: <Position open by 0.0619 m> has none; check its st',
    ),
    (lambda: FOUR_BAR.velocity(0.7, 1.0), TypeError, 'position: 0.7 is not from <PlanarClosure'),
    (lambda: FOUR_BAR.velocity(OPEN, 1.0), TypeError, 'position: <Position open by 0.0619 m> is'),
    (
        lambda: FOUR_BAR.acceleration(POSITION, POSITION.joints, 0.0), TypeError,
        'velocity: (-0.3460422454115175, 1.001032173019738) is not from <PlanarClosure four_bar',
    ),
    (
        lambda: lr.generate_function('x', *RANGES, points=2), lr.SynthesisError,
        'points: there are 2',
    ),
    (lambda: lr.generate_function(abs, *RANGES), TypeError, 'is not a string; write it as'),
    (lambda: lr.generate_function('log10(', *RANGES), lr.SynthesisError, 'log10('),
]  # fmt: skip


@pytest.mark.parametrize(('call', 'kind', 'text'), ERRORS)
def test_public_errors_name_a_remedy(call, kind, text):
    with pytest.raises(kind) as caught:
        call()
    assert text in str(caught.value).replace('\\', '')
    assert '\n' not in str(caught.value)


def test_load_reads_a_shipped_name_or_a_path(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path('hoeken').write_text(json.dumps({'four_bar': {'a': 1, 'b': 3, 'c': 2, 'd': 2.5}}))
    shipped = lr.load('hoeken').linkage
    for path in ('./hoeken', Path('hoeken')):
        assert lr.load(path).linkage != shipped
    Path('hoeken').unlink()
    assert lr.load('hoeken').linkage == shipped


def test_function_of_seven_points_is_fitted():
    pytest.importorskip('scipy')
    design = lr.generate_function('log10(x)', *RANGES, points=7)
    assert len(design.wanted) == 7
    assert max(abs(met.angle) for met in lr.assess(design).met) < 0.01
