# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The crank from a topic, also as ros2_control sends it."""

from math import inf, isnan, nan, tau
from pathlib import Path
import re
from xml.etree import ElementTree as ET

from hypothesis import given, strategies as st
from linkage_ros.description import parse_scene
from linkage_ros.kinematics import Input
from linkage_ros.messages import CrankSample, Rejection
from linkage_ros.stages.drives import CrankState, sample_inputs, SampledCrank, TopicDrive
from linkage_ros.tick import Pipeline
import pytest

from ...support.messages import joint_state as serialized, read_joint_state
from ...support.scenes import FOUR_BAR, pipeline_of

# The crank from a topic, as timelines.
#
# Each line of a timeline has a time in ms and an event: a sample is offered, with its stamp in
# ms, angle and rate, and the drive's verdict; or the state is read, with its expected value.


MS = 1_000_000
SECOND = 1000 * MS
NOW = 10 * SECOND
CARRIED = TopicDrive(carry_forward=True, max_age=0.2, max_lead=0.1)
HELD = TopicDrive(carry_forward=False, max_age=0.2, max_lead=0.1)
SILENT = None
GOOD = None


def sample(stamp, angle, rate=0.0):
    return CrankSample(stamp * MS, (angle,), (rate,))


# Name: (parameters, [(time, sample or None, its rejection or (angle, rate, age in ms) or None)]).
TIMELINES = {
    'before the first sample there is no crank': (CARRIED, [
        (1000, None, SILENT), (5000, None, SILENT),
    ]),
    'carried forward by its rate': (CARRIED, [
        (1000, sample(1000, 0.5, 2.0), GOOD), (1000, None, (0.5, 2.0, 0)),
        (1100, None, (0.7, 2.0, 100)), (1200, None, (0.9, 2.0, 200)),
    ]),
    'held as measured': (HELD, [
        (1000, sample(1000, 0.5, 2.0), GOOD), (1100, None, (0.5, 2.0, 100)),
        (1200, None, (0.5, 2.0, 200)),
    ]),
    'silent from the age limit on, until the next sample': (CARRIED, [
        (1000, sample(1000, 0.5, 2.0), GOOD), (1200, None, (0.9, 2.0, 200)), (1201, None, SILENT),
        (9000, None, SILENT), (9001, sample(9001, 3.0), GOOD), (9001, None, (3.0, 0.0, 0)),
    ]),
    'it is the stamp that ages, not the arrival': (CARRIED, [
        (1150, sample(1000, 0.5, 2.0), GOOD), (1150, None, (0.8, 2.0, 150)), (1201, None, SILENT),
    ]),
    'a sample that comes too late is no crank': (CARRIED, [
        (2000, sample(1000, 0.5, 2.0), GOOD), (2000, None, SILENT),
    ]),
    'a repeat does not make it younger': (HELD, [
        (1000, sample(1000, 0.5), GOOD), (1150, sample(1000, 0.5), GOOD),
        (1150, None, (0.5, 0.0, 150)), (1250, sample(1000, 0.5), GOOD), (1250, None, SILENT),
    ]),
    'a stamp a little ahead is carried back': (CARRIED, [
        (1000, sample(1100, 0.5, 2.0), GOOD), (1000, None, (0.3, 2.0, -100)),
    ]),
    'a stamp further ahead is refused': (CARRIED, [
        (1000, sample(1000, 0.5), GOOD),
        (1010, sample(1111, 0.9), Rejection.STAMP_FUTURE),
        (1010, None, (0.5, 0.0, 10)),
        (1011, sample(1111, 0.9), GOOD),
    ]),
    'an older stamp is refused': (CARRIED, [
        (1000, sample(1000, 0.5), GOOD),
        (1010, sample(999, 0.9), Rejection.STAMP_OLD),
        (1010, None, (0.5, 0.0, 10)),
        (1020, sample(1005, 0.6), GOOD),
        (1020, None, (0.6, 0.0, 15)),
    ]),
    'of several samples between two ticks the newest counts': (CARRIED, [
        (1000, sample(998, 0.1), GOOD), (1000, sample(999, 0.2), GOOD),
        (1000, sample(1000, 0.3), GOOD), (1000, None, (0.3, 0.0, 0)),
    ]),
}  # fmt: skip


@pytest.mark.parametrize('name', TIMELINES)
def test_topic_samples_drive_the_crank_on_time(name):
    parameters, steps = TIMELINES[name]
    drive = SampledCrank(parameters, needs_rate=False)
    for time, offered, expected in steps:
        if offered is not None:
            assert drive.offer(offered, time * MS) is expected
        elif expected is SILENT:
            assert drive.state(time * MS) is None
        else:
            angle, rate, age = expected
            angles = (pytest.approx(angle, abs=1e-12),)
            assert drive.state(time * MS) == (angles, (rate,), (0.0,), age * MS)


