# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A scene publishes the closed forms of textbooks, worked out in 40 digits.

Poses are those of textbooks (R. L. Norton, Design of Machinery, ch. 4); rates and accelerations
are mpmath's derivatives of them by time, along the motion of the crank. Nothing of the package is
used for them.
"""

from mpmath import MPContext
import pytest

from .four_bar_by_hand import FourBar
from .loaded import GRAVITY
from ...support.four_bar import meeting_point
from ...support.messages import read_joint_state, STORE
from ...support.scenes import LINKAGES, pipeline_of, shipped

MS = 1_000_000
BEGIN = 1_700_000_000_000_000_000
mp = MPContext()
mp.dps = 40
mpf = mp.mpf


def crank(t):
    """Return where the crank is: a sine of 0.9 rad about 1, three times a second."""
    return 1 + mpf('0.9') * mp.sin(6 * mp.pi * t)


DRIVE = 'drive: {sine: {mean: 1, amplitude: 0.9, frequency: 3}}\n'


def circle(angle, radius):
    return mp.mpc(radius * mp.cos(angle), radius * mp.sin(angle))


def four_bar(q):
    a, b, c, d = (mpf(x) / 1000 for x in (40, 120, 80, 100))
    at_b = meeting_point(circle(q, a), d, b, c)
    return mp.arg(at_b - circle(q, a)) - q, mp.arg(at_b - d)


def slider_crank(q):
    # The offset is 10 mm, and the slide is measured from above the crankshaft.
    r, rod, offset = (mpf(x) / 1000 for x in (40, 140, 10))
    down = r * mp.sin(q) - offset
    angle = -mp.asin(down / rod)
    return angle - q, r * mp.cos(q) + rod * mp.cos(angle)


def inverted_slider_crank(q):
    rod = mp.mpc('0.25', '0.1') - circle(q, mpf('0.15'))
    return mp.arg(rod) - q, abs(rod)


TEXTBOOKS = {
    'four_bar': four_bar,
    'slider_crank': slider_crank,
    'inverted_slider_crank': inverted_slider_crank,
}


def pipeline(name, text):
    return pipeline_of(text, (LINKAGES / f'{name}.yaml').read_bytes())


def doubles(values):
    return [float(value) for value in values]


@pytest.mark.parametrize('name', TEXTBOOKS)
def test_scene_publishes_derivatives_of_the_textbook_pose(name):
    effects = 'effects: {velocity: {}, acceleration: {}}'
    built = pipeline(name, f'publish_input: false\n{DRIVE}{effects}')
    solved = TEXTBOOKS[name]
    for index in range(0, 400, 9):
        tick = built.tick(BEGIN + index * MS)
        state = read_joint_state(tick.message)
        (extra,) = tick.extras
        motion = STORE.deserialize_cdr(extra, 'trajectory_msgs/msg/JointTrajectory')
        t = mpf(index) / 1000
        n = len(state.position)
        places = doubles(solved(crank(t)))
        rates, pulls = (
            doubles(mp.diff(lambda u, i=i: solved(crank(u))[i], t, order) for i in range(n))
            for order in (1, 2)
        )
        assert list(state.position) == pytest.approx(places, abs=1e-14)
        assert list(state.velocity) == pytest.approx(rates, rel=1e-12, abs=1e-12)
        (point,) = motion.points
        assert list(point.velocities) == list(state.velocity)
        assert list(point.accelerations) == pytest.approx(pulls, rel=1e-11, abs=1e-10)


def test_friction_effort_equals_the_dissipated_power():
    # What the drive gives for it times the crank's rate is Σ (c·v² + T·|v|).
    rubbing = {
        'O2': (0.01, 0.05),
        'A': (0.02, 0.03),
        'cylinder': (3.0, 4.0),
    }
    joints = ', '.join(f'{n}: {{viscous: {c}, coulomb: {t}}}' for n, (c, t) in rubbing.items())
    efforts = []
    for effects in ('', f', friction: {{joints: {{{joints}}}}}'):
        built = pipeline('slider_crank', f'{DRIVE}effects: {{effort: {{}}{effects}}}')
        ticks = [built.tick(BEGIN + index * 7 * MS) for index in range(40)]
        efforts.append([tick.states[0].reading.efforts[0] for tick in ticks])
    for index, (bare, rubbed) in enumerate(zip(*efforts, strict=True)):
        t = mpf(7 * index) / 1000
        rate = mp.diff(crank, t)
        rod, slide = (mp.diff(lambda u, i=i: slider_crank(crank(u))[i], t) for i in range(2))
        slips = {'O2': rate, 'A': rod, 'cylinder': slide}
        burnt = sum(c * slips[n] ** 2 + x * abs(slips[n]) for n, (c, x) in rubbing.items())
        assert (rubbed - bare) * float(rate) == pytest.approx(float(burnt), rel=1e-9, abs=1e-12)


@pytest.mark.parametrize('link', ['coupler', 'rocker'])
def test_stretched_link_gives_the_four_bar_with_longer_link(link):
    # The tension is that of the balance by hand, the pose that of the textbook with another
    # length. The effect is right to first order: its error falls with the square of the stretch.
    drawn = shipped('four_bar')
    at, rate, pull = 1.0, 9.0, 0.0
    by_hand = FourBar(drawn, (at, rate, pull), GRAVITY)
    _, coupler, rocker = (complex(mp.cos(a), mp.sin(a)) for a in map(mpf, by_hand.angles(0)))
    _, at_a, at_b, at_d = (complex(force) for force in by_hand.balance()[2])
    axis, force = {'coupler': (coupler, -at_b - at_a), 'rocker': (rocker, at_b - at_d)}[link]
    tension = 0.5 * (force * axis.conjugate()).real
    rigid = doubles(by_hand.angles(0))
    errors = []
    for stiffness in (2e3, 4e3):
        scene = (
            'publish_input: false\nloads: {gravity: [0, -9.81]}\n'
            f'drive: {{constant_rate: {{rate: {rate}, start: {at}}}}}\n'
            f'effects: {{compliance: {{links: {{{link}: {stiffness}}}}}}}'
        )
        reading = pipeline('four_bar', scene).tick(BEGIN).states[0].reading
        stretched = FourBar(drawn, (at, rate, pull), GRAVITY)
        if link == 'coupler':
            stretched.b += tension / stiffness
        else:
            stretched.c += tension / stiffness
        theta, phi, psi = doubles(stretched.angles(0))
        moved = psi - rigid[2]
        found = reading.joints[1] - rigid[2]
        assert found == pytest.approx(moved, rel=0.01)
        assert reading.joints[0] == pytest.approx(phi - theta, abs=0.02 * abs(moved))
        errors.append(abs(found - moved))
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.05)
