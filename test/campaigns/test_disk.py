# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A sample of the disk campaign: calls that fail, disks that fill, and one that stalls."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from campaigns.campaign import results_of
from campaigns.reliability import filling, stalling
from campaigns.reliability.disk import attempt, MESSAGES, Part, record_short, SETTINGS, Tried
from campaigns.reliability.filling import Disk, NotPermittedError
from campaigns.reliability.judge import COMPLETE, EARLY, Expectation, judge, REFUSED
from campaigns.reliability.recording import expected_messages, Phase, Recorded
from campaigns.reliability.system_calls import FAULTS, injections, why_not
from linkage_ros.bag import METADATA_FILE
import pytest

EVERY = 29
"""The sample takes one injection in so many; coprime to the number of faults of a call."""


@pytest.fixture(scope='module')
def tried() -> list[Tried]:
    if why_not():
        pytest.skip(why_not())
    work = []
    for first, setting in enumerate(SETTINGS):
        (dry,) = next(results_of(attempt, [Part(setting, (None,))] * 2, 2))
        assert (dry.outcome.faults, dry.outcome.verdict) == ([], COMPLETE)
        chosen = tuple([*injections(dry.calls)][first::EVERY])
        work += [Part(setting, chosen[:25]), Part(setting, chosen[25:])]
    return [one for some in results_of(attempt, work, 2) for one in some]


@pytest.mark.sample(0)
def test_a_failing_call_loses_no_counted_message(tried: list[Tried]) -> None:
    assert [(one.injection, one.outcome.faults) for one in tried if one.outcome.faults] == []


@pytest.mark.sample(0)
def test_disk_sample_covers_targets_phases_and_faults(tried: list[Tried]) -> None:
    assert len(tried) > 100
    verdicts = [one.outcome.verdict for one in tried]
    assert min(verdicts.count(verdict) for verdict in (EARLY, COMPLETE, REFUSED)) > 5
    failed = [one.failed_call for one in tried if one.failed_call]
    assert len(failed) == len(tried)
    assert {call.target for call in failed} >= {'file', 'metadata', 'folder', 'reserve'}
    assert {call.phase for call in failed} == {*Phase} - {Phase.STARTING, Phase.CLOSED}
    assert {one.injection.fault for one in tried if one.injection} >= {
        fault for fault in FAULTS if fault != 'EOPNOTSUPP'
    }


@pytest.mark.sample(1)
@pytest.mark.parametrize('disk', [Disk('tmpfs', 'tmpfs', 4), Disk('ext4', 'ext4', 6, 20)])
@pytest.mark.parametrize(
    ('storage', 'filler'),
    [
        ('one file, a floor', 'the recording alone'),
        ('split', 'another process, which takes all free space'),
        ('ring of 3', 'the recording alone'),
    ],
)
def test_full_disk_loses_no_counted_message(disk: Disk, storage: str, filler: str) -> None:
    try:
        filled = filling.fill(disk, storage, filler, 40_000)
    except NotPermittedError as error:
        pytest.skip(str(error))
    assert filled.outcome.faults == []
    assert filled.outcome.recorded > 1000
    assert bool(filled.failure) == (not storage.startswith('ring'))


@pytest.fixture(params=['the kernel', 'the process'])
def stalled(request: pytest.FixtureRequest) -> stalling.Stalled:
    pytest.importorskip('rclpy')
    plan = stalling.Plan('1 s', 3.0, 1.0, queue=20_000, rate=200)
    try:
        return stalling.run(plan, frozen=request.param == 'the kernel')
    except NotPermittedError as error:
        pytest.skip(str(error))


@pytest.mark.ros
def test_stalled_disk_delays_no_tick_and_loses_no_message(stalled: stalling.Stalled) -> None:
    assert stalled.faults == []
    assert stalled.total('received') == stalled.total('recorded') > 200
    # No tick waited for the disk.
    assert stalled.during > 100


class Unwatched:
    def enter(self, phase: Phase, written: int) -> None:
        pass


def at_rest(folder: Path) -> Recorded:
    return record_short(folder, SETTINGS['one file'], Unwatched())


def test_the_judge_detects_a_wrong_count(tmp_path: Path) -> None:
    done = at_rest(tmp_path / 'bag')
    received, recorded, *rest = done.counts[0]
    done.counts[0] = (received + 1, recorded + 1, *rest)  # type: ignore[assignment]
    outcome = judge(done, tmp_path / 'bag', Expectation(expected_messages(MESSAGES)))
    assert any('received' in fault for fault in outcome.faults)
    assert any('reports no failure, but holds' in fault for fault in outcome.faults)


FALSE = {
    'an exception': ({'escaped': 'KeyError: 1'}, 'escaped'),
    'two lines': ({'failure': 'bag: it\nended; why'}, 'bad error message'),
    'no remedy': ({'failure': 'it ended'}, 'bad error message'),
    'a false failure': ({'failure': '{folder}: it ended; mend it'}, 'metadata report no failure'),
}


@pytest.mark.parametrize('name', FALSE)
def test_the_judge_detects_bad_errors(tmp_path: Path, name: str) -> None:
    done = at_rest(tmp_path / 'bag')
    changes, fault = FALSE[name]
    done = replace(done, **{k: v.format(folder=tmp_path / 'bag') for k, v in changes.items()})
    outcome = judge(done, tmp_path / 'bag', Expectation(expected_messages(MESSAGES)))
    assert any(fault in found for found in outcome.faults)


def test_the_judge_detects_broken_bags(tmp_path: Path) -> None:
    done = at_rest(tmp_path / 'bag')
    expectation = Expectation(expected_messages(MESSAGES))
    assert judge(done, tmp_path / 'bag', expectation).faults == []
    (tmp_path / 'bag' / 'metadata.yaml.tmp').touch()
    (tmp_path / 'bag' / METADATA_FILE).write_text('rosbag2_bagfile_information: {version')
    faults = judge(done, tmp_path / 'bag', expectation).faults
    assert 'left behind: metadata.yaml.tmp' in faults
    assert any(fault.startswith('metadata: ') for fault in faults)
    assert judge(None, tmp_path / 'bag', expectation).faults == ['did not end']


@pytest.mark.parametrize(
    'found',
    [
        expected_messages(10)[::-1],
        expected_messages(10)[::2],
        [*expected_messages(5), expected_messages(5)[-1]],
        [expected_messages(1)[0]._replace(data=b'')],
    ],
    ids=['another order', 'gaps', 'one twice', 'other bytes'],
)
def test_run_of_messages_is_consecutive_and_unchanged(found: list) -> None:
    assert Expectation(expected_messages(20)).run_of(found) is None
    assert Expectation(expected_messages(20)).run_of(expected_messages(20)[3:9]) == range(3, 9)
