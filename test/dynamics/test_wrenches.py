# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Wrenches on links, as messages give them.

A crank alone, whose inertia about its pivot is 0.23 kg·m², moves in closed form; a four-bar by
scipy's integrator on an equation of motion written here; and on many linkages the effort of a
drive is the work of force and torque over the ways of point and link.
"""

from cmath import exp
from math import inf, nan

from linkage_ros.description import load_scene
from linkage_ros.dynamics import AppliedLoads, Loads, Mechanics, Reactions, WrenchLoad
from linkage_ros.errors import FileError
from linkage_ros.kinematics import GROUND
from linkage_ros.messages import read_wrench, Rejection
from linkage_ros.tick import Pipeline
import pytest
from scipy.integrate import solve_ivp

from .loaded import closed, slope, STATES
from ..support.four_bar import four_bar_angles, GALLERY
from ..support.messages import wrench_stamped
from ..support.scenes import LINKAGES, PENDULUM, pipeline_of

MS = 1_000_000
BEGIN = 1_700_000_000_000 * MS
INERTIA = 0.05 + 2.0 * 0.3**2


def crank_after(pipeline, messages, milliseconds):
    """Tick at each millisecond, offer messages in between; return angle and rate at the end."""
    (topic,) = pipeline.wrenches
    waiting = list(messages)
    for tick in range(milliseconds + 1):
        while waiting and waiting[0][0] <= tick:
            time, wrench = waiting.pop(0)
            assert topic.offer_wrench(wrench_stamped(*wrench), BEGIN + round(time * MS)) is None
        crank = pipeline.tick(BEGIN + tick * MS).states[0].crank
    return crank.angles[0], crank.rates[0]


# The messages as (time [ms], (fx, fy, moment)), and what follows in 100 ms: (duration [ms], torque
# about the pivot [N·m]). A message is valid for 30 ms.
TIMELINES = {
    'no message': ([], [(100, 0.0)]),
    'a torque, until it is too old': ([(0, (0, 0, 2.0))], [(30, 2.0), (70, 0.0)]),
    'one that begins between two ticks': ([(9.75, (0, 0, 2.0))],
                                          [(9.75, 0.0), (30, 2.0), (60.25, 0.0)]),
    'another one that replaces it': ([(10, (0, 0, 2.0)), (25.5, (0, 0, -1.0))],
                                     [(10, 0.0), (15.5, 2.0), (30, -1.0), (44.5, 0.0)]),
    'the same again, which keeps it': ([(10, (0, 0, 2.0)), (35, (0, 0, 2.0)), (60, (0, 0, 2.0))],
                                       [(10, 0.0), (80, 2.0), (10, 0.0)]),
    'of two at one time the last': ([(10, (0, 0, 9.0)), (10, (0, 0, 2.0))],
                                    [(10, 0.0), (30, 2.0), (60, 0.0)]),
    'a force across the link at 0.5 m, and a torque': ([(10, (7.0, 4.0, 0.25))],
                                                       [(10, 0.0), (30, 2.25), (60, 0.0)]),
}  # fmt: skip


DRIVES = {
    'rk4': 'method: rk4',
    'gauss_legendre': 'method: gauss_legendre',
    'within its play': 'play: {width: 2, inertia: 0.1}',
    'with a motor': 'motor: {torque_constant: 0.1}',
}


@pytest.mark.parametrize('drive', DRIVES)
@pytest.mark.parametrize('name', TIMELINES)
def test_wrench_message_moves_a_crank_until_max_age(name, drive):
    messages, pieces = TIMELINES[name]
    assert sum(duration for duration, _ in pieces) == 100
    pipeline = pipeline_of(
        f'drive: {{torque: {{{DRIVES[drive]}, start: 0.2, rate: 1}}}}\n'
        'loads: {wrenches: {crank: {point: end, frame: link, max_age: 0.03}}}\n',
        PENDULUM,
    )
    q, w = 0.2, 1.0
    for duration, torque in pieces:
        t = 1e-3 * duration
        q, w = q + w * t + 0.5 * torque / INERTIA * t * t, w + torque / INERTIA * t
    assert crank_after(pipeline, messages, 100) == pytest.approx((q, w), abs=1e-11)


def test_wrench_without_a_point_acts_at_link_origin():
    # There the crank has its pivot: the force does nothing.
    pipeline = pipeline_of('drive: {torque: {rate: 1}}\nloads: {wrenches: {crank: {}}}', PENDULUM)
    moved = crank_after(pipeline, [(0, (50.0, 30.0, 0.0))], 80)
    assert moved == pytest.approx((0.08, 1.0), abs=1e-12)


# The shipped four-bar: A, B, C, D are the lengths of crank, coupler, rocker and ground; of each
# link mass, centre and inertia; and P of the coupler.
(A, B, C, D), P = GALLERY, 0.060 + 0.030j
BODIES = (
    (0.025, 0.020, 4.2e-6),
    (0.100, 0.060 + 0.005j, 1.05e-4),
    (0.050, 0.040, 2.8e-5),
)


def four_bar(theta):
    """Return the angles of the links, from the intersection of two circles, and their origins."""
    return (theta, *four_bar_angles(theta)), (0j, A * exp(1j * theta), D + 0j)


def place(theta, link, point):
    turns, origins = four_bar(theta)
    return origins[link] + point * exp(1j * turns[link])


def inertia(theta):
    """Return that of the equation of motion, in [kg·m²]."""
    return sum(
        mass * abs(slope(lambda q: place(q, link, center), theta)) ** 2  # noqa: B023
        + own * slope(lambda q: four_bar(q)[0][link], theta) ** 2  # noqa: B023
        for link, (mass, center, own) in enumerate(BODIES)
    )


def pushed(theta, frame):
    """Return the force on the crank of 1.5, -2 N at P and 0.05 N·m on the coupler, in [N·m]."""
    phi = four_bar(theta)[0][1]
    force = (1.5 - 2.0j) * (exp(1j * phi) if frame == 'link' else 1.0)
    way, turning = (
        slope(lambda q: place(q, 1, P), theta),
        slope(lambda q: four_bar(q)[0][1], theta),
    )
    return (force.conjugate() * way).real + 0.05 * turning


@pytest.mark.parametrize('frame', ['ground', 'link'])
def test_a_wrench_on_the_coupler_moves_a_four_bar(frame):
    # I·q̈ + ½·I'·q̇² = F·r' + M·θ', with all derivatives as differences of places.
    def motion(_, state):
        q, w = state
        force = pushed(q, frame) - 0.5 * slope(inertia, q) * w * w
        return w, force / inertia(q)

    expected = solve_ivp(motion, (0.0, 0.05), (1.0, 2.0), 'DOP853', rtol=1e-10, atol=1e-11)
    pipeline = pipeline_of(
        'drive: {torque: {start: 1.0, rate: 2.0, step: 2.0e-4}}\n'
        f'loads: {{wrenches: {{coupler: {{point: P, frame: {frame}}}}}}}\n',
        (LINKAGES / 'four_bar.yaml').read_bytes(),
    )
    found = crank_after(pipeline, [(0, (1.5, -2.0, 0.05))], 50)
    assert abs(found[0] - 1.0) > 0.5, 'it has moved'
    assert found == pytest.approx(tuple(expected.y[:, -1]), rel=1e-7)


def held(closure, frame):
    """Return a linkage's mechanics with a wrench on each of its links, and these wrenches."""
    linkage = closure.linkage
    moving = [link for link in linkage.links if link != GROUND]
    loads = {link: WrenchLoad('', list(linkage.links[link])[-1], frame) for link in moving}
    mechanics = Mechanics(closure, Loads(applied=AppliedLoads(wrenches=loads)))
    wrenches = {link: (1.5 - n, 0.7 * n, 0.3 + 0.1 * n) for n, link in enumerate(moving)}
    for link, wrench in wrenches.items():
        mechanics.applied.wrenches[link].set_wrench(wrench, 0)
    return mechanics, wrenches


