# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Drives and the limits of joints: what would leave them is refused, and a torque is stopped."""

from hypothesis import given, settings, strategies as st
from linkage_ros.errors import FileError
from linkage_ros.kinematics import Status
from linkage_ros.messages import EffortCommand
from linkage_ros.stages.drives import ProfileDrive
import pytest

from ...support.scenes import four_bar_text, pipeline_of, symmetric_five_bar

MS = 1_000_000
BEGIN = 1_700_000_000 * 1_000 * MS
OWN = ', input: {limits: [0.5, 1.5]}'
MASSES = [(0.1, 0.05, 1e-4), (0.1, 0.035, 1e-4), (0.1, 0.03, 1e-4)]
PUBLISHED = ', joints: {rocker_joint: {limits: [1.5, 2]}}'


def four_bar(limits):
    return f'four_bar: {{a: 0.04, b: 0.12, c: 0.08, d: 0.1{limits}}}'


def pipeline(drive, linkage):
    return pipeline_of(f'drive: {{{drive}}}', linkage)


CHIRP = 'chirp: {amplitude: 0.6, mean: 1, start_frequency: 0.01, end_frequency: 0.02, seconds: 5}'

# Drive, limits, and the error; '' if the scene runs.
DRIVES = {
    'at rest': ('constant_rate: {rate: 0, start: 1}', OWN, ''),
    'on and on': (
        'constant_rate: {rate: 0.1, start: 1}',
        OWN,
        "takes 'crank_joint' from 1 rad to inf rad, beyond its limits [0.5, 1.5] rad; stay",
    ),
    'at rest beyond': ('constant_rate: {rate: 0, start: 2}', OWN, ' from 2 rad to 2 rad, beyond'),
    'a sine to the limits': ('sine: {amplitude: 0.5, mean: 1, frequency: 1}', OWN, ''),
    'a sine to limits in tenths': ('sine: {amplitude: 0.35, mean: 0.45, frequency: 1}',
                                   ', input: {limits: [0.1, 0.8]}', ''),
    'a sine beyond': (
        'sine: {amplitude: 0.51, mean: 1, frequency: 1}',
        OWN,
        "drive.sine: takes 'crank_joint' from 0.49 rad to 1.51 rad, beyond its limits [0.5, 1.5]",
    ),
    'a chirp beyond': (
        'chirp: {amplitude: 0.6, mean: 1, start_frequency: 1, end_frequency: 2, seconds: 3}',
        OWN,
        "takes 'crank_joint' from 0.4 rad to 1.6 rad",
    ),
    'a chirp that ends on its way up': (CHIRP, OWN, ''),
    'the same, there and back': (f'{CHIRP[:-1]}, repeat: true}}', OWN,
                                 "takes 'crank_joint' from 0.4 rad to 1.6 rad"),
    'rows within': ('profile: {table: [[0, 1], [1, 1.5]], interpolation: linear}', OWN, ''),
    'a spline that swings beyond its rows': (
        'profile: {table: [[0, 1], [1, 1.5], [2, 1.49], [3, 1]]}',
        OWN,
        "drive.profile: takes 'crank_joint' from 1 rad to 1.61884 rad, beyond its limits",
    ),
    'rows that gain': ('profile: {table: [[0, 1], [1, 1.2]], interpolation: linear, repeat: true}',
                       OWN, "takes 'crank_joint' from 1 rad to inf rad"),
    'a joint that follows': (
        'constant_rate: {rate: 1, start: 2}',
        PUBLISHED,
        "from 2 rad to inf rad, beyond 2.79718 rad, where 'rocker_joint' is at its limit",
    ),
    'a joint within': ('sine: {amplitude: 0.4, mean: 2.2, frequency: 1}', PUBLISHED, ''),
    'a start where a joint is beyond': (
        'sine: {amplitude: 0.1, mean: 1, frequency: 1}',
        PUBLISHED,
        'starts at 1 rad, beyond limits: rocker_joint at 1.11226 rad, limits [1.5, 2] rad; start',
    ),
    'no limits': ('constant_rate: {rate: 1}', '', ''),
}  # fmt: skip


