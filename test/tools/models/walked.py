# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A robot model walked by yourdfpy, and what the node says while a linkage moves."""

import io
from math import cos, sin
from xml.etree import ElementTree as ET

from linkage_ros.description import load_scene, parse_scene
from linkage_ros.messages import JointStateWriter
from linkage_ros.tick import Pipeline
import numpy as np
import yourdfpy

from ...support.messages import read_joint_state
from ...support.scenes import pipeline_of

BEGIN = 1_700_000_000_000_000_000
MS = 1_000_000


class Walked:
    """A model; each link is where its joints put it."""

    def __init__(self, data):
        self.model = yourdfpy.URDF.load(
            io.BytesIO(data), build_scene_graph=True, load_meshes=False
        )
        self.joints = set(self.model.actuated_joint_names)
        self._loops = ET.fromstring(data).findall('loop_joint')

    def pose(self, names, positions):
        """Take a joint state."""
        assert self.joints <= set(names), 'a joint that nobody publishes'
        self.model.update_cfg(dict(zip(names, positions, strict=True)))

    def gap(self):
        """Return by how much ends of loop joints are apart, or turned, in [m] and [rad]."""
        return max(
            (
                float(abs(self._end(loop, 'link1') - self._end(loop, 'link2')).max())
                for loop in self._loops
            ),
            default=0.0,
        )

    def _end(self, loop, tag):
        """Return the frame of an end, the place of a ball's, or place and axis of a hinge's."""
        end, axis = loop.find(tag), loop.find('parent_axis')
        numbers = (map(float, end.get(key).split()) for key in ('xyz', 'rpy'))
        there = self.model.get_transform(end.get('link')) @ _transform(*map(list, numbers))
        if loop.get('type') == 'revolute' and axis is not None:
            way = np.array([float(number) for number in axis.get('xyz').split()])
            return np.column_stack([there[:3, 3], there[:3, :3] @ way / np.linalg.norm(way)])
        return there[:3, 3:] if loop.get('type') == 'spherical' else there

    def place(self, frame):
        """Return where a frame is, as x + iy, and that it lies in the plane."""
        there = self.model.get_transform(frame)
        assert there[2, 3] == 0.0
        assert abs(there[2, 2] - 1.0) < 1e-12
        return complex(there[0, 3], there[1, 3])

    def facing(self, frame):
        """Return e^{i·angle} of a frame."""
        there = self.model.get_transform(frame)
        return complex(there[0, 0], there[1, 0])


def _transform(xyz, rpy):
    """Return a frame by its place and its angles about fixed axes."""
    (cr, cp, cy), (sr, sp, sy) = (list(map(turn, rpy)) for turn in (cos, sin))
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr, xyz[0]],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr, xyz[1]],
            [-sp, cp * sr, cp * cr, xyz[2]],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


def said(pipeline, every=50 * MS, count=126):
    """Yield names and positions of the joint states that ticks come to."""
    for index in range(count):
        message = pipeline.tick(BEGIN + index * every).message
        if message:
            yield heard(message)


def heard(message):
    """Return names and positions of a joint state, read by rosbags."""
    state = read_joint_state(message)
    return list(state.name), list(state.position)


def moving(file):
    """Return the pipeline of a linkage file; what has several inputs is turned by hand."""
    return Pipeline(load_scene(file))


def moving_text(text):
    """Return the pipeline of a linkage that is the text of a file, driven as a file alone is."""
    from linkage_ros.description import parse_yaml, read_closure, scene_text_for

    scene = scene_text_for(read_closure(parse_yaml(text.encode(), 'it')), 'linkage.yaml')
    files = {'scene.yaml': scene.encode(), 'linkage.yaml': text.encode()}
    return Pipeline(parse_scene('it', 'it', files))


def several_inputs(text, names, values):
    """Yield what is said where several inputs come in messages."""
    pipeline = pipeline_of('rate: 0\npublish_input: true\n', text)
    writer = JointStateWriter(names)
    for index, inputs in enumerate(values):
        now = BEGIN + index * 50 * MS
        assert pipeline.offer(writer.write(now, inputs, [0.0] * len(names)), now) is None
        message = pipeline.tick(now).message
        if message:
            yield heard(message)
