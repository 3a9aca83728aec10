# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A scene at work: crank messages in, joint states out, and the same again to the last bit."""

from cmath import exp
from math import pi, remainder, tau
import os
from pathlib import Path
import subprocess
import sys

from linkage_ros.errors import FileError
from linkage_ros.kinematics import Status
from linkage_ros.messages import JointStateWriter, Rejection
import pytest

from ..support.messages import read_joint_state as read, STORE
from ..support.scenes import FIVE_BAR, pipeline_of

MS = 1_000_000
BEGIN = 1_700_000_000_000_000_000
CRANK = JointStateWriter(['crank_joint'])
FOUR_BAR = b'four_bar: {a: 0.04, b: 0.12, c: 0.08, d: 0.1}'
DRAG_LINK = b'four_bar: {a: 0.08, b: 0.07, c: 0.09, d: 0.04}'
SLIDER_CRANK = b'inverted_slider_crank: {a: 0.15, swivel: [0.25, 0.1]}'
ROOT = Path(__file__).parents[2]


def pipeline(scene=b'effects: {velocity: {}}', linkage=FOUR_BAR):
    return pipeline_of(scene, linkage)


def turn(pipeline, angle_at, seconds=3.0, wrap=False):
    """Return the messages of ticks at 500 Hz, with a crank message for every third of them."""
    messages = []
    for index in range(int(500 * seconds)):
        now = BEGIN + index * 2 * MS
        if index % 3 == 0:
            angle = angle_at((now - BEGIN) * 1e-9)
            rate = (angle_at((now - BEGIN) * 1e-9 + 1e-6) - angle) / 1e-6
            angle = remainder(angle, tau) if wrap else angle
            assert pipeline.offer(CRANK.write(now, [angle], [rate]), now) is None
        messages.append(pipeline.tick(now).message)
    return messages


def swinging(t):
    return 9.0 * t - 0.5 * t * t


def test_equal_crank_messages_give_equal_bytes():
    first, second = (turn(pipeline(), swinging) for _ in range(2))
    assert len(set(first)) == len(first)
    assert first == second


@pytest.mark.sample(4)
@pytest.mark.parametrize('wrap_input', [False, True])
@pytest.mark.parametrize('direction', [1, -1])
@pytest.mark.parametrize(
    'linkage',
    [FOUR_BAR, DRAG_LINK, SLIDER_CRANK],
    ids=['crank-rocker', 'drag link', 'slider-crank'],
)
def test_joint_angles_are_continuous_or_wrapped_over_turns(wrap_input, direction, linkage):
    def angle_at(t):
        return direction * 11.0 * t

    continuous = turn(pipeline(linkage=linkage), angle_at, wrap=wrap_input)
    wrapped = turn(pipeline(b'angles: wrapped', linkage), angle_at, wrap=wrap_input)
    slides = not pipeline(linkage=linkage).closures[0].turning[1]
    previous = None
    for long, short in zip(map(read, continuous), map(read, wrapped), strict=True):
        if previous is not None:
            assert all(abs(long.position - previous.position) < 0.5)
        previous = long
        assert all(-pi < angle <= pi for angle in short.position)
        turns = (long.position - short.position) / tau
        assert turns == pytest.approx([round(turn) for turn in turns], abs=1e-9)
        assert not slides or turns[1] == 0.0
    first, last = (
        read(continuous[0]).position,
        read(continuous[-1]).position,
    )
    # In 33 rad the coupler falls behind the crank by five turns, but in a drag link it goes along.
    assert abs(last[0] - first[0]) > 5 * tau or abs(last[1] - first[1]) > 5 * tau


def test_velocity_array_without_the_effect_is_empty():
    bare, full = pipeline(b''), pipeline()
    for message, with_rates in zip(turn(bare, swinging), turn(full, swinging), strict=True):
        assert len(read(message).velocity) == len(read(message).effort) == 0
        assert len(read(with_rates).velocity) == 2
        assert list(read(message).position) == list(read(with_rates).position)


@pytest.mark.parametrize(
    ('effects', 'imported'),
    [
        ('{}', set()),
        ('{velocity: {}}', {'stages.effects.derivatives'}),
        (
            '{acceleration: {}}',
            {'stages.effects.derivatives', 'messages.joint_values'},
        ),
    ],
)
def test_unused_effects_are_not_imported(tmp_path, effects, imported):
    (tmp_path / 'linkage.yaml').write_bytes(FOUR_BAR)
    (tmp_path / 'scene.yaml').write_text(f'linkage: linkage.yaml\neffects: {effects}')
    program = (
        'import sys; from linkage_ros.tick.pipeline import Pipeline; '
        'from linkage_ros.description.scene_file import load_scene; '
        f'Pipeline(load_scene({str(tmp_path / "scene.yaml")!r})); '
        'print(*sys.modules)'
    )
    done = subprocess.run(
        [sys.executable, '-c', program],
        cwd=ROOT,
        env=os.environ | {'PYTHONPATH': str(ROOT)},
        capture_output=True,
        text=True,
        check=True,
    )
    modules = set(done.stdout.split())
    optional = {'stages.effects.derivatives', 'messages.joint_values'}
    assert {name for name in optional if f'linkage_ros.{name}' in modules} == imported
    assert not modules & {'rclpy', 'trajectory_msgs'}


