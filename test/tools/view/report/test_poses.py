# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Links stand where their messages say, in the whole gallery."""

from base64 import b64decode
from cmath import exp, rect
from dataclasses import replace
import json

from linkage_ros.bag import read_bag
from linkage_ros.description import load_scene, read_linkage, read_yaml, Units
from linkage_ros.kinematics import (
    carried_shapes,
    Circle,
    Closure,
    draw_shapes,
    frames_of_links,
    InputSweep,
    prepare_view,
    sample_inputs,
    usual_inputs,
)
from linkage_ros.messages import JointStateWriter
from linkage_ros.resources import shipped_path
from linkage_ros.tick import Pipeline
from linkage_ros.tools.drawing import drawn_in_frames
from linkage_ros.tools.view.report import link_poses, page_data
import numpy as np
import pytest

from .runs import BEGIN, MS, read
from ....node.ticked import Moment, run

# Links are at the closure's poses, from the published joints alone, in the whole gallery.


FILES = sorted(shipped_path('linkages/four_bar.yaml').parent.glob('*.yaml'))
GROUND, CRANK, COUPLER, ROCKER = 0.10, 0.04, 0.12, 0.08


def closure_of(file):
    return Closure(read_linkage(read_yaml(str(file))[0]))


def published(closure, positions, inputs, prefix=''):
    """Return what messages say of joints, by name."""
    joints = np.array([position.joints for position in positions]).T
    values = dict(zip(closure.linkage.joints, joints, strict=True))
    for index, given in enumerate(closure.linkage.inputs):
        values[given.joint] = np.array([each[index] for each in inputs])
    return {prefix + name: value for name, value in values.items()}


def some(closure):
    """Return inputs at which a linkage closes, and its positions there."""
    usual = usual_inputs(closure)
    interval = InputSweep(closure, usual).range_about(usual[0])
    values = sample_inputs(interval, 24) if interval else [usual[0]]
    inputs = [(value, *usual[1:]) for value in values]
    found = [(each, closure.position(*each)) for each in inputs]
    return zip(*((each, position) for each, position in found if position.joints), strict=True)


@pytest.mark.sample(7)
@pytest.mark.parametrize('file', FILES, ids=lambda file: file.stem)
def test_report_points_equal_those_of_the_closure(file):
    closure = closure_of(file)
    inputs, positions = some(closure)
    names = [f'p_{given.joint}' for given in closure.linkage.inputs]
    found = link_poses(closure, 'p_', published(closure, positions, inputs, 'p_'), names)
    assert found.reason == ''
    assert len(inputs) > 1
    size = max(abs(place) for position in positions for place in closure.points(position).values())
    for i, position in enumerate(positions):
        for (link, point), place in closure.points(position).items():
            if link not in closure.linkage.links or link == 'ground':
                continue
            x, y, angle = found.frames[i, found.links.index(link)]
            at = complex(*closure.linkage.links[link][point])
            assert abs(complex(x, y) + at * rect(1.0, angle) - place) < 1e-12 * size
    assert found.apart.max() < 1e-12 * size


@pytest.mark.sample(3)
@pytest.mark.parametrize('file', FILES, ids=lambda file: file.stem)
def test_report_shapes_equal_those_of_draw(file):
    closure = closure_of(file)
    shown = prepare_view(closure, usual_inputs(closure))
    data = drawn_in_frames(shown)
    frames = {**frames_of_links(closure, shown.position), 'ground': (0j, 0.0)}
    size = data['size']
    drawn = carried_shapes(closure, shown.position, size, shown.sweep.travels)
    assert len(data['shapes']) == len(
        draw_shapes(closure, shown.position, size, shown.sweep.travels)
    )
    for told, (link, shape) in zip(data['shapes'], drawn, strict=True):
        assert (told['link'], told['role']) == (link, shape.role)
        place, angle = frames[told['link']]
        flat = told['points']
        points = [
            place + complex(x, y) * exp(1j * angle)
            for x, y in zip(flat[::2], flat[1::2], strict=True)
        ]
        if isinstance(shape, Circle):
            expected = (shape.centre,)
        else:
            expected = shape.corners if told.get('closed') else (shape.start, shape.end)
        assert max(abs(a - b) for a, b in zip(points, expected, strict=True)) < 1e-3 * size


def four_bar():
    return closure_of(shipped_path('linkages/four_bar.yaml'))


