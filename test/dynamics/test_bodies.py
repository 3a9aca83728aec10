# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Masses of links: thin rods, tensors of inertia, what a URDF says, and what cannot be."""

from linkage_ros.description import load, parse_yaml, read_any_closure, read_linkage
from linkage_ros.dynamics import Loads, Mechanics
from linkage_ros.errors import LinkageError
from linkage_ros.kinematics import Mass, SpatialMass
import numpy as np
import pytest

RSSR = """
points: {A: [0.04, 0, 0], B: [0.1, 0.02, 0.12]}
links: {crank: [A], rod: [A, B], rocker: [B]}
hinges:
  crank_joint: {parent: ground, child: crank, at: [0, 0, 0], axis: [0, 0, 1]}
  rocker_joint: {parent: ground, child: rocker, at: [0.15, 0.05, 0.03], axis: [0, 1, 0.3]}
input: crank_joint
"""
SLIDER = """
links:
  ground: {O: [0, 0]}
  crank: {O: [0, 0], A: [0.04, 0.03]}
  rod: {A: [0, 0], B: [0.12, 0], C: [0.05, 0.05]}
  piston: {B: [0, 0]}
sliders: {guide: {point: B, along: ground, through: O, direction: [1, 0], block: piston}}
input: {joint: crank_joint, parent: ground, child: crank}
assembly: {guide: ahead}
joints: {stroke: {slider: guide}}
"""
_TENSOR = ('ixx', 'ixy', 'ixz', 'iyy', 'iyz', 'izz')


def matrix(tensor):
    xx, xy, xz, yy, yz, zz = tensor
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def spatial(masses, linkage=RSSR):
    content = parse_yaml(f'{linkage}masses: {masses}\n'.encode(), 'linkage.yaml')
    return read_any_closure(content).linkage


def weighed(crank):
    """Return the forces on a linkage that is read: moments of inertia matter to them alone."""
    masses = f'{{crank: {crank}, rod: {{mass: 0}}, rocker: {{mass: 0}}}}'
    content = parse_yaml(f'{RSSR}masses: {masses}\n'.encode(), 'linkage.yaml')
    return Mechanics(read_any_closure(content), Loads((0.0, 0.0, -9.81)))


def planar(masses):
    return read_linkage(parse_yaml(f'{SLIDER}masses: {masses}\n'.encode(), 'linkage.yaml'))


def test_mass_without_inertia_becomes_a_thin_rod():
    found = spatial('{rod: {mass: 0.2}, crank: {mass: 0}}').masses
    assert found['crank'] == SpatialMass(0.0)
    one, other = np.array([0.04, 0, 0]), np.array([0.1, 0.02, 0.12])
    assert found['rod'].center == pytest.approx((one + other) / 2)
    # 10,000 grains along the rod.
    grains = one + (np.arange(10_000) + 0.5)[:, None] / 10_000 * (other - one)
    arms = grains - grains.mean(0)
    expected = 0.2 * np.mean([arm @ arm * np.eye(3) - np.outer(arm, arm) for arm in arms], 0)
    assert matrix(found['rod'].inertia) == pytest.approx(expected, rel=1e-7)
    crank, rod = (
        planar('{crank: {mass: 0.3}, rod: {mass: 0}}').masses[n] for n in ('crank', 'rod')
    )
    assert (crank.mass, crank.center) == (0.3, pytest.approx((0.02, 0.015)))
    assert crank.inertia == pytest.approx(0.3 * 0.05**2 / 12)
    assert rod == Mass(0.0, (0.0, 0.0), 0.0)


@pytest.mark.parametrize(
    ('read', 'masses', 'where', 'reason', 'remedy'),
    [
        (spatial, '{rood: {mass: 1}}', 'masses.rood', "no link 'rood'", "'rod'"),
        (spatial, '{ground: {mass: 1}}', 'masses.ground', 'does not move', 'leave'),
        (spatial, '{crank: {mass: 1}}', 'masses.crank', '1 point', 'center and inertia'),
        (planar, '{rod: {mass: 1}}', 'masses.rod', '3 points', 'center and inertia'),
        (spatial, '{rod: {mass: 1, center: [0, 0, 0]}}', 'masses.rod.center', 'inertia', 'too'),
        (planar, '{rod: {mass: 1, inertia: 1}}', 'masses.rod.inertia', 'center', 'too'),
        (
            weighed, '{mass: 1, center: [0, 0, 0], inertia: [1, 0, 0, 1, 0, 3]}',
            'masses.crank.inertia', '[1, 1, 3]', 'ixx, ixy, ixz',
        ),
        (
            weighed, '{mass: 1, center: [0, 0, 0], inertia: [1, 2, 0, 1, 0, 1]}',
            'masses.crank.inertia', 'is negative', 'ixx, ixy, ixz',
        ),
        (
            spatial, '{crank: {mass: 1, center: [0, 0, 0], inertia: [1, 2, 3]}}',
            'masses.crank.inertia', '3 numbers', 'ixx, ixy, ixz',
        ),
        (
            spatial, '{crank: {mass: 1, center: [0, 0], inertia: [1, 0, 0, 1, 0, 1]}}',
            'masses.crank.center', 'not a place', '[x, y, z]',
        ),
    ],
)  # fmt: skip
def test_impossible_masses_are_refused_in_one_line(read, masses, where, reason, remedy):
    with pytest.raises(LinkageError) as refused:
        read(masses)
    line = str(refused.value)
    assert f'{where}: ' in line
    assert reason in line
    assert remedy in line.partition('; ')[2]
    assert '\n' not in line