@pytest.mark.sample(8)
@pytest.mark.parametrize('frame', ['ground', 'link'])
@pytest.mark.parametrize('name', STATES)
def test_wrench_effort_equals_its_virtual_work(name, frame):
    closure = closed(name)
    mechanics, wrenches = held(closure, frame)
    linkage, bare = closure.linkage, Mechanics(closure)
    for q in STATES[name]:
        position = closure.position(*q)
        velocity = closure.velocity(position, *(0.0 for _ in q))
        given = position, velocity, closure.acceleration(position, velocity, *(0.0 for _ in q))
        efforts, without = mechanics.drive_efforts(*given), bare.drive_efforts(*given)
        for i in range(len(q)):

            def moved(by, i=i, q=q):
                return closure.position(*(x + by * (j == i) for j, x in enumerate(q)))

            work = 0.0
            for link, wrench in wrenches.items():
                point = link, list(linkage.links[link])[-1]
                way = slope(lambda by: closure.points(moved(by))[point], 0.0)  # noqa: B023
                turned = slope(
                    lambda by: exp(1j * closure.link_angles(moved(by))[link]),  # noqa: B023
                    0.0,
                )
                here = closure.link_angles(position)[link]
                force = complex(*wrench[:2])
                force *= exp(1j * here) if frame == 'link' else 1.0
                work += (force.conjugate() * way).real
                work += wrench[2] * (turned / exp(1j * here)).imag
            assert efforts[i] - without[i] == pytest.approx(-work, rel=1e-9, abs=1e-9)


