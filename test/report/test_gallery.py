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

"""Every linkage of the gallery is drawn where its messages say that it was, from its bag."""

from __future__ import annotations

from base64 import b64decode
from cmath import rect
import json

from linkage_ros.bag.reader import read_bag
from linkage_ros.kinematics.survey import samples, usual_inputs, Way
from linkage_ros.messages.joint_state import JointStateWriter
from linkage_ros.pipeline import Pipeline
from linkage_ros.report.data import page_data
from linkage_ros.scene.load import load_scene
from linkage_ros.shipped import shipped
import numpy as np
import pytest

from .runs import BEGIN, MS, read
from ..ros.ticked import Moment, run

FILES = sorted(shipped('linkages/four_bar.yaml').parent.glob('*.yaml'))
TICKS = 40


def moments(scene):
    """Return ticks over the middle of the range, each with its sample of all inputs."""
    (line,) = Pipeline(scene).lines
    (member,) = scene.members
    usual = usual_inputs(line.closure)
    interval = Way(line.closure, usual).range_about(usual[0])
    values = samples(interval, TICKS) if interval else [usual[0]] * TICKS
    write = JointStateWriter(member.inputs).write
    for tick, value in enumerate(values):
        time = BEGIN + tick * MS
        given = (value, *usual[1:])
        yield Moment(time, (write(time, given, [0.0] * len(given)),))


def of(text, kind):
    return np.frombuffer(b64decode(text), kind)


@pytest.mark.parametrize('file', FILES, ids=lambda file: file.stem)
def test_links_are_drawn_where_the_loops_close_at_the_recorded_inputs(tmp_path, file):
    scene_file = tmp_path / 's.yaml'
    scene_file.write_text(f'linkage: {file}\n')
    scene = load_scene(scene_file)
    bag = run(tmp_path / 'bag', scene_file, list(moments(scene))).bag
    found = read(read_bag(bag.path))
    data = json.loads(json.dumps(page_data(found, wrapped=False), allow_nan=False))
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
    for number, given in enumerate(zip(*(each.tolist() for each in inputs), strict=True)):
        points = closure.points(closure.position(*given))
        for (link, point), place in points.items():
            if link not in closure.linkage.links or link == 'ground':
                continue
            x, y, angle = frames[number, linkage['links'].index(link)].astype(float)
            at = complex(*closure.linkage.links[link][point])
            # Of single precision, as a picture has it.
            assert abs(complex(x, y) + at * rect(1.0, angle) - place) < 2e-6 * size
    apart = of(linkage['apart'], '<f4')
    assert apart.max() < 1e-12 * size
    drawn = {shape['link'] for shape in linkage['drawn']['shapes']}
    assert drawn <= {*linkage['links'], 'ground'}
