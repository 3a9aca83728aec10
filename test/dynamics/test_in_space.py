# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""Forces in space: against Lagrange multipliers in absolute coordinates, and the work done."""

from dataclasses import replace
from functools import cache
from pathlib import Path
from random import Random
import re
import struct

from linkage_ros.description import load_scene
from linkage_ros.dynamics import (
    AppliedLoads,
    JointLoad,
    JointSpring,
    Loads,
    Mechanics,
    PointLoad,
    Spring,
    WrenchLoad,
)
from linkage_ros.errors import DefinitionError, FileError
from linkage_ros.kinematics import SpaceClosure, SpatialMass, thin_rod
from linkage_ros.kinematics.compiling import Compiled
from linkage_ros.tick import Pipeline
import numpy as np
import pytest

from .loaded import slope
from ..kinematics.space.test_linkages import closure_of, NAMES, states_of
from ..support.messages import read_joint_state, wrench_stamped
from ..support.multipliers import AbsoluteMotion
from ..support.scenes import pipeline_of

GRAVITY = (0.7, -1.1, -9.81)
ONE_INPUT = ['rssr', 'spatial_slider_crank', 'bennett', 'hooke_joint', 'ankle_of_one_motor']


def body_of(random, size):
    """Return the mass of a body with a centre and axes as odd as they come."""
    turn, _ = np.linalg.qr(
        np.array([[random.gauss(0.0, 1.0) for _ in range(3)] for _ in range(3)])
    )
    extents = [random.uniform(0.1, 0.6) * size for _ in range(3)]
    mass = random.uniform(0.1, 1.0)
    of_extents = np.diag([mass / 12.0 * (sum(e * e for e in extents) - e * e) for e in extents])
    tensor = turn @ of_extents @ turn.T
    center = tuple(random.uniform(-0.5, 0.5) * size for _ in range(3))
    return SpatialMass(mass, center, tuple(tensor[np.triu_indices(3)].tolist()))


def rod_of(random, one, other):
    """Return the mass of a round rod that is no thin one, with its centre off the middle."""
    one, other = np.array(one), np.array(other)
    along, share, rod = other - one, random.uniform(0.2, 0.8), thin_rod(0.3, one, other)
    unit = along / np.linalg.norm(along)
    tensor = 2.0e-4 * (np.eye(3) - np.outer(unit, unit)) + 0.7e-4 * np.outer(unit, unit)
    more = np.array(rod.inertia) + tensor[np.triu_indices(3)]
    return SpatialMass(0.3, tuple((one + share * along).tolist()), tuple(more.tolist()))


@cache
def weighed(name):
    """Return a closure of a linkage in space with masses other than the file's."""
    closure = closure_of(name)
    linkage, random = closure.linkage, Random(name)
    masses = {}
    for link in linkage.link_names[1:]:
        if link in closure.idle:
            masses[link] = rod_of(random, *(linkage.points[p] for p in linkage.links[link][:2]))
        else:
            masses[link] = body_of(random, closure.scale)
    return SpaceClosure(replace(linkage, masses=masses), name)


@cache
def spring_of(closure, damping=0.0):
    """Return a spring from the ground to a link that moves, and the closure with its ends."""
    linkage, size = closure.linkage, closure.scale
    link = next(link for link in linkage.link_names[:0:-1] if link not in closure.idle)
    links = {of: (*linkage.links.get(of, ()), of + ' end') for of in ('ground', link)}
    ends = {'ground end': (0.4, -0.7, 0.9), link + ' end': (0.2, 0.5, 0.3)}
    ends = {end: tuple(size * part for part in place) for end, place in ends.items()}
    linkage = replace(linkage, points={**linkage.points, **ends}, links={**linkage.links, **links})
    spring = Spring('ground', 'ground end', link, link + ' end', 40.0, 0.1 * size, damping)
    return SpaceClosure(linkage, closure.name), spring