@pytest.mark.parametrize('name', DRIVES)
def test_drives_beyond_joint_limits_are_refused(name):
    drive, limits, expected = DRIVES[name]
    if not expected:
        built = pipeline(drive, four_bar(limits))
        for index in range(4000):
            (look,) = built.tick(BEGIN + index * MS).states
            assert look.position.status is Status.CLOSED
        return
    with pytest.raises(FileError) as error:
        pipeline(drive, four_bar(limits))
    assert expected in str(error.value)
    assert '\n' not in str(error.value)


@settings(max_examples=60, deadline=None)
@given(
    values=st.lists(st.floats(-1.0, 1.0), min_size=2, max_size=6),
    interpolation=st.sampled_from(['linear', 'cubic', 'minimum_jerk']),
    repeat=st.booleans(),
)
def test_profile_value_range_bounds_the_curve(values, interpolation, repeat):
    table = tuple((float(2 * i), value) for i, value in enumerate(values))
    parameters = ProfileDrive(table, interpolation, repeat)
    low, high = parameters.value_range()
    seen = [
        parameters.motion_curve()(time * 5 * MS)[0] for time in range(400 * (len(values) - 1) + 1)
    ]
    if not repeat or values[0] == values[-1]:
        assert low == pytest.approx(min(seen), abs=1e-4)
        assert high == pytest.approx(max(seen), abs=1e-4)
    assert low - 1e-12 <= min(seen)
    assert max(seen) <= high + 1e-12


def test_drive_limit_error_names_the_input():
    linkage = symmetric_five_bar(', limits: [1, 2]')
    drive = 'sine: {amplitude: 0.2, mean: 1.5, frequency: 1, inputs: {left_joint: SAID}}'
    fine = '{amplitude: 0.5, mean: 1.5, frequency: 1}'
    assert pipeline(drive.replace('SAID', fine), linkage)
    with pytest.raises(FileError, match=r"drive\.sine\.inputs\.left_joint: takes 'left_"):
        pipeline(drive.replace('SAID', fine.replace('0.5', '0.6')), linkage)


def pushed(limits, effort, rocker='', seconds=3.0, start=1.0, **more):
    """Return the linkage at work, and where a constant effort has brought the crank to."""
    said = ''.join(f', {key}: {value}' for key, value in more.items())
    built = pipeline(
        f'torque: {{start: {start}, timeout: 100{said}}}',
        four_bar_text(0.1, 0.07, 0.06, 0.05, MASSES, limits, rocker),
    )
    (line,) = built.linkages
    line.drive.state(BEGIN)
    assert line.drive.offer(EffortCommand(0, (effort,)), BEGIN) is None
    (value,) = line.drive.state(BEGIN + round(seconds * 1000) * MS).angles
    return line, value


@pytest.mark.parametrize(('effort', 'stop'), [(0.5, 1.5), (-0.5, 0.5)])
def test_torque_drive_stops_at_the_input_limit(effort, stop):
    """Toggles have a margin, since nothing can be pushed there; limits need none."""
    _, value = pushed(', limits: [0.5, 1.5]', effort, stop_margin=0.1)
    assert value == stop


def test_toggle_keeps_its_stop_margin_beside_a_limit():
    line, low = pushed(', limits: [0.5, 3]', -0.5, stop_margin=0.1)
    (one,) = line.closure.input_ranges
    _, high = pushed(', limits: [0.5, 3]', 0.5, stop_margin=0.1)
    assert low == 0.5
    assert high == pytest.approx(one.highest - 0.1 * (one.highest - one.lowest), abs=1e-9)


def test_published_joint_limit_stops_the_torque_drive():
    free, _ = pushed('', 0.0)
    low, high = sorted(free.closure.position(value).joints[-1] for value in (1.2, 1.4))
    line, value = pushed('', 0.5, f', limits: [{low!r}, {high!r}]', start=1.3)
    assert value == pytest.approx(1.4, abs=1e-9)
    assert line.closure.position(value).status is Status.CLOSED


def test_effort_beyond_its_limit_is_clipped_and_counted():
    least, most = pushed(', effort: 0.01', 0.01, seconds=0.05), pushed('', 0.01, seconds=0.05)
    cut = pushed(', effort: 0.01', 5.0, seconds=0.05)
    assert cut[1] == least[1] == most[1]
    assert [line.drive.saturated for line, _ in (least, most, cut)] == [0, 0, 1]
    down = pushed(', effort: 0.01', -5.0, seconds=0.05)
    assert down[1] == pushed('', -0.01, seconds=0.05)[1]
