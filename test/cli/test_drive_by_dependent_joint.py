# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""``drive: {topic: {joint: …}}``: a scene driven by samples of a dependent joint."""

from __future__ import annotations

from collections import Counter
from itertools import islice
import json
from math import cos, sin
from pathlib import Path
from typing import Any

from linkage_ros import FileError, load
from linkage_ros.cli import replay
from linkage_ros.description import load_scene
from linkage_ros.messages import Rejection
from linkage_ros.tick import Pipeline
from linkage_ros.tools.models.fmu.stepped_scene import _Sender
from linkage_ros.tools.study import turn_crank
from linkage_ros.tools.view import report_command as report
import pytest

from .recorded import answer, JointStateWriter, MS, Recorded, scene_file, SECOND
from ..support.messages import read_joint_state
from ..support.scenes import pipeline_of, scene_of

RATES = 'effects: {velocity: {}, acceleration: {}}\n'
BY_ROCKER = 'drive: {topic: {joint: rocker_joint, branch: 1}}\n'
LINKAGE = load('four_bar')
FILE = (Path(__file__).parents[2] / 'config/linkages/four_bar.yaml').read_text('utf-8')


def swinging(seconds: float) -> tuple[float, float]:
    """Return a crank that stays on the first branch of the rocker, and its rate."""
    return 2.0 + 1.2 * sin(3.0 * seconds), 3.6 * cos(3.0 * seconds)


def samples(seconds: float) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return crank and rate, and rocker and rate, of the same state."""
    crank, rate = swinging(seconds)
    position = LINKAGE.position(crank)
    velocity = LINKAGE.velocity(position, rate)
    return (crank, rate), (position['rocker_joint'], velocity['rocker_joint'])


def joint_message(joint: str, stamp: int, value: float, rate: float) -> bytes:
    return JointStateWriter([joint]).write(stamp, (value,), (rate,))


def test_rocker_drive_publishes_the_same_states_as_crank_drive() -> None:
    by_crank = pipeline_of(RATES, FILE)
    by_rocker = pipeline_of(RATES + BY_ROCKER, FILE)
    for index in range(1, 800):
        now = SECOND + index * MS
        if index % 3 == 1:
            crank, rocker = samples(index * 1e-3)
            assert by_crank.offer(joint_message('crank_joint', now, *crank), now) is None
            assert by_rocker.offer(joint_message('rocker_joint', now, *rocker), now) is None
        one, other = (each.tick(now) for each in (by_crank, by_rocker))
        first, second = (read_joint_state(tick.message) for tick in (one, other))
        assert first.name == second.name
        assert second.position == pytest.approx(first.position, abs=1e-12)
        assert second.velocity == pytest.approx(first.velocity, abs=1e-11, rel=1e-11)


def test_unreachable_sample_is_rejected_and_changes_no_state() -> None:
    pipeline = pipeline_of(RATES + BY_ROCKER, FILE)
    assert pipeline.offer(joint_message('rocker_joint', SECOND, 1.2, 0.1), SECOND) is None
    before = pipeline.tick(SECOND).message
    told = Counter(
        pipeline.offer(joint_message(joint, SECOND, value, 0.1), SECOND)
        for joint, value in (
            ('rocker_joint', 3.0),
            ('rocker_joint', float('nan')),
            ('rocker_joint', 1e11),
            ('rocker_joint', -1e300),
            ('crank_joint', 1.0),
        )
    )
    assert told == {
        Rejection.NO_CRANK: 1,
        Rejection.NOT_FINITE: 1,
        Rejection.TOO_LARGE: 2,
        Rejection.MISSING: 1,
    }
    assert pipeline.tick(SECOND).message == before


def test_crank_rate_at_a_turning_rocker_comes_from_differences() -> None:
    """Where the rocker turns back, its samples say nothing about the crank's rate."""
    pipeline = pipeline_of(RATES + BY_ROCKER, FILE)
    end = LINKAGE.branches('rocker_joint')[0].high
    for stamp, value in ((SECOND, end - 1e-3), (SECOND + MS, end)):
        assert pipeline.offer(joint_message('rocker_joint', stamp, value, 0.0), stamp) is None
    found = pipeline.tick(SECOND + MS)
    assert found.message
    (rate,) = found.states[0].crank.rates
    cranks = [
        LINKAGE.driven_by('rocker_joint', branch=1).position(y)['crank_joint']
        for y in (end - 1e-3, end)
    ]
    assert rate == pytest.approx((cranks[1] - cranks[0]) / 1e-3)


@pytest.mark.sample(2)
@pytest.mark.parametrize('joint', ['P.x', 'O2-B', 'coupler.angle'])
def test_samples_drive_by_coordinate_distance_or_angle(joint: str) -> None:
    (branch, *_) = LINKAGE.branches(joint)
    drive = f'drive: {{topic: {{joint: {joint}, branch: {branch.number}}}}}\n'
    pipeline = pipeline_of(RATES + drive, FILE)
    value, crank = branch.state_at(0.4)
    assert pipeline.offer(joint_message(joint, SECOND, value, 0.0), SECOND) is None
    (found,) = pipeline.tick(SECOND).states[0].crank.angles
    assert found == pytest.approx(crank, abs=1e-12)
    moved = LINKAGE.driven_by(joint, branch=branch.number).position(value)
    assert moved['crank_joint'] == pytest.approx(crank, abs=1e-12)