def spring_forces(motion, spring):
    """Return the loads of a spring for `AbsoluteMotion.efforts`."""
    ends = [
        (link, motion.place(link, motion.linkage.points[point])) for link, point in spring.ends
    ]
    (one, start), (other, end) = ends
    apart = motion.motion(other, end)[0] - motion.motion(one, start)[0]
    length = np.linalg.norm(end - start)
    along = (end - start) / length
    pull = spring.stiffness * (length - spring.free_length) + spring.damping * along @ apart
    yield one, start, pull * along, np.zeros(3)
    yield other, end, -pull * along, np.zeros(3)


def motion_of(closure, inputs, rates, changes):
    position = closure.position(*inputs)
    velocity = closure.velocity(position, *rates)
    return position, velocity, closure.acceleration(position, velocity, *changes)


@pytest.mark.sample(6)
@pytest.mark.parametrize('name', NAMES)
def test_spatial_drive_efforts_equal_lagrange_multipliers(name):
    closure, spring = spring_of(weighed(name), 3.0)
    mechanics = Mechanics(closure, Loads(GRAVITY, (spring,)))
    for inputs, slow, changes in states_of(closure, 4, 0.2):
        rates = [4.0 * rate for rate in slow]
        found = mechanics.drive_efforts(*motion_of(closure, inputs, rates, changes))
        motion = AbsoluteMotion(closure, inputs, rates, changes)
        expected = motion.efforts(GRAVITY, spring_forces(motion, spring))
        assert found == pytest.approx(expected, rel=1e-9, abs=1e-9 * np.abs(expected).max())


@pytest.mark.sample(6)
@pytest.mark.parametrize('name', NAMES)
def test_spatial_drive_power_equals_the_energy_rate(name):
    closure, spring = spring_of(weighed(name))
    mechanics = Mechanics(closure, Loads(GRAVITY, (spring,), 0.02))
    for inputs, rates, changes in states_of(closure, 2, 0.1):
        efforts = mechanics.drive_efforts(*motion_of(closure, inputs, rates, changes))
        q, w, a = map(np.array, (inputs, rates, changes))

        def energy(t, q=q, w=w, a=a):
            position = closure.position(*(q + w * t + 0.5 * a * t * t))
            return mechanics.total_energy(position, *(w + a * t))

        power = slope(energy, 0.0)
        assert np.dot(efforts, rates) == pytest.approx(power, rel=1e-8, abs=1e-8)


@pytest.mark.parametrize('name', ONE_INPUT)
def test_spatial_equation_of_motion_equals_the_drive_efforts(name):
    closure, spring = spring_of(weighed(name), 3.0)
    mechanics = Mechanics(closure, Loads(GRAVITY, (spring,), 0.02))
    for (q,), (w,), (a,) in states_of(closure, 4, 0.2):
        terms = mechanics.motion_terms(closure.position(q))
        expected = terms.inertia * a + terms.half_slope * w * w + terms.viscous * w
        (found,) = mechanics.drive_efforts(*motion_of(closure, (q,), (w,), (a,)))
        assert found == pytest.approx(expected + terms.potential_slope, rel=1e-12, abs=1e-12)
        assert _bits(mechanics.motion_equation(q)[:5]) == _bits(terms[:5])


@pytest.mark.parametrize('name', ['rssr', 'delta', 'ankle_motors'])
def test_compiled_spatial_efforts_equal_the_interpreted_ones(name):
    closure, spring = spring_of(weighed(name), 3.0)
    mechanics = Mechanics(closure, Loads(GRAVITY, (spring,), 0.02))
    compiled = Compiled(closure, 2, lambda motion: [mechanics.drive_efforts(*motion)])
    for state in states_of(closure, 4):
        (fast,) = compiled.fast(*[number for part in state for number in part])
        assert _bits(fast) == _bits(mechanics.drive_efforts(*motion_of(closure, *state)))