def test_pipeline_publishes_nothing_before_or_after_the_samples():
    silent = pipeline()
    assert_silent(silent.tick(BEGIN))
    silent.offer(CRANK.write(BEGIN, [0.5], [1.0]), BEGIN)
    assert silent.tick(BEGIN + 200 * MS).message
    assert_silent(silent.tick(BEGIN + 201 * MS))


def assert_silent(tick):
    (state,) = tick.states
    assert [state.crank, state.position, state.motion, state.reading] == [None] * 4
    assert (tick.message, tick.extras) == (b'', ())


@pytest.mark.parametrize(
    ('linkage', 'angle', 'status', 'gap'),
    [
        (b'four_bar: {a: 1, b: 1, c: 1, d: 2}', pi, Status.OPEN, 1.0),
        (b'inverted_slider_crank: {a: 0.25, swivel: [0.25, 0]}', 0.0, Status.INDETERMINATE, 0.0),
    ],
)
def test_open_or_indeterminate_linkage_publishes_nothing(linkage, angle, status, gap):
    stuck = pipeline(linkage=linkage)
    stuck.offer(CRANK.write(BEGIN, [angle], [1.0]), BEGIN)
    tick = stuck.tick(BEGIN)
    (state,) = tick.states
    position, motion, reading = state.position, state.motion, state.reading
    assert position.status is status
    assert position.gap == pytest.approx(gap)
    assert motion is reading is None
    assert (tick.message, tick.extras) == (b'', ())


def test_joint_state_at_a_toggle_has_no_rates():
    toggle = pipeline(linkage=b'four_bar: {a: 1, b: 1, c: 1, d: 3}')
    toggle.offer(CRANK.write(BEGIN, [0.0], [1.0]), BEGIN)
    tick = toggle.tick(BEGIN)
    assert tick.states[0].position.status is Status.TOGGLE
    assert len(read(tick.message).position) == 2
    assert len(read(tick.message).velocity) == 0


def read_motion(message):
    return STORE.deserialize_cdr(message, 'trajectory_msgs/msg/JointTrajectory')


def test_scene_without_acceleration_publishes_no_trajectory():
    for scene in (b'', b'effects: {velocity: {}}'):
        plain = pipeline(scene)
        plain.offer(CRANK.write(BEGIN, [0.5], [1.0]), BEGIN)
        assert plain.extras == []
        assert plain.tick(BEGIN).extras == ()


@pytest.mark.parametrize(
    'effects',
    [b'{acceleration: {}}', b'{acceleration: {}, velocity: {}}'],
    ids=['alone', 'beside velocity'],
)
def test_trajectory_holds_the_joint_state_and_accelerations(effects):
    # To name acceleration is to name velocity; turns are added to both messages.
    both, velocity = pipeline(b'effects: ' + effects), pipeline(b'effects: {velocity: {}}')
    assert [extra.topic for extra in both.extras] == ['~/motion']
    for index in range(300):
        now, angle = BEGIN + index * 2 * MS, 0.1 * index
        message = CRANK.write(now, [remainder(angle, tau)], [50.0])
        assert both.offer(message, now) is velocity.offer(message, now) is None
        tick = both.tick(now)
        (trajectory,) = tick.extras
        assert tick.message == velocity.tick(now).message
        written = read_motion(trajectory)
        assert written.header == read(tick.message).header
        assert written.joint_names == read(tick.message).name
        (point,) = written.points
        assert list(point.positions) == list(read(tick.message).position)
        assert list(point.velocities) == list(read(tick.message).velocity)
        assert tuple(point.accelerations) == tick.states[0].motion.acceleration.joints
        assert len(point.accelerations) == 2


def test_trajectory_at_a_toggle_has_positions_only():
    scene, linkage = b'effects: {acceleration: {}}', b'four_bar: {a: 1, b: 1, c: 1, d: 3}'
    toggle = pipeline(scene, linkage)
    toggle.offer(CRANK.write(BEGIN, [0.0], [1.0]), BEGIN)
    tick = toggle.tick(BEGIN)
    assert tick.states[0].position.status is Status.TOGGLE
    (point,) = read_motion(tick.extras[0]).points
    assert len(point.positions) == 2
    assert len(point.velocities) == len(point.accelerations) == 0


TWO_CRANKS = FIVE_BAR.encode()


