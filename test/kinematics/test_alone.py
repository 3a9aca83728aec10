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

"""A step closed alone has the pose that it has among all others, to the last bit."""

from __future__ import annotations

from linkage_ros.kinematics.alone import pose_alone
from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.linkage import Input, Linkage, RevoluteJoint
from linkage_ros.kinematics.survey import transmission_angles, usual_inputs, Way
import pytest

from .test_gallery import closure_of
from .test_survey import FILES


@pytest.mark.parametrize('name', [file.stem for file in FILES])
def test_a_step_alone_is_as_among_the_others(name: str) -> None:
    closure = closure_of(name)
    usual = usual_inputs(closure)
    inputs = [[value + 0.02 * i for value in usual] for i in range(-150, 150)]
    closed = [one for one in inputs if closure.position(*one).status.has_pose]
    assert usual in map(tuple, closed)
    for number in range(len(closure.steps)):
        pose = pose_alone(closure, number, *closed[0])
        for one in closed:
            assert repr(pose(*one)) == repr(closure.position(*one).poses[number])


def side_by_side(count: int) -> Closure:
    """Return four-bars that one crank drives."""
    links = {'ground': {'O': (0.0, 0.0)}, 'crank': {'O': (0.0, 0.0), 'A': (0.04, 0.0)}}
    for i in range(count):
        links['ground'][f'P{i}'] = (0.1, 0.001 * i)
        links[f'coupler{i}'] = {'A': (0.0, 0.0), f'B{i}': (0.12, 0.0)}
        links[f'rocker{i}'] = {f'P{i}': (0.0, 0.0), f'B{i}': (0.08, 0.0)}
    return Closure(
        Linkage(
            links,
            (Input('crank_joint', 'ground', 'crank'),),
            {f'B{i}': 'left' for i in range(count)},
            {'rocker_joint': RevoluteJoint('ground', 'rocker0')},
            {},
        )
    )


def test_what_a_loop_takes_hardly_grows_with_the_number_of_loops(monkeypatch) -> None:
    taken = []
    for count in (2, 20):
        closings = [0]
        kinds = {type(s) for s in side_by_side(1).steps if hasattr(s, 'transmission_angle')}
        with monkeypatch.context() as patch:
            for kind in kinds:
                patch.setattr(kind, 'close', counted(kind.close, closings))
            transmission_angles(Way(side_by_side(count)))
        taken.append(closings[0] / count)
    # Their ranges are searched for together; without that the ratio is 10.
    assert taken[1] < 3.0 * taken[0]


def counted(close, closings):
    def counting(self, known):
        closings[0] += 1
        return close(self, known)

    return counting