@pytest.mark.parametrize(
    ('bad', 'reason'),
    [
        (CrankSample(NOW, (nan,), (0.0,)), Rejection.NOT_FINITE),
        (CrankSample(NOW, (inf,), (0.0,)), Rejection.NOT_FINITE),
        (CrankSample(NOW, (0.0,), (-inf,)), Rejection.NOT_FINITE),
        (CrankSample(NOW, (1.0000001e10,), (0.0,)), Rejection.TOO_LARGE),
        (CrankSample(NOW, (-1e300,), (0.0,)), Rejection.TOO_LARGE),
        (CrankSample(NOW, (0.0,), (1.0000001e10,)), Rejection.TOO_LARGE),
        (CrankSample(0, (0.0,), (0.0,)), Rejection.STAMP_ZERO),
        (CrankSample(NOW + 101 * MS, (0.0,), (0.0,)), Rejection.STAMP_FUTURE),
        (CrankSample(2**31 * SECOND, (0.0,), (0.0,)), Rejection.STAMP_FUTURE),
        (CrankSample(NOW - 11 * MS, (0.0,), (0.0,)), Rejection.STAMP_OLD),
        (CrankSample(1, (0.0,), (0.0,)), Rejection.STAMP_OLD),
    ],
)
def test_bad_sample_leaves_the_crank_unchanged(bad, reason):
    drive = SampledCrank(CARRIED, needs_rate=True)
    assert drive.offer(CrankSample(NOW - 10 * MS, (0.5,), (2.0,)), NOW) is GOOD
    before = drive.state(NOW)
    assert drive.offer(bad, NOW) is reason
    assert drive.state(NOW) == before
    assert drive.stamp == NOW - 10 * MS
    assert drive.offer(CrankSample(NOW, (0.6,), (2.0,)), NOW) is GOOD
    assert drive.state(NOW) == CrankState((0.6,), (2.0,), (0.0,), 0)


@pytest.mark.parametrize('angle', [1e10, -1e10])
def test_largest_allowed_numbers_are_accepted(angle):
    drive = SampledCrank(CARRIED, needs_rate=True)
    assert drive.offer(CrankSample(NOW, (angle,), (angle,)), NOW) is GOOD
    assert drive.state(NOW) == CrankState((angle,), (angle,), (0.0,), 0)


# joint_state_broadcaster fills in NaN for an interface that is not there; others send no array.
ABSENT = {'no velocities': None, 'a velocity that is NaN': (nan,)}


@pytest.mark.parametrize('rates', ABSENT.values(), ids=ABSENT)
@pytest.mark.parametrize('needs_rate', [True, False])
def test_absent_rate_is_zero_without_a_user(rates, needs_rate):
    drive = SampledCrank(CARRIED if needs_rate else HELD, needs_rate=False)
    assert drive.offer(CrankSample(NOW, (0.5,), rates), NOW) is GOOD
    expected = None if needs_rate else CrankState((0.5,), (0.0,), (0.0,), 0)
    assert drive.state(NOW) == expected
    assert drive.stamp == NOW


# (time in ms, angle, rate or None), and the expected rate at the last of them.
ABSENT_RATES = {
    'two samples': ([(0, 0.5, None), (10, 0.52, None)], 2.0),
    'three': ([(0, 0.5, None), (10, 0.52, None), (30, 0.46, None)], -3.0),
    'over a gap the mean': ([(0, 0.5, None), (1000, 1.5, None)], 1.0),
    'a known rate counts': ([(0, 0.5, None), (10, 0.52, 7.0)], 7.0),
    'behind a known one': ([(0, 0.5, 7.0), (10, 0.52, None)], 2.0),
    'a repeat keeps it': ([(0, 0.5, None), (10, 0.52, None), (10, 0.9, None)], 2.0),
    'from π to -π': ([(0, 3.14, None), (10, 3.16 - tau, None)], 2.0),
    'from -π to π': ([(0, -3.14, None), (10, tau - 3.16, None)], -2.0),
    'many turns on': ([(0, 100 * tau, None), (10, 100 * tau + 0.02, None)], 2.0),
    'one sample has none': ([(0, 0.5, None)], None),
    'a repeat of the first has none': ([(0, 0.5, None), (0, 0.6, None)], None),
}


@pytest.mark.parametrize('as_nan', [False, True])
@pytest.mark.parametrize('name', ABSENT_RATES)
def test_absent_rate_is_differenced_from_the_angles(name, as_nan):
    steps, expected = ABSENT_RATES[name]
    drive = SampledCrank(CARRIED, needs_rate=True)
    for time, angle, rate in steps:
        rates = ((nan,) if as_nan else None) if rate is None else (rate,)
        now = NOW + time * MS
        assert drive.offer(CrankSample(now, (angle,), rates), now) is GOOD
    if expected is None:
        assert drive.state(now) is None
    else:
        assert drive.state(now).rates == (pytest.approx(expected, rel=1e-12),)
        (carried,) = drive.state(now + 5 * MS).angles
        assert carried == pytest.approx(angle + expected * 0.005, abs=1e-12)