@pytest.mark.sample(8)
@pytest.mark.parametrize('frame', ['ground', 'link'])
@pytest.mark.parametrize('name', STATES)
def test_pin_forces_balance_the_wrench_on_every_link(name, frame):
    # The equations of Newton and Euler of each link, which know nothing of levers.
    closure = closed(name)
    mechanics, _ = held(closure, frame)
    for q in STATES[name]:
        position = closure.position(*q)
        velocity = closure.velocity(position, *(0.8 for _ in q))
        acceleration = closure.acceleration(position, velocity, *(1.1 for _ in q))
        given = position, velocity, acceleration
        assert Reactions(mechanics).drive_efforts(*given) == pytest.approx(
            mechanics.drive_efforts(*given), rel=1e-8, abs=1e-9
        )


@pytest.mark.sample(5)
@pytest.mark.parametrize('name', [name for name in STATES if name != 'five_bar'])
def test_compiled_wrench_terms_equal_the_interpreted_ones(name):
    closure = closed(name)
    mechanics, _ = held(closure, 'link')
    for (q,) in STATES[name]:
        assert mechanics.motion_equation(q) == mechanics.motion_terms(closure.position(q))


def test_holding_effort_includes_a_wrench_until_max_age():
    # At 0.3 rad 2 N at 0.5 m across the crank, and 0.5 N·m: the drive holds the opposite.
    pipeline = pipeline_of(
        'drive: {constant_rate: {start: 0.3, rate: 0}}\neffects: {effort: {}}\n'
        'loads: {wrenches: {crank: {point: end, frame: link, max_age: 0.01}}}\n',
        PENDULUM,
    )
    efforts = []
    for tick in range(40):
        if tick == 10:
            assert (
                pipeline.wrenches[0].offer_wrench(wrench_stamped(3, 2, 0.5), BEGIN + 10 * MS)
                is None
            )
        efforts.append(pipeline.tick(BEGIN + tick * MS).states[0].reading.efforts[0])
    assert efforts == pytest.approx([0.0] * 10 + [-1.5] * 10 + [0.0] * 20, abs=1e-14)


MESSAGES = {
    'big-endian': ({'little': False}, (1.0, 2.0, 3.0)),
    'a long frame': ({'frame': 'a/frame/of/21/letters'}, (1.0, 2.0, 3.0)),
    'no number where none counts': ({'others': (nan, inf, -inf)}, (1.0, 2.0, 3.0)),
}


@pytest.mark.parametrize('name', MESSAGES)
def test_planar_wrench_uses_three_numbers_of_the_message(name):
    given, expected = MESSAGES[name]
    numbers = read_wrench(wrench_stamped(1.0, 2.0, 3.0, **given))
    # Of force.x, y, z and torque.x, y, z.
    assert tuple(numbers[index] for index in (0, 1, 5)) == expected


BAD = {
    'nothing': (b'', Rejection.MALFORMED),
    'half of one': (wrench_stamped(1, 2, 3)[:40], Rejection.MALFORMED),
    'a frame without an end': (
        wrench_stamped(1, 2, 3)[:12] + b'\xff' * 8, Rejection.MALFORMED
    ),
    'no number': (wrench_stamped(nan, 0, 0), Rejection.WRENCH_NOT_FINITE),
    'an infinite torque': (wrench_stamped(0, 0, -inf), Rejection.WRENCH_NOT_FINITE),
    'too much': (wrench_stamped(0, 1.1e9, 0), Rejection.WRENCH_TOO_LARGE),
}  # fmt: skip


