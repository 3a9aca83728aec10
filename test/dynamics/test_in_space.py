# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""Forces in space: against Lagrange multipliers in absolute coordinates, and the work done."""

from dataclasses import replace
from random import Random
import struct

from linkage_ros.dynamics import Loads, Mechanics, Spring
from linkage_ros.errors import DefinitionError
from linkage_ros.kinematics import SpaceClosure, SpatialMass, thin_rod
from linkage_ros.kinematics.compiling import Compiled
import numpy as np
import pytest

from .loaded import slope
from ..kinematics.space.test_linkages import closure_of, NAMES, states_of
from ..support.multipliers import AbsoluteMotion

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


@pytest.mark.parametrize('name', NAMES)
def test_efforts_are_the_multipliers_of_the_driven_joints(name):
    closure, spring = spring_of(weighed(name), 3.0)
    mechanics = Mechanics(closure, Loads(GRAVITY, (spring,)))
    for inputs, slow, changes in states_of(closure, 4, 0.2):
        rates = [4.0 * rate for rate in slow]
        found = mechanics.drive_efforts(*motion_of(closure, inputs, rates, changes))
        motion = AbsoluteMotion(closure, inputs, rates, changes)
        expected = motion.efforts(GRAVITY, spring_forces(motion, spring))
        assert found == pytest.approx(expected, rel=1e-9, abs=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize('name', NAMES)
def test_the_work_of_the_drives_is_the_change_of_energy(name):
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
def test_the_equation_of_motion_has_the_efforts_and_is_traced_to_the_last_bit(name):
    closure, spring = spring_of(weighed(name), 3.0)
    mechanics = Mechanics(closure, Loads(GRAVITY, (spring,), 0.02))
    for (q,), (w,), (a,) in states_of(closure, 4, 0.2):
        terms = mechanics.motion_terms(closure.position(q))
        expected = terms.inertia * a + terms.half_slope * w * w + terms.viscous * w
        (found,) = mechanics.drive_efforts(*motion_of(closure, (q,), (w,), (a,)))
        assert found == pytest.approx(expected + terms.potential_slope, rel=1e-12, abs=1e-12)
        assert _bits(mechanics.motion_equation(q)[:5]) == _bits(terms[:5])


@pytest.mark.parametrize('name', ['rssr', 'delta', 'ankle_motors'])
def test_efforts_are_traced_to_the_last_bit(name):
    closure, spring = spring_of(weighed(name), 3.0)
    mechanics = Mechanics(closure, Loads(GRAVITY, (spring,), 0.02))
    compiled = Compiled(closure, 2, lambda motion: [mechanics.drive_efforts(*motion)])
    for state in states_of(closure, 4):
        (fast,) = compiled.fast(*[number for part in state for number in part])
        assert _bits(fast) == _bits(mechanics.drive_efforts(*motion_of(closure, *state)))


def _bits(numbers):
    return struct.pack(f'{len(numbers)}d', *numbers)


def refusal(name, loads=None, **masses):
    closure = weighed(name)
    linkage = replace(closure.linkage, masses={**closure.linkage.masses, **masses})
    with pytest.raises(DefinitionError) as caught:
        Mechanics(SpaceClosure(linkage, name), loads)
    return str(caught.value)


def test_a_rod_that_may_spin_is_round_about_its_axis():
    rod = weighed('rssr').linkage.masses['rod']
    x, y, z = rod.center
    line = refusal('rssr', rod=replace(rod, center=(x, y + 0.01, z)))
    assert line.startswith('masses.rod.center: it is 0.00')
    assert 'universal joint' in line
    xx, xy, xz, yy, yz, zz = rod.inertia
    line = refusal('rssr', rod=replace(rod, inertia=(1.1 * xx, xy, xz, yy, yz, zz)))
    assert line.startswith('masses.rod.inertia: it is not round about the line through')
    assert 'universal joint' in line


def test_bodies_that_cannot_be_are_refused():
    crank = SpatialMass(1.0, (0.0, 0.0, 0.0), (1e-3, 0.0, 0.0, 1e-3, 0.0, 5e-3))
    assert refusal('rssr', crank=crank).startswith('masses.crank.inertia: its principal moments')


def test_gravity_has_as_many_numbers_as_the_linkage_has_directions():
    line = refusal('rssr', Loads((0.0, -9.81)))
    assert line == 'loads.gravity: [0, -9.81], and the linkage is spatial; write [x, y, z]'
