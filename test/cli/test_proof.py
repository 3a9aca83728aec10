# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The proof at the end of a run: all of the bag, or as much of it as a time allows."""

from math import inf
import re
import time

from linkage_ros.bag import BagMessage
from linkage_ros.cli import Beginning, proof_of
import pytest

from .recorded import FOUR_BAR, Recorded, scene_file

TICKS = 3000
SCENE = (
    'rate: 1000\ndrive: {constant_rate: {rate: 6.0}}\neffects: {velocity: {}, acceleration: {}}\n'
)


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    folder = tmp_path_factory.mktemp('run')
    return Recorded(folder / 'bag', scene_file(folder, SCENE, FOUR_BAR)).run(TICKS)


def test_proof_without_a_limit_replays_the_whole_run(bag):
    text = proof_of(bag, TICKS, inf)
    assert f'{TICKS} of {TICKS} joint states and {TICKS} of {TICKS} motion' in text
    assert text.endswith('of the run all')


def test_proof_with_a_limit_replays_a_sample_of_ticks(bag, monkeypatch):
    clock = iter(range(10**9))
    monkeypatch.setattr('linkage_ros.cli.proof.monotonic', lambda: next(clock))
    text = proof_of(bag, TICKS, 100.0)
    same, of, motions, of_motions = map(
        int, re.search(r'(\d+) of (\d+) joint states and (\d+) of (\d+) motion', text).groups()
    )
    assert same == of == motions == of_motions == 100
    assert 'of the run a sample, its first 0.1 s: --prove proves all' in text


def test_proof_of_an_endless_bag_ends_at_the_limit():
    def endless():
        number = 0
        while True:
            number += 1
            yield BagMessage('/t', number, number, b'')

    sample = Beginning(endless(), 0.2)
    begin = time.monotonic()
    assert sum(1 for _ in sample) > 100
    assert time.monotonic() - begin < 10.0
    assert sample.cut