def test_only_absent_rates_of_several_inputs_are_differenced():
    slide = (Input('crank', 'ground', 'crank'), Input('slide', slider='s'), Input('c', 'a', 'b'))
    drive = sample_inputs(CARRIED, True, slide)
    assert drive.offer(CrankSample(NOW, (3.1, 0.0, 1.0), (nan, nan, 9.0)), NOW) is GOOD
    now = NOW + 10 * MS
    assert drive.offer(CrankSample(now, (-3.1, 5.0, 2.0), (nan, nan, 8.0)), now) is GOOD
    expected = ((tau - 6.2) * 100.0, 500.0, 8.0)
    assert drive.state(now).rates == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize('carry', ['true', 'false'])
@pytest.mark.parametrize('effects', ['{velocity: {}}', '{}'])
@pytest.mark.parametrize('velocities', [[], [nan, nan], [9.0, nan]])
@pytest.mark.parametrize('efforts', [[], [nan, nan]])
def test_scene_accepts_broadcaster_messages_without_velocities(
    carry, effects, velocities, efforts
):
    scene = pipeline_of(
        f'drive: {{topic: {{carry_forward: {carry}}}}}\neffects: {effects}', FOUR_BAR
    )
    for n in range(3):
        stamp = 10 * SECOND + 10 * n * MS
        message = serialized(
            ['x', 'crank_joint'], [nan, 1.0 + 0.02 * n], velocities, efforts,
            stamp=divmod(stamp, SECOND),
        )  # fmt: skip
        assert scene.offer(message, stamp) is GOOD
    crank = scene.tick(stamp + 5 * MS).states[0].crank
    assert crank.angles[0] == pytest.approx(1.05 if carry == 'true' else 1.04, abs=1e-12)
    if carry == 'true' or 'velocity' in effects:
        assert crank.rates[0] == pytest.approx(2.0, rel=1e-9)


samples = st.builds(
    CrankSample,
    st.integers(0, 2 * NOW)
    | st.integers(NOW - 200 * MS, NOW + 100 * MS)
    | st.sampled_from([0, NOW - 200 * MS - 1, NOW - 200 * MS, NOW, NOW + 100 * MS]),
    st.tuples(st.floats() | st.floats(-10, 10)),
    st.tuples(st.floats(allow_nan=False) | st.floats(-10, 10)),
)


@given(st.lists(samples, max_size=20))
def test_crank_state_equals_the_last_good_sample(offered):
    drive = SampledCrank(HELD, needs_rate=True)
    good = None
    for each in offered:
        if drive.offer(each, NOW) is GOOD:
            assert good is None or each.stamp >= good.stamp
            good = each
    state = drive.state(NOW)
    if good is None or NOW - good.stamp > HELD.max_age * SECOND:
        assert state is None
    else:
        assert state == CrankState(good.angles, good.rates, (0.0,), NOW - good.stamp)


def test_each_input_is_carried_forward_by_its_own_rate():
    drive = sample_inputs(CARRIED, True, [Input(name, 'ground', name) for name in 'abc'])
    assert drive.offer(CrankSample(NOW, (1.0, -2.0, 0.5), (10.0, 0.0, -3.0)), NOW) is GOOD
    angles, rates, accelerations, age = drive.state(NOW + 100 * MS)
    assert angles == pytest.approx((2.0, -2.0, 0.2))
    assert rates == (10.0, 0.0, -3.0)
    assert accelerations == (0.0, 0.0, 0.0), 'what a JointState cannot tell'
    assert age == 100 * MS


@pytest.mark.parametrize(
    ('bad', 'reason'),
    [(nan, Rejection.NOT_FINITE), (-inf, Rejection.NOT_FINITE), (2e10, Rejection.TOO_LARGE)],
)
@pytest.mark.parametrize('place', range(4))
def test_one_bad_input_rejects_the_whole_sample(bad, reason, place):
    if isnan(bad) and place > 1:
        bad = inf  # a rate that is NaN is absent
    drive = sample_inputs(CARRIED, True, [Input(name, 'ground', name) for name in 'ab'])
    values = [0.1, 0.2, 0.3, 0.4]
    values[place] = bad
    sample = CrankSample(NOW, tuple(values[:2]), tuple(values[2:]))
    assert drive.offer(sample, NOW) is reason
    assert drive.state(NOW) is None


