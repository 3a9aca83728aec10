# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Crank-rockers from the swing of the rocker and the ratio of its times."""

from math import degrees, pi, radians, tau
import random

from linkage_ros import Closure, SynthesisError
from linkage_ros.tools.design import assess, crank_rockers, DeadCentreTask
import pytest

from ...support.commands import linkage


def test_best_crank_rocker_equals_the_textbook_design():
    """Ground 120 mm, swing 80°, ratio 10/9: crank 46.7, coupler 116, rocker 73.9 mm."""
    best = crank_rockers(DeadCentreTask(radians(80.0), 10 / 9, 0.120), 1)[0]
    found = [1e3 * length for length in best.four_bar.lengths]
    assert found == pytest.approx([46.7, 116.0, 73.9, 120.0], rel=2e-3)


@pytest.mark.sample(3)
@pytest.mark.parametrize('seed', range(25))
def test_crank_rockers_have_the_requested_swing_and_time_ratio(seed):
    rng = random.Random(seed)
    swing, ratio = rng.uniform(0.1, 1.6), rng.choice([1.0, rng.uniform(1.0, 1.5)])
    designs = crank_rockers(DeadCentreTask(swing, ratio, 0.3), 5)
    assert len(designs) == 5
    transmissions = []
    for design in designs:
        found = assess(design)
        assert found.kind.code == 'GCRR'
        assert not found.defects
        transmissions.append(found.full_transmission)
        first, second = Closure(design.four_bar.linkage()).branches('rocker_joint')
        assert first.high - first.low == pytest.approx(swing, rel=1e-9)
        widths = sorted(branch.most - branch.least for branch in (first, second))
        assert sum(widths) == pytest.approx(tau)
        assert widths[1] / widths[0] == pytest.approx(ratio, rel=1e-6)
    assert transmissions == sorted(transmissions, reverse=True)


@pytest.mark.parametrize(
    'task',
    [
        DeadCentreTask(pi, 1.1, 1.0),
        DeadCentreTask(-0.1, 1.1, 1.0),
        DeadCentreTask(1.0, 0.9, 1.0),
        DeadCentreTask(1.0, float('nan'), 1.0),
        DeadCentreTask(1.0, 1e9, 1.0),
    ],
)
def test_impossible_dead_centre_task_is_refused(task):
    with pytest.raises(SynthesisError):
        crank_rockers(task, 1)


@pytest.mark.parametrize(
    ('arguments', 'line'),
    [
        ('--swing 80', '--time-ratio is missing'),
        ('--time-ratio 1.1', '--swing is missing'),
        ('--swing 80 --time-ratio 1/0', 'is not a ratio; write 10/9 or 1.2'),
        ('--swing 190 --time-ratio 10/9', 'give one between 0 and 180°'),
        ('--swing 80 --time-ratio 10/9 --pose 0 0 0', 'stand for two tasks'),
    ],
)
def test_synthesize_refuses_wrong_tasks_in_one_line(tmp_path, arguments, line):
    answer = linkage(tmp_path, 'synthesize', *arguments.split())
    assert answer.returncode == 2
    assert line in answer.stderr
    assert len(answer.stderr.splitlines()) == 1


def test_synthesize_writes_the_best_crank_rocker(tmp_path):
    asked = '--swing 80 --time-ratio 10/9 --ground 0.12 -o quick.yaml'
    answer = linkage(tmp_path, 'synthesize', *asked.split())
    assert answer.returncode == 0, answer.stderr
    assert '37.73° over the full turn' in answer.stdout
    assert (
        f'{degrees(DeadCentreTask(1.0, 10 / 9, 1.0).imbalance_angle):.6g}° more' in answer.stdout
    )
    assert linkage(tmp_path, 'check', 'quick.yaml').returncode == 0
