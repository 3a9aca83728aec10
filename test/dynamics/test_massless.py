# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Loads on linkages without masses: a textbook's statics, by free bodies written out by hand."""

from cmath import rect
from math import hypot

from linkage_ros.cli.main import main
from linkage_ros.errors import FileError
from linkage_ros.tick import Pipeline
import numpy as np
import pytest

from ..support.four_bar import GALLERY, meeting_point
from ..support.messages import joint_state
from ..support.scenes import FOUR_BAR, four_bar_text, pipeline_of, scene_of

SECOND = 10**9
A, B, C, D = GALLERY
MASSLESS = (
    'masses: {'
    + ', '.join(
        f'{link}: {{mass: 0, center: [0, 0], inertia: 0}}'
        for link in ('crank', 'coupler', 'rocker')
    )
    + '}\n'
)


def four_bar_at(angle):
    """Return the pins A and B of the open four-bar."""
    crank = rect(A, angle)
    return crank, meeting_point(crank, D, B, C)


def statics(angle, torque, force, at):
    """
    Return the torque on the crank, and what coupler and rocker are held with in A, B and O4.

    Nine equations for nine unknowns (R. L. Norton, Design of Machinery, ch. 11, without masses): a
    torque acts on the rocker, a force on the coupler at a place.
    """
    a, b = four_bar_at(angle)
    # Unknowns: O2 on the crank, A on the coupler, B on the rocker, O4 on the rocker, the torque.
    rows, right = np.zeros((9, 9)), np.zeros(9)
    pins = (('O2', 0j, {'crank': 1}), ('A', a, {'coupler': 1, 'crank': -1}),
            ('B', b, {'rocker': 1, 'coupler': -1}), ('O4', D + 0j, {'rocker': 1}))  # fmt: skip
    for index, (_, place, links) in enumerate(pins):
        for link, sign in links.items():
            row = 3 * ('crank', 'coupler', 'rocker').index(link)
            rows[row, 2 * index] = rows[row + 1, 2 * index + 1] = sign
            rows[row + 2, [2 * index, 2 * index + 1]] = -sign * place.imag, sign * place.real
    rows[2, 8] = 1.0
    right[3:6] = -force.real, -force.imag, -(at.real * force.imag - at.imag * force.real)
    right[8] = -torque
    found = np.linalg.solve(rows, right)
    forces = found[:8].reshape(4, 2)
    return found[8], {name: force for (name, *_), force in zip(pins, forces, strict=True)}


@pytest.mark.parametrize('masses', ['', MASSLESS], ids=['no masses', 'mass: 0'])
@pytest.mark.parametrize('angle', [0.3, 1.0, 2.4, -1.2])
def test_massless_four_bar_efforts_equal_textbook_statics(angle, masses):
    linkage = four_bar_text(A, B, C, D)
    linkage = linkage.replace(f'B: [{B}, 0]', f'B: [{B}, 0], P: [0.06, 0.03]')
    pipeline = pipeline_of(
        f'drive: {{constant_rate: {{start: {angle}, rate: 3}}}}\n'
        'effects: {effort: {}, pin_forces: {}}\n'
        'loads:\n'
        '  efforts: {rocker_joint: {constant: -1.5}}\n'
        '  forces: {coupler.P: {direction: [0.6, -0.8], constant: 20}}\n',
        linkage + masses,
    )
    (look,) = pipeline.tick(SECOND).states
    a, b = four_bar_at(angle)
    place = a + complex(0.06, 0.03) * (b - a) / B
    torque, pins = statics(angle, -1.5, 20 * complex(0.6, -0.8), place)
    assert look.reading.efforts[0] == pytest.approx(torque, rel=1e-12)
    joints = pipeline.linkages[0].closure.structure.joints
    for reaction, joint in zip(look.motion.reactions, joints, strict=True):
        assert hypot(*reaction[:2]) == pytest.approx(hypot(*pins[joint.name]), rel=1e-12)


def test_torque_drive_accelerates_only_its_own_inertia():
    pipeline = pipeline_of(
        'rate: 1000\ndrive: {torque: {start: 0.5}}\nloads: {drive_inertia: 0.02}\n'
        'effects: {velocity: {}}',
        FOUR_BAR,
    )
    effort = 0.3
    pipeline.tick(SECOND)
    assert pipeline.offer(joint_state(['crank_joint'], [], [], [effort]), SECOND) is None
    for index in range(1, 50):
        (look,) = pipeline.tick(SECOND + index * 10**6).states
        seconds = index / 1000
        # The start, and half of effort over inertia times the time squared.
        assert look.crank.angles[0] == pytest.approx(0.5 + 0.5 * effort / 0.02 * seconds**2)


REFUSED = {
    'no loads': 'effects: {effort: {}}',
    'a weight': 'effects: {effort: {}}\nloads: {gravity: [0, -9.81]}',
    'a weight among loads': 'effects: {effort: {}}\n'
    'loads: {gravity: [0, -9.81], efforts: {rocker_joint: {constant: 1}}}',
    'nothing that could be moved': 'drive: {torque: {}}',
}


@pytest.mark.parametrize('kind', REFUSED)
def test_missing_masses_are_refused_without_loads(kind):
    with pytest.raises(
        FileError, match=r"link 'crank' has no mass, .*for a massless link write \{mass: 0\}"
    ):
        Pipeline(scene_of(REFUSED[kind], FOUR_BAR))


def test_partly_given_masses_are_refused():
    masses = 'masses: {rocker: {mass: 1, center: [0, 0], inertia: 0}}'
    with pytest.raises(FileError, match="link 'crank' has no mass"):
        pipeline_of(
            'effects: {effort: {}}\nloads: {efforts: {rocker_joint: {constant: 1}}}',
            four_bar_text(A, B, C, D) + masses,
        )


def test_massless_linkage_publishes_force_markers():
    pipeline = pipeline_of(
        'drive: {constant_rate: {start: 1, rate: 3}}\n'
        'effects: {pin_forces: {}, markers: {rate: 1000}}\n'
        'loads: {efforts: {rocker_joint: {constant: -1.5}}}',
        FOUR_BAR,
    )
    assert all(pipeline.tick(SECOND).extras)


def test_urdf_omits_massless_inertials_and_mjcf_refuses_them(tmp_path, capsys):
    file = tmp_path / 'light.yaml'
    text = four_bar_text(A, B, C, D).replace(
        'joints: {', 'joints: {coupler_joint: {parent: crank, child: coupler}, '
    )
    file.write_text(text + MASSLESS, 'utf-8')
    assert main(['urdf', str(file)]) == 0
    written = capsys.readouterr().out
    assert '<link name="rocker">' in written
    assert '<inertial>' not in written
    assert main(['mjcf', str(file)]) == 2
    assert (
        'masses.crank.mass: is 0, and MuJoCo moves no massless body; ' in capsys.readouterr().err
    )