def everywhere(closure):
    """Return loads on every joint, on a point of each link, and on each link that has a frame."""
    linkage, random = closure.linkage, Random(closure.name)
    joints = dict.fromkeys((*closure.input_names, *closure.joint_names))

    def number():
        return random.uniform(-3.0, 3.0)

    frames = ['ground', 'link']
    return AppliedLoads(
        {name: JointSpring(abs(number()), number(), abs(number())) for name in joints},
        {},
        {
            name: JointLoad(number(), ((0.0, number()), (2.0, number())),
                            ((-9.0, number()), (9.0, number())), ((-50.0, number()), (50.0, 1.0)))
            for name in joints
        },
        {
            f'{link}.{points[0]}': PointLoad(
                (number(), number(), number()),
                'ground' if link in closure.idle else frames[count % 2],
                number(),
                ((0.0, number()), (2.0, number())),
            )
            for count, (link, points) in enumerate(linkage.links.items())
            if link != 'ground' and points
        },
        {
            link: WrenchLoad('', next(iter(linkage.links.get(link, ())), ''), frames[count % 2])
            for count, link in enumerate(linkage.link_names)
            if link != 'ground' and link not in closure.idle
        },
    )  # fmt: skip


def table_at(table, value):
    return np.interp(value, *zip(*table, strict=True)) if table else 0.0


def applied_by_hand(motion, closure, position, applied, wrenches, seconds):
    """Yield loads as `AbsoluteMotion.efforts` takes them."""
    linkage = closure.linkage
    values = dict(zip(closure.joint_names, position.joints, strict=True))
    values |= dict(zip(closure.input_names, position.inputs, strict=True))
    for name, value in values.items():
        rate, spring, load = motion.joint_rate(name), *(
            of[name] for of in (applied.joint_springs, applied.efforts)
        )  # fmt: skip
        effort = -spring.stiffness * (value - spring.free) - spring.damping * rate
        effort += load.constant + table_at(load.over_time, seconds)
        effort += table_at(load.over_position, value) + table_at(load.over_rate, rate)
        yield from motion.joint_loads(name, effort)
    for name, load in applied.forces.items():
        link, _, point = name.rpartition('.')
        way = np.array(load.direction) / np.linalg.norm(load.direction)
        way = motion.turned(link, way) if load.frame == 'link' else way
        force = (load.constant + table_at(load.over_time, seconds)) * way
        yield link, motion.place(link, linkage.points[point]), force, np.zeros(3)
    for link, numbers in wrenches.items():
        load = applied.wrenches[link]
        turn = motion.frames[link][2] if load.frame == 'link' else np.eye(3)
        at = motion.frames[link][1]
        place = motion.place(link, linkage.points[load.point]) if load.point else at
        yield link, place, turn @ numbers[:3], turn @ numbers[3:]