def test_rounded_plate_inertia_is_accepted():
    # A plate has izz = ixx + iyy, which three digits round upwards.
    assert weighed('{mass: 1, center: [0, 0, 0], inertia: [1.23, 0, 0, 2.34, 0, 3.58]}')


def test_unnamed_links_are_massless():
    ball = (
        'balls: {hip: {parent: ground, child: leg, at: [0, 0, 0]}}\ninput: [hip_x, hip_y, hip_z]\n'
    )
    linkage = f'points: {{P: [0, 0, -1]}}\nlinks: {{leg: [P]}}\n{ball}'
    found = spatial('{leg: {mass: 1, center: [0, 0, -1], inertia: [0, 0, 0, 0, 0, 0]}}', linkage)
    assert {*found.masses} == {*found.link_names[1:]}
    assert sum(body.mass for body in found.masses.values()) == 1.0


LINK = (
    '<link name="{0}"><inertial><origin xyz="{1}" rpy="{2}"/><mass value="{3}"/>'
    '<inertia {4}/></inertial></link>'
)
JOINT = (
    '<joint name="{0}" type="{1}"><parent link="{2}"/><child link="{3}"/>'
    '<origin xyz="{4}" rpy="{5}"/><axis xyz="0 0 1"/></joint>'
)


def roll_pitch_yaw(roll, pitch, yaw):
    def about(axis, angle):
        i, j = [k for k in range(3) if k != axis]
        turn = np.eye(3)
        turn[i, i] = turn[j, j] = np.cos(angle)
        turn[j, i], turn[i, j] = np.sin(angle), -np.sin(angle)
        return turn.T if axis == 1 else turn

    return about(2, yaw) @ about(1, pitch) @ about(0, roll)


def test_urdf_masses_of_fixed_links_are_added(tmp_path):
    bodies = {
        'base': ('0 0 0', '0 0 0', 5.0, (1, 0, 0, 1, 0, 1)),
        'crank': ('0.1 0.02 0.03', '0.3 -0.2 0.5', 2.0, (0.03, 0.001, 0.002, 0.04, -0.001, 0.05)),
        'weight': ('0.01 0 0.02', '0 0.4 0', 0.7, (0.01, 0, 0, 0.012, 0, 0.015)),
        'tool': ('0 0 0.1', '0 0 0', 0.3, (0.001, 0, 0, 0.001, 0, 0.001)),
    }
    poses = {
        'base': (np.eye(3), np.zeros(3)),
        'crank': (roll_pitch_yaw(0.2, 0.1, -0.3), np.array([0.5, 0.1, 0.2])),
    }
    for name, at, turn in (
        ('weight', (0.3, 0, 0.1), (0, 0, 1.0)),
        ('tool', (0, 0.2, 0), (0.5, 0, 0)),
    ):
        on, place = poses['crank']
        poses[name] = on @ roll_pitch_yaw(*turn), place + on @ np.array(at)
    links = ''.join(
        LINK.format(
            name, xyz, rpy, mass, ' '.join(f'{k}="{v}"' for k, v in zip(_TENSOR, six, strict=True))
        )
        for name, (xyz, rpy, mass, six) in bodies.items()
    )
    joints = [
        JOINT.format('turn', 'revolute', 'base', 'crank', '0.5 0.1 0.2', '0.2 0.1 -0.3'),
        JOINT.format('held', 'fixed', 'crank', 'weight', '0.3 0 0.1', '0 0 1.0'),
        # Its joint is in no loop: it stands still on the crank.
        JOINT.format('wrist', 'revolute', 'crank', 'tool', '0 0.2 0', '0.5 0 0'),
        JOINT.format('follow', 'revolute', 'base', 'other', '0.9 0.1 0.2', '0.2 0.1 -0.3').replace(
            '<axis', '<mimic joint="turn"/><axis'
        ),
    ]
    file = tmp_path / 'robot.urdf'
    file.write_text(f'<robot name="r">{links}<link name="other"/>{"".join(joints)}</robot>')
    found = load(file, {'input': ['turn']}).linkage.masses
    assert found['other'] == SpatialMass(0.0)
    parts = []
    for name in ('crank', 'weight', 'tool'):
        xyz, rpy, mass, six = bodies[name]
        on, place = poses[name]
        turn = on @ roll_pitch_yaw(*map(float, rpy.split()))
        center = place + on @ np.array([*map(float, xyz.split())])
        parts.append((mass, center, turn @ matrix(six) @ turn.T))
    total = sum(mass for mass, _, _ in parts)
    center = sum(mass * at for mass, at, _ in parts) / total
    inertia = sum(
        own
        + mass * ((at - center) @ (at - center) * np.eye(3) - np.outer(at - center, at - center))
        for mass, at, own in parts
    )
    assert found['crank'].mass == pytest.approx(total)
    assert found['crank'].center == pytest.approx(center)
    assert matrix(found['crank'].inertia) == pytest.approx(inertia, abs=1e-12)