def test_one_message_drives_two_inputs_in_any_order():
    def closes(positions, left, right):
        upper, lower = positions
        return 0.04 * exp(1j * left) + 0.12 * exp(1j * upper) == pytest.approx(
            0.1 + 0.05 * exp(1j * right) + 0.11 * exp(1j * lower), abs=1e-12
        )

    for names, values in (
        (['left_crank', 'right_crank'], [0.3, 2.0]),
        (['x', 'right_crank', 'left_crank'], [9.0, 2.0, 0.3]),
    ):
        writer = JointStateWriter(names)
        five_bar = pipeline(b'effects: {acceleration: {}}', TWO_CRANKS)
        assert five_bar.offer(CRANK.write(BEGIN, [0.3], [1.0]), BEGIN) is Rejection.MISSING
        assert five_bar.tick(BEGIN).states[0].position is None
        rates = [10.0 * value for value in values]
        assert five_bar.offer(writer.write(BEGIN, values, rates), BEGIN) is None
        tick = five_bar.tick(BEGIN + 10 * MS)
        motion = tick.states[0].motion
        assert motion.crank.rates == (3.0, 20.0)
        assert motion.crank.angles == pytest.approx((0.33, 2.2))
        assert closes(read(tick.message).position, 0.33, 2.2)
        # The motion is straight in both angles: differences along it are rates.
        (before, _), (now, rates), (after, _) = (
            (read(each).position, read(each).velocity)
            for each in (
                five_bar.tick(BEGIN + ten_us * MS // 100).message for ten_us in (999, 1000, 1001)
            )
        )
        assert list(rates) == pytest.approx(list((after - before) / 2e-5), rel=1e-5)
        slopes = (after - 2.0 * now + before) / 1e-10
        assert list(motion.acceleration.joints) == pytest.approx(list(slopes), rel=1e-5)


def test_rejected_message_does_not_change_later_ticks():
    bad = [
        (b'', Rejection.MALFORMED),
        (CRANK.write(BEGIN, [float('nan')], [0.0]), Rejection.NOT_FINITE),
        (CRANK.write(0, [1.0], [0.0]), Rejection.STAMP_ZERO),
        (CRANK.write(BEGIN - 1, [1.0], [0.0]), Rejection.STAMP_OLD),
        (CRANK.write(BEGIN, [1.0], [float('inf')]), Rejection.NOT_FINITE),
        (JointStateWriter(['x']).write(BEGIN, [1.0], [0.0]), Rejection.MISSING),
    ]
    clean, disturbed = pipeline(), pipeline()
    for each in (clean, disturbed):
        each.offer(CRANK.write(BEGIN, [0.5], [1.0]), BEGIN)
    for message, reason in bad:
        assert disturbed.offer(message, BEGIN) is reason
        (one,), (other,) = (work.tick(BEGIN).states for work in (disturbed, clean))
        assert (one.crank, one.motion, one.reading) == (other.crank, other.motion, other.reading)
        assert disturbed.tick(BEGIN).message == clean.tick(BEGIN).message


GALLERY = sorted((ROOT / 'config' / 'linkages').glob('*.yaml'))


@pytest.mark.sample(7)
@pytest.mark.parametrize('file', GALLERY, ids=lambda file: file.stem)
def test_gallery_joint_rates_equal_differences_of_angles(file):
    scene = pipeline(b'effects: {velocity: {}, acceleration: {}}', file.read_bytes())
    (closure,) = scene.closures
    inputs = closure.linkage.inputs
    if len(inputs) == 1:
        interval = max(closure.input_ranges, key=lambda r: r.highest - r.lowest)
        span = interval.highest - interval.lowest
        begin, rate = interval.lowest + 0.4 * span, 0.1 * span
    else:
        begin, rate = 1.5, 0.1
    writer = JointStateWriter([driven.joint for driven in inputs])
    assert scene.offer(
        writer.write(BEGIN, [begin] * len(inputs), [rate] * len(inputs)), BEGIN
    ) is None  # fmt: skip
    # The newest sample is carried forward for 0.1 s, at a constant rate.
    step = 1e-3
    motions = [scene.tick(BEGIN + i * MS) for i in range(100)]
    states = [read(tick.message) for tick in motions]
    assert all(len(state.position) == len(closure.linkage.joints) for state in states)
    for before, state, after in zip(states, states[1:], states[2:], strict=False):
        slope = (after.position - before.position) / (2 * step)
        assert state.velocity == pytest.approx(slope, rel=1e-4, abs=1e-4)
    trajectories = [
        STORE.deserialize_cdr(tick.extras[0], 'trajectory_msgs/msg/JointTrajectory').points[0]
        for tick in motions
    ]
    for before, point, after in zip(
        trajectories, trajectories[1:], trajectories[2:], strict=False
    ):
        slope = (after.velocities - before.velocities) / (2 * step)
        assert point.accelerations == pytest.approx(slope, rel=1e-4, abs=1e-4)


def test_delay_delays_the_silence_of_slow_sensors():
    # Samples at 0, 10 and 20 ms; each arrives with the first tick that is 2.5 ms later.
    slow = pipeline(
        b'drive: {constant_rate: {rate: 1.0}}\n'
        b'effects: {rate_limit: {rate: 100, hold: silent}, '
        b'delay: {seconds: 0.0025, between: sampled}}'
    )
    heard = [time for time in range(30) if slow.tick(BEGIN + time * MS).message]
    assert heard == [3, 13, 23]


def test_missing_mass_is_reported_with_the_linkage_file():
    with pytest.raises(FileError) as caught:
        pipeline(b'drive: {constant_rate: {rate: 1.0}}\neffects: {effort: {}}')
    assert str(caught.value).startswith("here: linkage.yaml: masses: link 'crank' has no mass")