def test_wrong_rocker_angle_separates_links_by_its_chord():
    closure = four_bar()
    position = closure.position(1.0)
    values = published(closure, [position] * 2, [(1.0,)] * 2)
    values['rocker_joint'] = values['rocker_joint'] + np.array([0.0, 0.3])
    found = link_poses(closure, '', values, ['crank_joint'])
    rocker = abs(complex(*closure.linkage.links['rocker']['B']))
    # The chord of the angle.
    assert found.apart == pytest.approx([0.0, 2 * rocker * np.sin(0.15)], abs=1e-12)


def test_missing_joint_value_gives_no_pose():
    closure = four_bar()
    position = closure.position(1.0)
    values = published(closure, [position] * 2, [(1.0,)] * 2)
    values['coupler_joint'] = values['coupler_joint'] + np.array([0.0, np.nan])
    found = link_poses(closure, '', values, ['crank_joint'])
    assert np.isfinite(found.frames[0]).all()
    assert np.isnan(found.frames[1]).all()
    assert np.isnan(found.apart[1])


def test_undetermined_link_is_drawn_by_closing_the_loops():
    whole = four_bar()
    joints = {k: v for k, v in whole.linkage.joints.items() if k != 'coupler_joint'}
    closure = Closure(replace(whole.linkage, joints=joints))
    inputs = [(1.0,), (np.nan,), (2.0,)]
    values = {'crank_joint': np.array([1.0, np.nan, 2.0]), 'rocker_joint': np.zeros(3)}
    found = link_poses(closure, '', values, ['crank_joint'])
    assert 'coupler' in found.reason
    assert np.isnan(found.frames[1]).all()
    for i in (0, 2):
        frames = frames_of_links(whole, whole.position(*inputs[i]))
        for index, link in enumerate(found.links):
            x, y, angle = found.frames[i, index]
            assert abs(complex(x, y) - frames[link].place) < 1e-12
            assert abs(rect(1.0, angle) - rect(1.0, frames[link].angle)) < 1e-12


# From its bag, every linkage of the gallery is drawn at its recorded poses.


TICKS = 40


def moments(scene):
    """Return ticks over the middle of the range, each with its sample of all inputs."""
    (line,) = Pipeline(scene).linkages
    (scene_linkage,) = scene.linkages
    usual = usual_inputs(line.closure)
    interval = InputSweep(line.closure, usual).range_about(usual[0])
    values = sample_inputs(interval, TICKS) if interval else [usual[0]] * TICKS
    write = JointStateWriter(scene_linkage.input_names).write
    for tick, value in enumerate(values):
        time = BEGIN + tick * MS
        given = (value, *usual[1:])
        yield Moment(time, (write(time, given, [0.0] * len(given)),))


def of(text, kind):
    return np.frombuffer(b64decode(text), kind)


@pytest.mark.sample(3)
@pytest.mark.parametrize('file', FILES, ids=lambda file: file.stem)
def test_gallery_links_are_drawn_at_the_recorded_inputs(tmp_path, file):
    scene_file = tmp_path / 's.yaml'
    scene_file.write_text(f'linkage: {file}\n')
    scene = load_scene(scene_file)
    bag = run(tmp_path / 'bag', scene_file, list(moments(scene))).bag
    found = read(read_bag(bag.path))
    data = json.loads(json.dumps(page_data(found, wrapped=False, units=Units()), allow_nan=False))
    (linkage,) = data['linkages']
    # By the published joints, whatever linkage of the gallery; none is solved again.
    assert linkage['untold'] == ''
    assert linkage['undrawn'] == ''
    frames = of(linkage['poses'], '<f4').reshape(-1, len(linkage['links']), 3)
    assert len(frames) == len(of(data['frames']['times'], '<f8')) > TICKS // 2
    inputs = [of(data['frames']['values'][name], '<f8') for name in linkage['inputs']]
    closure = found.linkages[0].closure
    position = closure.position(*(each[0] for each in inputs))
    size = max(map(abs, closure.points(position).values()))
    for index, given in enumerate(zip(*(each.tolist() for each in inputs), strict=True)):
        points = closure.points(closure.position(*given))
        for (link, point), place in points.items():
            if link not in closure.linkage.links or link == 'ground':
                continue
            x, y, angle = frames[index, linkage['links'].index(link)].astype(float)
            at = complex(*closure.linkage.links[link][point])
            # Of single precision, as a picture has it.
            assert abs(complex(x, y) + at * rect(1.0, angle) - place) < 2e-6 * size
    apart = of(linkage['apart'], '<f4')
    assert apart.max() < 1e-12 * size
    drawn = {shape['link'] for shape in linkage['drawn']['shapes']}
    assert drawn <= {*linkage['links'], 'ground'}
