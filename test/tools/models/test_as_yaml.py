# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A robot model where its text is read as YAML: one text, with the same elements and names in it.

``-p robot_description:="$(cat leg.urdf)"`` goes through rcl's parser, and what a substitution of a
launch file comes to through ``yaml.safe_load`` (launch_ros, evaluate_parameters.py).
"""

import re
from xml.etree import ElementTree as ET

from hypothesis import assume, example, given, strategies as st
from linkage_ros.errors import FileError
from linkage_ros.tools.models import model_of, ModelPart, mujoco_model, PartError, urdf_model
import pytest
import yaml

from ...support.scenes import closure_of, LINKAGES

CONFIG = LINKAGES.parent
FILES = [
    *sorted(CONFIG.glob('linkages/*.yaml')),
    *sorted(CONFIG.glob('scenes/*.yaml')),
]
NAMES = ('O2', 'A', 'B', 'P', 'crank', 'coupler', 'rocker', 'crank_joint', 'rocker_joint')


def meant(text):
    """Return the elements that an XML text has, with their attributes and without comments."""
    return [(each.tag, each.attrib) for each in ET.fromstring(text.encode()).iter()]


def check(data):
    """Hold that YAML takes a model for one text, of the same elements."""
    text = data.decode()
    read = yaml.safe_load(text)
    assert isinstance(read, str)
    assert meant(read) == meant(text)
    assert read.split() == text.split(), 'lines are folded, and that is all'


@pytest.mark.sample(10)
@pytest.mark.parametrize('write', [urdf_model, mujoco_model])
@pytest.mark.parametrize('file', FILES, ids=lambda file: f'{file.parent.name}/{file.stem}')
def test_shipped_models_are_one_yaml_text(file, write):
    check(model_of(str(file), write))


def named(names):
    """Return a four-bar whose links, pins and joints have these names."""
    o2, a, b, p, crank, coupler, rocker, crank_joint, rocker_joint = map(yaml_text, names)
    text = f"""
links:
  ground: {{{o2}: [0, 0], O4: [0.1, 0]}}
  {crank}: {{{o2}: [0, 0], {a}: [0.04, 0]}}
  {coupler}: {{{a}: [0, 0], {b}: [0.12, 0], {p}: [0.06, 0.03]}}
  {rocker}: {{O4: [0, 0], {b}: [0.08, 0]}}
input: {{joint: {crank_joint}, parent: ground, child: {crank}}}
assembly: {{{b}: left}}
joints:
  coupler_joint: {{parent: {crank}, child: {coupler}}}
  {rocker_joint}: {{parent: ground, child: {rocker}}}
traced: [{p}]
masses: {{{crank}: {{mass: 0.1, center: [0.02, 0], inertia: 1.5e-5}}}}
"""
    return closure_of(text)


def yaml_text(name):
    quoted = name.replace('\\', '\\\\').replace('"', '\\"')
    return f'"{quoted}"'


PIECES = st.sampled_from([': ', ':', ' #', '#', '- ', '--', '---', "'", '"', '&', '<', '%', '!'])
LETTERS = st.characters(exclude_categories=['C', 'Zl', 'Zp', 'Zs'])
HOSTILE = st.lists(PIECES | LETTERS | st.just(' '), min_size=1, max_size=5).map(''.join)


@given(st.lists(HOSTILE, min_size=9, max_size=9, unique=True), HOSTILE)
@example([f'{name}: ' for name in NAMES], 'leg: v2 # the new one')
@example([f' #{name}' for name in NAMES], '\x00 \t\x85\u2028\udc80')
@example([f'--{name}:' for name in NAMES], '- \n: ')
def test_models_with_odd_names_are_one_yaml_text(names, robot):
    if set(names) & {'ground', 'O4', 'coupler_joint'}:
        return
    assume(not re.search(r'\$[{(]', ''.join([*names, robot])))
    for write in (urdf_model, mujoco_model):
        data = write(robot, [ModelPart(named(names))])
        check(data)
        said = {each.get('name') for each in ET.fromstring(data).iter()}
        assert set(names[4:8]) <= said


EXPRESSIONS = ['${1+1}', 'a$(pwd)', '$${x}', '$$(x)', '${']


@pytest.mark.sample(8)
@pytest.mark.parametrize('odd', EXPRESSIONS)
@pytest.mark.parametrize('place', range(9))
def test_urdf_refuses_names_that_xacro_would_evaluate(place, odd):
    names = [*NAMES]
    names[place] = odd
    with pytest.raises(PartError) as caught:
        urdf_model('robot', [ModelPart(named(NAMES)), ModelPart(named(names), 'second_')])
    assert caught.value.number == 1
    assert odd in caught.value.reason
    assert caught.value.reason.startswith('xacro would evaluate the name ')
    assert mujoco_model('robot', [ModelPart(named(names))])


@pytest.mark.parametrize('odd', EXPRESSIONS)
def test_urdf_refuses_file_names_that_xacro_would_evaluate(odd, tmp_path):
    file = tmp_path / f'{odd}.yaml'
    file.write_bytes((LINKAGES / 'four_bar.yaml').read_bytes())
    with pytest.raises(FileError) as caught:
        model_of(str(file), urdf_model)
    assert str(caught.value) == (
        f"{file}: xacro would evaluate the name '{odd}'; choose a name without ${{ and $("
    )


@pytest.mark.parametrize('name', ['$', '{$}', '$a', '$[x]', '{}', '()'])
def test_urdf_accepts_a_lone_dollar_in_names(name):
    assert name.encode() in urdf_model(name, [ModelPart(named(NAMES))])


def test_urdf_of_an_oddly_named_file_is_yaml(tmp_path):
    file = tmp_path / 'leg: v2 \x01\udc80.yaml'
    file.write_bytes((LINKAGES / 'four_bar.yaml').read_bytes())
    data = model_of(str(file), urdf_model)
    check(data)
    assert ET.fromstring(data).get('name') == 'leg: v2 ��'


def test_ros2_control_macro_is_one_yaml_text():
    check((CONFIG / 'ros2_control' / 'linkage.ros2_control.xacro').read_bytes())


@pytest.mark.parametrize('file', [None, *FILES[::9]], ids=str)
def test_xacro_output_is_one_yaml_text(file, tmp_path):
    """As ``Command(['xacro ', file])`` in a launch file; None is the macro of ros2_control."""
    xacro = pytest.importorskip('xacro')
    robot = tmp_path / 'robot.xacro'
    if file is None:
        include = CONFIG / 'ros2_control' / 'linkage.ros2_control.xacro'
        robot.write_text(
            '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">'
            f'<xacro:include filename="{include}"/>'
            '<xacro:linkage_ros2_control name="leg" joints="a b"/></robot>'
        )
    else:
        robot.write_bytes(model_of(str(file), urdf_model))
    text = xacro.process_file(str(robot)).toprettyxml(indent='  ')
    assert meant(yaml.safe_load(text)) == meant(text)
