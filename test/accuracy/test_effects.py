# Copyright 2026 The linkage_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.


"""The error of published states, for effects whose error has a formula."""

from itertools import islice
from math import isclose, pi, radians, sin, sqrt, tau

from linkage_ros.accuracy.effects import departure, measure_effects, WHOLE
from linkage_ros.cost import feed, Names, Variants
from linkage_ros.measuring import Spread
from linkage_ros.resources import shipped
from linkage_ros.scene.load import load_scene
import pytest

TICKS = 2000  # two turns of the crank at 1 kHz, as the feed goes
FOUR_BAR = 'four_bar'
YOKE = 'scotch_yoke'


@pytest.fixture
def scene_with(tmp_path):
    def load(linkage, effects, more=''):
        path = shipped(f'linkages/{linkage}.yaml')
        (tmp_path / 'scene.yaml').write_text(
            f'linkage: {path}\nrate: 1000\n{more}\neffects: {{{effects}}}\n'
        )
        return load_scene(tmp_path / 'scene.yaml')

    return load


def judged(scene, ticks=TICKS):
    variants = Variants(scene)
    true = variants.pipeline(Names({'velocity'}))
    named = Names(scene.members[0].effects)
    return departure(true, variants.pipeline(named), islice(feed(scene, true), ticks))


def test_no_effect_no_error(scene_with):
    found = judged(scene_with(FOUR_BAR, 'velocity: {}'))
    assert found == ((0.0, 0.0), None, (0.0, 0.0), 0.0)


def test_a_bias_is_off_by_itself(scene_with):
    # One of the two joints that are published.
    found = judged(scene_with(FOUR_BAR, 'bias: {joints: {rocker_joint: 0.01}}'))
    rms, worst = found.angles
    assert rms == pytest.approx(0.01 / sqrt(2.0), rel=1e-9)
    assert worst == pytest.approx(0.01, rel=1e-9)
    assert found.rates is None, 'none are published'


def test_an_encoder_is_off_by_up_to_half_a_count(scene_with):
    found = judged(scene_with(FOUR_BAR, 'encoder: {joints: {rocker_joint: {counts: 1024}}}'))
    count = tau / 1024
    rms, worst = found.angles
    assert 0.45 * count < worst <= count * (1 + 1e-9)
    # Evenly spread within a count or half of one, of one joint of two.
    assert count / sqrt(12.0) / sqrt(2.0) * 0.9 < rms < count / sqrt(3.0) / sqrt(2.0) * 1.1


def test_a_delay_is_off_by_what_has_moved_since(scene_with):
    seconds, radius = 0.003, 0.05
    found = judged(scene_with(YOKE, f'delay: {{seconds: {seconds}}}'))
    # x = r·cos θ, and the other slide r·sin θ; one turn a second: at worst 2r·sin(ωτ/2).
    assert found.slides[1] == pytest.approx(2 * radius * sin(pi * seconds), rel=1e-4)
    assert isclose(found.silent, 3 / TICKS), 'until the first has arrived'


def test_a_dropout_is_silence(scene_with):
    found = judged(scene_with(FOUR_BAR, 'dropout: {probability: 0.25, burst: 1}'))
    assert found.silent == pytest.approx(0.25, abs=0.05)
    assert found.angles == (0.0, 0.0)


def test_angles_are_compared_as_directions(scene_with):
    found = judged(scene_with(FOUR_BAR, 'bias: {joints: {coupler_joint: 3.0}}', 'angles: wrapped'))
    assert found.angles[1] == pytest.approx(3.0)


def test_the_part_has_a_row_for_each_effect_and_for_all(scene_with):
    scene = scene_with(
        FOUR_BAR, 'velocity: {}, encoder: {joints: {rocker_joint: {counts: 4096}}}', 'seed: 1'
    )
    told = []
    part = measure_effects(scene, True, told.append)
    (table,) = part.tables
    assert [row[0] for row in table.rows] == [
        'a tick without effects',
        'velocity',
        'encoder',
        WHOLE,
    ]
    assert all(len(row) == len(table.columns) for row in table.rows)
    assert all(isinstance(row[1], Spread) and row[1].low <= row[1].high for row in table.rows)
    angles = table.columns.index('angles, greatest [rad]')
    assert table.rows[1][angles] == 0.0
    assert 0.0 < table.rows[2][angles] <= radians(360 / 4096)
    (diagram,) = part.diagrams
    assert [curve.name for curve in diagram.curves] == ['encoder', WHOLE]
    shares = told
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


def test_a_scene_without_effects_has_no_such_part(scene_with):
    assert measure_effects(scene_with(FOUR_BAR, ''), True, lambda *said: None) is None