# The system of docs/how_to/stand_in.md, with ros2_control's topic-based hardware.
#
# `Hardware` does what read() and write() of joint_state_topic_hardware_interface do in the
# versions 1.0.0 and 1.1.0 (joint_state_topic_hardware_interface.cpp). Its get_state() and
# set_state() follow hardware_component_interface.hpp of Jazzy: they throw if there is no such
# interface.


PAGE = (Path(__file__).parents[3] / 'docs' / 'how_to' / 'stand_in.md').read_text('utf-8')
SYSTEM = re.search(r'```xml\n(.*?)```', PAGE, re.DOTALL)[1]

SCENE, LINKAGE = (
    re.search(rf"cat > {name} <<'EOF'\n(.*?)EOF\n", PAGE, re.DOTALL)[1]
    for name in ('under_torque.yaml', 'press.yaml')
)

ALWAYS = '<param name="trigger_joint_command_threshold">-1</param>'
INTERFACES = ('position', 'velocity', 'effort')


class Hardware:
    """A system of ros2_control, as its XML says it."""

    def __init__(self, text, version):
        system = ET.fromstring(text)
        given = {each.get('name'): each.text for each in system.iter('param')}
        self._threshold = float(given.get('trigger_joint_command_threshold', 1e-5))
        self._compared = (
            ('position',) if version == '1.0.0' else ('position', 'velocity', 'effort')
        )
        self._joints = {
            joint.get('name'): [each.get('name') for each in joint.iter('command_interface')]
            for joint in system.findall('joint')
        }
        self.states = {
            (joint.get('name'), each.get('name')): nan
            for joint in system.findall('joint')
            for each in joint.iter('state_interface')
        }
        self.effort = nan

    def read(self, message):
        state = read_joint_state(message)
        for place, name in enumerate(state.name):
            if name in self._joints:
                for interface in INTERFACES:
                    values = getattr(state, interface)
                    if len(values):
                        assert (name, interface) in self.states, 'set_state() throws'
                        self.states[name, interface] = values[place]

    def write(self):
        """Return a message of the commands, or nothing where none is sent."""
        off = 0.0
        for name, commands in self._joints.items():
            for interface in commands:
                if interface in self._compared:
                    off += abs(self.states[name, interface] - self.effort)
        if off <= self._threshold:
            return None
        efforts = [self.effort for commands in self._joints.values() for _ in commands]
        return serialized(list(self._joints), efforts=efforts)


def pipeline():
    scene = SCENE.replace('press.yaml', 'linkage.yaml')
    files = {'scene.yaml': scene.encode(), 'linkage.yaml': LINKAGE.encode()}
    return Pipeline(parse_scene('under_torque', '', files))


@pytest.mark.parametrize('version', ['1.0.0', '1.1.0'])
def test_commands_of_an_active_controller_are_accepted(version):
    """For 2 s at 500 Hz; the crank moves by it."""
    hardware, linkage = Hardware(SYSTEM, version), pipeline()
    hardware.read(linkage.tick(0).message)
    assert linkage.offer(hardware.write(), 0) is Rejection.EFFORT_NOT_FINITE, 'none is active'
    begun = hardware.states['crank_joint', 'position']
    hardware.effort = 0.12
    for now in range(2 * MS, 2000 * MS, 2 * MS):
        assert linkage.offer(hardware.write(), now) is None
        hardware.read(linkage.tick(now).message)
    assert abs(hardware.states['crank_joint', 'position'] - begun) > 0.5


@pytest.mark.parametrize('version', ['1.0.0', '1.1.0'])
def test_default_threshold_suppresses_unchanged_commands(version):
    hardware = Hardware(SYSTEM.replace(ALWAYS, ''), version)
    assert hardware.write() is None or version == '1.1.0'
    hardware.states['crank_joint', 'effort'] = hardware.effort = 0.12
    assert hardware.write() is None
    always = Hardware(SYSTEM, version)
    always.states, always.effort = hardware.states, hardware.effort
    assert always.write() is not None


@pytest.mark.parametrize('interface', INTERFACES)
def test_hardware_needs_every_published_state_interface(interface):
    without = SYSTEM.replace(f'<state_interface name="{interface}"/>', '')
    with pytest.raises(AssertionError, match='set_state'):
        Hardware(without, '1.1.0').read(pipeline().tick(0).message)


@pytest.mark.parametrize(
    ('angles', 'jump'),
    [([0.0, 0.1, 0.3], 0.2), ([3.1, -3.1], 6.2), ([179.0, -179.0, -178.0], 358.0), ([5.0], 0.0)],
)
def test_topic_drive_keeps_the_greatest_angle_jump(angles, jump):
    """A crank in degrees, when it is wrapped, jumps by 360 rad."""
    drive = SampledCrank(CARRIED, needs_rate=True)
    for index, angle in enumerate(angles):
        assert drive.offer(sample(1000 + index, angle), NOW) is GOOD
    assert drive.jump == pytest.approx(jump)