@pytest.mark.sample(3)
@pytest.mark.parametrize(
    ('name', 'joints', 'start'),
    [
        ('five_bar', ('O1-P', 'O2-P'), (1.1, 1.2)),
        ('five_bar', ('left_forearm.angle', 'P.x'), (1.07, 1.09)),
        ('ankle', ('m1', 'c2.z'), (0.1, -0.05)),
        ('ankle_motors', ('pitch', 'roll'), (0.2, -0.1)),
        ('delta', ('a1', 'c2.y', 'z'), (0.1, 0.2, 0.3)),
        ('rssr', ('rocker_joint',), (-0.2,)),
        ('wishbone', ('wheel.z', 'rack'), (0.02, 0.01)),
    ],
)
def test_samples_of_several_joints_drive_as_many_inputs(
    name: str, joints: tuple[str, ...], start: tuple[float, ...]
) -> None:
    """The inputs, and their rates, are those of the linkage that has these joints."""
    closure = load(name).measuring(*joints)
    position = closure.position(*start)
    rates = closure.velocity(position, *([0.3] * len(start)))
    drive = f'drive={{topic: {{joint: [{", ".join(joints)}]}}}}'
    pipeline = Pipeline(load_scene(name, settings=[drive, 'effects.velocity={}', 'rate=0']))
    write = JointStateWriter(joints).write
    values, speeds = ([found[joint] for joint in joints] for found in (position, rates))
    assert pipeline.offer(write(SECOND, values, speeds), SECOND) is None
    crank = pipeline.tick(SECOND).states[0].crank
    assert crank.angles == pytest.approx(start, abs=1e-11)
    assert crank.rates == pytest.approx([0.3] * len(start), abs=1e-9)
    if lengths := [index for index, joint in enumerate(joints) if '.' in joint or '-' in joint]:
        far = [value + 50.0 * (index == lengths[-1]) for index, value in enumerate(values)]
        assert pipeline.offer(write(SECOND, far, speeds), SECOND) is Rejection.NO_CRANK
    alone = JointStateWriter(joints[:1]).write(SECOND, values[:1], speeds[:1])
    assert pipeline.offer(alone, SECOND) is (Rejection.MISSING if len(joints) > 1 else None)


@pytest.mark.parametrize(
    ('drive', 'line'),
    [
        ('{joint: rockr_joint}', "did you mean 'rocker_joint'?"),
        ('{joint: [rocker_joint, P.x]}', 'drive.topic.joint: rocker_joint, P.x: 2 for 1 input'),
        ('{joint: rocker_joint}', 'drive.topic.joint: rocker_joint: several cranks reach a value'),
        (
            '{joint: rocker_joint, branch: 4}',
            'drive.topic.branch: branch 4: rocker_joint has no branch of this number',
        ),
        ('{branch: 1}', 'drive.topic.branch: has no joint; name it: joint: NAME'),
        ('{joint: rocker_joint, branch: -1}', 'drive.topic.branch'),
    ],
)
def test_wrong_drive_joint_is_refused_in_one_line(drive: str, line: str) -> None:
    with pytest.raises(FileError) as error:
        pipeline_of(f'drive: {{topic: {drive}}}\n', FILE)
    assert line in str(error.value)
    assert '\n' not in str(error.value)


def test_two_linkages_of_a_scene_read_their_own_samples(tmp_path: Path) -> None:
    text = (
        'linkages:\n- {name: left, linkage: l.yaml, ' + BY_ROCKER.strip() + '}\n'
        '- {name: right, linkage: l.yaml}\n'
    )
    pipeline = Pipeline(load_scene(scene_file(tmp_path, text, FILE)))
    write = JointStateWriter(['right_crank_joint', 'left_rocker_joint']).write
    crank, rocker = samples(0.2)
    message = write(SECOND, (crank[0], rocker[0]), (crank[1], rocker[1]))
    assert pipeline.offer(message, SECOND) is None
    found = read_joint_state(pipeline.tick(SECOND).message)
    values = dict(zip(found.name, found.position, strict=True))
    assert values['left_rocker_joint'] == pytest.approx(values['right_rocker_joint'], abs=1e-14)


def test_accuracy_and_fmu_feed_samples_of_the_dependent_joint() -> None:
    pipeline = pipeline_of(RATES + BY_ROCKER, FILE)
    (linkage,) = pipeline.linkages
    names = [variable.name for variable in _Sender(linkage).variables]
    assert names == ['crank_states.rocker_joint.position', 'crank_states.rocker_joint.velocity']
    for now, message in islice(turn_crank(scene_of(RATES + BY_ROCKER, FILE), pipeline), 50):
        assert pipeline.offer(message, now) is None
        assert pipeline.tick(now).message


def recorded(folder: Path) -> Path:
    def rocker(number: int) -> dict[str, Any]:
        if number == 100:
            return {'rocker_joint': (3.0, 0.0)}  # no crank
        return {} if number % 3 else {'rocker_joint': samples(number * 1e-3)[1]}

    return Recorded(folder / 'bag', scene_file(folder, RATES + BY_ROCKER, FILE), rocker).run(300)


def test_run_driven_by_the_rocker_replays_to_same_bytes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bag = recorded(tmp_path)
    assert answer(replay, bag, '--json') == 0
    assert json.loads(capsys.readouterr().out)['verdict'] == 'identical'
    # Counterfactual: with one more effect, from the same samples.
    assert answer(replay, bag, '--set', 'effects.bias.joints.rocker_joint=0.01', '--json') in (
        0,
        1,
    )


def test_report_counts_samples_without_a_crank_angle(tmp_path: Path) -> None:
    page = tmp_path / 'run.html'
    assert answer(report, recorded(tmp_path), '-o', page) == 0
    assert Rejection.NO_CRANK.value in page.read_text('utf-8')