@pytest.mark.sample(6)
@pytest.mark.parametrize('name', NAMES)
def test_spatial_loads_enter_the_drive_efforts(name):
    closure, random = weighed(name), Random(name)
    applied = everywhere(closure)
    mechanics = Mechanics(closure, Loads(GRAVITY, applied=applied))
    wrenches = {link: [random.uniform(-2.0, 2.0) for _ in range(6)] for link in applied.wrenches}
    for link, numbers in wrenches.items():
        mechanics.applied.wrenches[link].set_wrench(tuple(numbers), 0)
    for inputs, rates, changes in states_of(closure, 3, 0.2):
        position, velocity, acceleration = motion_of(closure, inputs, rates, changes)
        given = mechanics.applied.given_after(0.7)
        found = mechanics.drive_efforts(position, velocity, acceleration, given)
        motion = AbsoluteMotion(closure, inputs, rates, changes)
        loads = applied_by_hand(motion, closure, position, applied, wrenches, 0.7)
        expected = motion.efforts(GRAVITY, loads)
        assert found == pytest.approx(expected, rel=1e-9, abs=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize('name', ['rssr', 'spatial_slider_crank', 'bennett'])
def test_compiled_spatial_loads_equal_the_interpreted_ones(name):
    closure = weighed(name)
    mechanics = Mechanics(closure, Loads(GRAVITY, applied=everywhere(closure)))
    for (q,), _, _ in states_of(closure, 4, 0.2):
        fast, slow = mechanics.motion_equation(q), mechanics.motion_terms(closure.position(q))
        assert slow.laws
        for one, other in zip(fast.laws, slow.laws, strict=True):
            assert _bits(one) == _bits([number + 0.0 for number in other])
        assert _bits(fast[:5]) == _bits(slow[:5])


def test_link_frame_loads_on_idle_rods_are_refused():
    force = AppliedLoads(forces={'rod.B': PointLoad((1.0, 0.0, 0.0), 'link', 1.0)})
    assert refusal('rssr', Loads(applied=force)).startswith('loads.forces.rod.B.frame: the rod')
    wrench = AppliedLoads(wrenches={'rod': WrenchLoad()})
    assert refusal('rssr', Loads(applied=wrench)).startswith('loads.wrenches.rod: the rod may')
    flat = AppliedLoads(forces={'rod.B': PointLoad((1.0, 0.0), 'ground', 1.0)})
    line = refusal('rssr', Loads(applied=flat))
    assert line.startswith('loads.forces.rod.B.direction: [1, 0], and the linkage is spatial')


ANKLE = b"""
points:
  b1: [0.035, 0.0165, 0.146]
  b2: [0.040, -0.0165, 0.211]
  c1: [0.022, 0.015, -0.010]
  c2: [0.022, -0.015, -0.010]
links: {bar1: [b1], bar2: [b2], rod1: [b1, c1], rod2: [b2, c2], foot: [c1, c2]}
hinges:
  m1: {parent: ground, child: bar1, at: [0.035, 0, 0.150], axis: [1, 0, 0], limits: [-0.6, 0.6]}
  m2: {parent: ground, child: bar2, at: [0.040, 0, 0.215], axis: [1, 0, 0], limits: [-0.6, 0.6]}
  pitch: {parent: ground, child: cross, at: [0, 0, 0], axis: [0, 1, 0]}
  roll: {parent: cross, child: foot, at: [0, 0, -0.018], axis: [1, 0, 0]}
input: [m1, m2]
masses:
  bar1: {mass: 0.1, center: [0.035, 0.010, 0.148], inertia: [8.0e-6, 0, 0, 2.0e-6, 0, 8.0e-6]}
  bar2: {mass: 0.1, center: [0.040, -0.010, 0.213], inertia: [8.0e-6, 0, 0, 2.0e-6, 0, 8.0e-6]}
  rod1: {mass: 0.06}
  rod2: {mass: 0.07}
  cross: {mass: 0}
  foot: {mass: 0.8, center: [0.03, 0, -0.05], inertia: [5.0e-4, 0, 2.0e-5, 2.7e-3, 0, 3.1e-3]}
"""
SWINGING = b"""
drive: {sine: {amplitude: 0.2, frequency: 2, inputs: {m2: {amplitude: 0.1, frequency: 3}}}}
loads: {gravity: [0, 0, -9.81], wrenches: {foot: {point: c1, max_age: 10}}}
effects: {velocity: {}, acceleration: {}, effort: {}}
"""


def test_scene_publishes_the_motor_efforts_of_an_ankle():
    pipeline = pipeline_of(SWINGING, ANKLE)
    closure, begin = pipeline.linkages[0].closure, 1_700_000_000_000_000_000
    pipeline.tick(begin)
    message = wrench_stamped(3.0, -2.0, 0.4, (5.0, 0.2, -0.1))
    assert pipeline.wrenches[0].offer_wrench(message, begin) is None
    for count in range(1, 200, 7):
        tick = pipeline.tick(begin + count * 1_000_000)
        state, crank = read_joint_state(tick.message), tick.states[0].crank
        assert state.name == ['m1', 'm2', 'pitch', 'roll']
        motion = AbsoluteMotion(closure, crank.angles, crank.rates, crank.accelerations)
        place = motion.place('foot', closure.linkage.points['c1'])
        load = 'foot', place, np.array([3.0, -2.0, 5.0]), np.array([0.2, -0.1, 0.4])
        expected = motion.efforts((0.0, 0.0, -9.81), [load])
        assert state.effort == pytest.approx([*expected, 0.0, 0.0], rel=1e-9, abs=1e-12)


ROBOT = Path(__file__).parents[1] / 'tools' / 'models' / 'robots' / 'ankle.urdf'
OF_ROBOT = """
linkage: {urdf: ankle.urdf, input: [pitch, roll]}
drive: {sine: {amplitude: 0.1, frequency: 0.5}}
loads: {gravity: [0, 0, -9.81]}
effects: {effort: {}}
"""


def robot_scene(folder, robot):
    (folder / 'ankle.urdf').write_text(robot, 'utf-8')
    (folder / 'scene.yaml').write_text(OF_ROBOT, 'utf-8')
    return load_scene(folder / 'scene.yaml')


def test_robot_efforts_use_the_masses_of_its_urdf(tmp_path):
    count = iter(range(1, 20))

    def weigh(link):
        number = next(count)
        return (
            f'<link name="{link[1]}"><inertial><mass value="{0.1 * number:g}"/>'
            f'<origin xyz="0.0{number % 9} 0.01 -0.02" rpy="0.2 0.1 -0.3"/>'
            '<inertia ixx="2e-4" ixy="1e-5" ixz="0" iyy="3e-4" iyz="-2e-5" izz="2.5e-4"/>'
            '</inertial></link>'
        )

    robot = re.sub(r'<link name="(\w+)"/>', weigh, ROBOT.read_text('utf-8'))
    pipeline = Pipeline(robot_scene(tmp_path, robot))
    closure = pipeline.linkages[0].closure
    assert sum(body.mass for body in closure.linkage.masses.values()) > 1.0
    for count_ms in range(0, 2000, 300):
        tick = pipeline.tick(1_700_000_000_000_000_000 + count_ms * 1_000_000)
        crank = tick.states[0].crank
        motion = AbsoluteMotion(closure, crank.angles, crank.rates, crank.accelerations)
        expected = motion.efforts((0.0, 0.0, -9.81))
        assert read_joint_state(tick.message).effort[:2] == pytest.approx(expected, rel=1e-9)


def test_urdf_without_masses_error_names_the_inertial_element(tmp_path):
    with pytest.raises(FileError, match=r'urdf: no link of its loops has a mass.*<inertial>'):
        Pipeline(robot_scene(tmp_path, ROBOT.read_text('utf-8')))


def _bits(numbers):
    return struct.pack(f'{len(numbers)}d', *numbers)


def refusal(name, loads=None, **masses):
    closure = weighed(name)
    linkage = replace(closure.linkage, masses={**closure.linkage.masses, **masses})
    with pytest.raises(DefinitionError) as caught:
        Mechanics(SpaceClosure(linkage, name), loads)
    return str(caught.value)


def test_idle_rod_with_asymmetric_mass_is_refused():
    rod = weighed('rssr').linkage.masses['rod']
    x, y, z = rod.center
    line = refusal('rssr', rod=replace(rod, center=(x, y + 0.01, z)))
    assert line.startswith('masses.rod.center: it is 0.00')
    assert 'universal joint' in line
    xx, xy, xz, yy, yz, zz = rod.inertia
    line = refusal('rssr', rod=replace(rod, inertia=(1.1 * xx, xy, xz, yy, yz, zz)))
    assert line.startswith('masses.rod.inertia: it is not round about the line through')
    assert 'universal joint' in line


def test_impossible_principal_moments_are_refused():
    crank = SpatialMass(1.0, (0.0, 0.0, 0.0), (1e-3, 0.0, 0.0, 1e-3, 0.0, 5e-3))
    assert refusal('rssr', crank=crank).startswith('masses.crank.inertia: its principal moments')


def test_planar_gravity_on_a_spatial_linkage_is_refused():
    line = refusal('rssr', Loads((0.0, -9.81)))
    assert line == 'loads.gravity: [0, -9.81], and the linkage is spatial; write [x, y, z]'