@pytest.mark.parametrize('name', BAD)
def test_rejected_wrench_message_changes_nothing(name):
    message, reason = BAD[name]
    scene = 'drive: {torque: {}}\nloads: {wrenches: {crank: {}}}\n'
    one, other = pipeline_of(scene, PENDULUM), pipeline_of(scene, PENDULUM)
    for pipeline in (one, other):
        pipeline.tick(BEGIN)
        assert pipeline.wrenches[0].offer_wrench(wrench_stamped(0, 0, 1e9), BEGIN) is None
    assert one.wrenches[0].offer_wrench(message, BEGIN + MS // 2) is reason
    for tick in range(1, 150):
        now = BEGIN + tick * MS
        assert one.tick(now).message == other.tick(now).message


# What is refused: the wrenches, and what the line says.
REFUSED = {
    '{hand: {}}': "loads.wrenches.hand: there is no link 'hand'; there are: crank",
    '{ground: {}}': "loads.wrenches.ground: there is no link 'ground'; there are: crank",
    '{crank: {point: ned}}': "loads.wrenches.crank.point: 'ned' is not a point of 'crank'; ",
    '{crank: {topic: two words}}': "crank.topic: 'two words' is not a ROS topic; write a topic",
    '{crank: {topic: 2nd}}': "'2nd' is not a ROS topic",
    '{crank: {topic: a//b}}': "'a//b' is not a ROS topic",
    '{crank: {topic: a/}}': "'a/' is not a ROS topic",
    f'{{crank: {{topic: {201 * "a"}}}}}': 'is not a ROS topic',
    '{crank: {topic: /crank_commands}}': "'crank_commands' is the topic of the drive; write",
    '{crank: {topic: joint_states}}': "'joint_states' is the topic of the joint states; write",
    '{crank: {frame: world}}': "loads.wrenches.crank.frame: 'world' is not a choice; write ground",
    '{crank: {max_age: 0}}': 'loads.wrenches.crank.max_age',
    '{crank: {age: 1}}': 'loads.wrenches.crank.age: unknown key',
}


@pytest.mark.parametrize('wrenches', REFUSED)
def test_invalid_wrench_is_refused_in_one_line(wrenches):
    with pytest.raises(FileError) as refused:
        pipeline_of(f'drive: {{torque: {{}}}}\nloads: {{wrenches: {wrenches}}}\n', PENDULUM)
    assert REFUSED[wrenches] in str(refused.value)
    assert '\n' not in str(refused.value)


def test_two_wrenches_on_one_topic_are_refused():
    with pytest.raises(FileError) as refused:
        pipeline_of(
            'drive: {torque: {}}\n'
            'loads: {wrenches: {coupler: {topic: push}, rocker: {topic: /push}}}\n',
            (LINKAGES / 'four_bar.yaml').read_bytes(),
        )
    line = (
        "loads.wrenches.rocker.topic: 'push' is the topic of loads.wrenches.coupler; write another"
    )
    assert line in str(refused.value)


@pytest.fixture
def together(tmp_path):
    """Return a function that builds a scene of so many four-bars with the same loads."""

    def build(count):
        members = ', '.join(
            f'{{name: bar{n}, linkage: {LINKAGES}/four_bar.yaml}}' for n in range(count)
        )
        scene = tmp_path / 'scene.yaml'
        scene.write_text(
            f'linkages: [{members}]\ndrive: {{torque: {{}}}}\n'
            'loads: {wrenches: {crank: {}, coupler: {}, rocker: {}}}\n'
        )
        return Pipeline(load_scene(scene))

    return build


def test_wrench_topics_of_several_linkages_carry_their_names(together):
    assert [wrench.topic for wrench in together(2).wrenches] == [
        *('wrenches/bar0_crank', 'wrenches/bar0_coupler', 'wrenches/bar0_rocker'),
        *('wrenches/bar1_crank', 'wrenches/bar1_coupler', 'wrenches/bar1_rocker'),
    ]


def test_scene_with_33_wrenches_is_refused(together):
    with pytest.raises(FileError) as refused:
        together(11)
    assert 'loads.wrenches.rocker.topic: is one of 33, more than 32; leave some' in str(
        refused.value
    )


def test_accepted_wrench_topics_are_valid_ros_names():
    validate = pytest.importorskip('rclpy.validate_topic_name').validate_topic_name
    for name in ('push', 'a/b_2/C', '/push', '~/push', '_a', 'a__b', 'wrenches/coupler'):
        pipeline = pipeline_of(
            f'drive: {{torque: {{}}}}\nloads: {{wrenches: {{crank: {{topic: {name}}}}}}}\n',
            PENDULUM,
        )
        assert pipeline.wrenches[0].topic == name
        assert validate(name)
