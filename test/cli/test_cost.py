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


"""``linkage cost``: what is measured and how it is told; never how long something took."""

from __future__ import annotations

import argparse
from dataclasses import fields
from importlib.util import module_from_spec, spec_from_file_location
from itertools import islice
import json
from pathlib import Path
from threading import Event

from linkage_ros.cli import cost as command
from linkage_ros.cli.terminal import Table
from linkage_ros.cost import (
    _difference,
    _times,
    EffectCost,
    feed,
    measure,
    SceneCost,
    Times,
    Variant,
    Variants,
)
from linkage_ros.drives.drive import DRIVES
from linkage_ros.dynamics.loads import AppliedLoads
from linkage_ros.effects.stage import EFFECTS
from linkage_ros.errors import LinkageError
from linkage_ros.faults.fault import FAULTS
from linkage_ros.pages.markdown import filled, marks
from linkage_ros.pipeline.pipeline import Pipeline
from linkage_ros.scene.load import load_scene
import pytest

from .conftest import json_keys, Run

ROOT = Path(__file__).parents[2]
CONFIG = ROOT / 'config'
SCENES = sorted((CONFIG / 'scenes').glob('*.yaml'))
FOUR_BAR = CONFIG / 'linkages' / 'four_bar.yaml'
BUCKET = CONFIG / 'linkages' / 'excavator_bucket.yaml'
FIVE_BAR = CONFIG / 'linkages' / 'five_bar.yaml'
FEW = 120

SPEC = spec_from_file_location('make_cost', ROOT / 'docs' / 'make_cost.py')
make_cost = module_from_spec(SPEC)
SPEC.loader.exec_module(make_cost)
BEGIN, END = marks('measured')
EVERYTHING = [
    'a tick without effects',
    *EFFECTS,
    *(drive for drive in DRIVES if drive != 'topic'),
    *command.OF_TORQUE,
    *command.FRICTION,
    *command.EVERY_LOAD,
    *FAULTS,
]
"""The rows of the table of all: the bare tick is one by the topic drive."""


def scene_of(folder: Path, text: str):
    (folder / 'scene.yaml').write_text(text)
    return load_scene(folder / 'scene.yaml')


def effects_of(cost: SceneCost) -> dict[str, EffectCost]:
    return {effect.name: effect for effect in cost.effects}


@pytest.mark.parametrize('path', SCENES, ids=lambda path: path.stem)
def test_every_shipped_scene_can_be_measured(path):
    scene = load_scene(path)
    cost = measure(scene, FEW)
    assert cost is not None
    named = {name for member in scene.members for name in member.effects}
    assert named <= set(effects_of(cost))
    assert cost.bare.median > 0.0
    assert cost.whole.p99 >= cost.whole.median
    assert cost.published > 0.0
    drives = {member.drive[0] for member in scene.members}
    assert (cost.offer is not None) == bool(drives & {'topic', 'torque'})
    for effect in cost.effects:
        assert effect.adds is not None
        assert (effect.saves is None) == bool(effect.needed_by)
    table = command.table_of_scene('x', cost, FEW)
    assert [row[0] for row in table.rows][-1] == 'a tick of the scene'
    assert all(len(row) == len(table.columns) for row in table.rows)


def test_what_is_brought_in_cannot_be_left_out(tmp_path):
    scene = scene_of(
        tmp_path,
        f'linkage: {FOUR_BAR}\nrate: 250\nloads: {{gravity: [0, -9.81]}}\n'
        'effects: {velocity: {}, effort: {}, clearance: {pins: {B: 1.0e-4}},'
        ' friction: {joints: {B: {viscous: 0.1}}}, bias: {joints: {rocker_joint: 1}}}\n'
        'faults: {f: {freeze: {}}}\n',
    )
    found = effects_of(measure(scene, FEW))
    assert list(found) == [
        'velocity', 'acceleration', 'friction', 'effort', 'pin_forces', 'clearance', 'bias',
        'fault f',
    ]  # fmt: skip
    assert found['velocity'].needed_by == ('effort', 'clearance')
    assert found['acceleration'].needed_by == ('effort', 'clearance')
    assert found['pin_forces'].needed_by == ('clearance',)
    for name in ('velocity', 'acceleration', 'pin_forces'):
        assert found[name].saves is None
    for name in ('friction', 'effort', 'clearance', 'bias', 'fault f'):
        assert found[name].needed_by == ()
        assert found[name].saves is not None
    # Friction alone acts on nothing.
    assert found['friction'].beside == 'effort'
    assert all(effect.beside == '' for name, effect in found.items() if name != 'friction')


def test_each_fault_has_its_price(tmp_path):
    scene = scene_of(
        tmp_path,
        f'linkage: {FOUR_BAR}\nfaults: {{quiet: {{silence: {{}}}}, hung: {{freeze: {{}}}}}}\n',
    )
    found = effects_of(measure(scene, FEW))
    assert list(found) == ['fault hung', 'fault quiet']
    assert all(fault.adds is not None and fault.saves is not None for fault in found.values())
    alone = Variants(scene).build(frozenset({'fault hung'}))
    assert list(alone.pipeline.injection.faults) == ['hung']


def test_what_acts_on_nothing_then_is_left_out_too(tmp_path):
    scene = scene_of(
        tmp_path,
        f'linkage: {FOUR_BAR}\nloads: {{gravity: [0, -9.81]}}\n'
        'effects: {effort: {}, friction: {joints: {B: {viscous: 0.1}}}}\n',
    )
    found = effects_of(measure(scene, FEW))
    assert found['effort'].left_out_with == 'friction'
    assert found['effort'].saves is not None
    assert found['friction'].left_out_with == ''


def test_a_variant_consists_of_what_it_is_asked_for(tmp_path):
    scene = scene_of(
        tmp_path,
        f'linkage: {FOUR_BAR}\nloads: {{gravity: [0, -9.81]}}\nrecord: {{}}\n'
        'effects: {effort: {}, delay: {seconds: 0.01}, bias: {joints: {rocker_joint: 1}}}\n'
        'faults: {f: {freeze: {}}}\n',
    )
    variants = Variants(scene)

    def stages(*names):
        (line,) = variants.build(frozenset(names)).pipeline.lines
        return line.stages

    assert stages() == ()
    assert stages('bias') == ('bias',)
    assert stages('delay', 'bias') == ('velocity', 'bias', 'delay')
    assert stages('velocity') == ('velocity',)
    assert stages('effort') == ('velocity', 'acceleration', 'effort')
    assert variants.build(frozenset({'fault f'})).pipeline.injection is not None
    assert variants.build(frozenset({'bias'})).pipeline.injection is None
    # One that has been built is not built again.
    assert variants.build(frozenset({'bias'})) is variants.build(frozenset({'bias'}))


@pytest.mark.parametrize(
    'text',
    [
        f'linkage: {BUCKET}\neffects: {{velocity: {{}}}}\n',
        f'linkage: {FIVE_BAR}\neffects: {{acceleration: {{}}}}\n',
        f'linkage: {FOUR_BAR}\nrate: 0\neffects: {{velocity: {{}}}}\n',
        f'linkage: {FOUR_BAR}\ndrive: {{sine: {{amplitude: 1, frequency: 2}}}}\n',
        (
            f'effects: {{velocity: {{}}}}\nlinkages:\n- {{name: a, linkage: {FOUR_BAR}}}\n'
            f'- {{name: b, linkage: {FIVE_BAR}}}\n'
        ),
    ],
    ids=['a slide', 'two inputs', 'a tick for every sample', 'a drive of its own', 'two linkages'],
)
def test_the_crank_moves_within_reach(tmp_path, text):
    assert measure(scene_of(tmp_path, text), FEW).published == 1.0


def test_it_can_be_stopped():
    assert measure(load_scene(SCENES[0]), FEW, stopped=lambda: True) is None
    parser = argparse.ArgumentParser()
    command.add_arguments(parser)
    stop = Event()
    stop.set()
    assert command.run(parser.parse_args([str(SCENES[0])]), stop) == 1


def test_median_and_percentile_are_of_these_numbers():
    # 1 to 1000 µs, thrice; one thousand is disturbed as a whole, and the p99 does not follow it.
    calm = list(range(1000, 1_001_000, 1000))
    times = _times([*calm, *(value + 10**9 for value in calm), *calm])
    assert times.median == 750.5
    assert times.p99 == 990.0
    assert _times([3000]) == Times(3.0, 3.0, 3.0, 3.0)
    assert _difference([5000, 5000], [2000, 2000]) == Times(3.0, 3.0, 3.0, 3.0)


COST = SceneCost(
    offer=Times(1.0, 2.0, 1.0, 2.0),
    bare=Times(4.0, 6.0, 4.0, 6.0),
    whole=Times(10.0, 15.0, 10.0, 15.0),
    effects=(
        EffectCost('velocity', Times(2.0, 2.5, 2.0, 2.5), '', None, '', ('effort',)),
        EffectCost('friction', Times(-0.5, 1.0, -0.5, 1.0), 'effort', 0.25, '', ()),
        EffectCost('effort', Times(4.5, 5.0, 4.5, 5.0), '', 5.0, 'friction', ()),
        EffectCost('bias', None, '', None, '', ()),
    ),
    published=0.5,
)


def test_the_table_of_a_scene():
    table = command.table_of_scene('s.yaml', COST, 100)
    assert table.title == 's.yaml: 100 ticks each; 50.0% of them published something'
    assert list(table.rows) == [
        ('a tick without effects', '4.00', '6.00', '40.0%', '', ''),
        ('  of it the crank message', '1.00', '2.00', '10.0%', '', ''),
        ('velocity', '+2.00', '+2.50', '20.0%', '', 'needed by effort'),
        ('friction', '-0.50', '+1.00', '-5.0%', '0.25', 'added beside effort'),
        ('effort', '+4.50', '+5.00', '45.0%', '5.00', 'left out with friction'),
        ('bias', '', '', '', '', ''),
        ('a tick of the scene', '10.00', '15.00', '100.0%', '', ''),
    ]


def test_the_table_of_all_effects():
    drives = {'constant_rate': Times(-1.0, -1.5, -1.0, -1.0)}
    faults = {'freeze': Times(0.5, 0.25, 0.5, 0.5)}
    assert list(command.table_of_all(command.Costs(COST, drives, faults), 100).rows) == [
        ('a tick without effects', '4.00', '6.00', '1.00', ''),
        ('velocity', '+2.00', '+2.50', '+0.50', ''),
        ('friction', '-0.50', '+1.00', '-0.12', 'effort'),
        ('effort', '+4.50', '+5.00', '+1.12', 'velocity, acceleration'),
        ('bias', '', '', '', ''),
        ('constant_rate', '-1.00', '-1.50', '-0.25', 'in the place of topic'),
        ('freeze', '+0.50', '+0.25', '+0.12', 'not injected'),
    ]


def told(capsys, *typed: str) -> dict:
    parser = argparse.ArgumentParser()
    command.add_arguments(parser)
    assert command.run(parser.parse_args([*typed, '--ticks', str(FEW), '--json']), Event()) == 0
    return json.loads(capsys.readouterr().out)


def test_json_of_a_scene_has_the_documented_keys_in_microseconds(capsys):
    account = told(capsys, str(CONFIG / 'scenes' / 'demo.yaml'))
    assert set(account) == json_keys('cost')
    assert account['ticks'] == FEW
    assert set(account['whole_tick']) == {'median_us', 'p99_us', 'low_us', 'high_us'}
    assert account['whole_tick']['median_us'] > 0.0
    assert (account['drives'], account['under_torque'], account['faults']) == ({}, {}, {})
    scene = load_scene(CONFIG / 'scenes' / 'demo.yaml')
    assert set(scene.members[0].effects) <= {effect['name'] for effect in account['effects']}


def test_json_of_all_has_every_drive_and_fault():
    times = Times(1.0, 2.0, 3.0, 4.0)
    account = command.account_of(command.Costs(COST, {'sine': times}, {'freeze': times}))
    as_json = {'median_us': 1.0, 'p99_us': 2.0, 'low_us': 3.0, 'high_us': 4.0}
    assert account['drives'] == {'sine': as_json}
    assert account['faults'] == {'freeze': as_json}
    assert [effect['saves_us'] for effect in account['effects']] == [None, 0.25, 5.0, None]


def test_progress_counts_the_ticks_of_each_variant(tmp_path):
    seen = []
    scene = scene_of(tmp_path, f'linkage: {FOUR_BAR}\n')
    measure(scene, 250, progress=lambda done, of: seen.append((done, of)))
    assert seen == [(0, 250), (100, 250), (200, 250), (250, 250)]


def test_all_means_all():
    (member,) = command.every_effect().members
    assert list(member.effects) == list(EFFECTS)
    assert list(command.EVERY_DRIVE) == list(DRIVES)
    assert list(command.EVERY_LOAD) == [entry.name for entry in fields(AppliedLoads)]
    assert list(command.EVERY_FAULT) == list(FAULTS)
    table = command.table_of_all(command.all_effects(FEW), FEW)
    assert [row[0] for row in table.rows] == EVERYTHING
    assert all(row[1] for row in table.rows)


@pytest.mark.parametrize('name', command.EVERY_DRIVE)
def test_every_drive_that_is_priced_moves_the_linkage_at_every_tick(tmp_path, name):
    command._record_samples(tmp_path / 'samples')
    scene = command._of_four_bar(command._with_drive(name), str(tmp_path))
    ticked = Variant(Pipeline(scene))
    times = feed(scene, ticked.pipeline)
    ticked.run(*zip(*[next(times) for _ in range(2500)], strict=True))
    assert ticked.published == 2500
    # A drive that stands would be too cheap.
    seen = set()
    for now, message in islice(times, 400):
        ticked.pipeline.offer(message, now)
        seen.add(ticked.pipeline.tick(now).message[-24:])
    assert len(seen) > 300


def test_a_fault_is_priced_with_its_clock_and_never_injected(tmp_path):
    scene = scene_of(
        tmp_path,
        f'linkage: {FOUR_BAR}\ndrive: {{sine: {{amplitude: 1, frequency: 1}}}}\nfaults:\n'
        '  quiet: {silence: {}, at: [0.01], seconds: 1}\n'
        '  clock: {time_jump: {by: 1.0}, at: [0.01], seconds: 1}\n',
    )
    ticked = Variants(scene).build(frozenset({'fault quiet', 'fault clock'}))
    times = feed(scene, ticked.pipeline)
    ticked.run(*zip(*[next(times) for _ in range(50)], strict=True))
    assert ticked.published == 50
    assert set(ticked.pipeline.injection.injected.values()) == {0}
    # The switches are looked at in every tick, as in the node: asked for, a fault begins.
    ticked.pipeline.injection.ask('quiet', on=True)
    ticked.run(*zip(*[next(times) for _ in range(50)], strict=True))
    assert ticked.published == 50


def test_the_page_has_every_effect():
    page = make_cost.PAGE.read_text('utf-8')
    _, _, rest = page.partition(BEGIN)
    table, _, _ = rest.partition(END)
    rows = [line.split('|')[1].strip() for line in table.splitlines() if line.startswith('|')]
    assert rows == ['', '---', *EVERYTHING]


def test_only_what_lies_between_the_marks_is_written():
    page = f'before\n{BEGIN}\nold\n{END}\nbehind\n'
    assert filled(page, 'measured', 'new') == f'before\n{BEGIN}\nnew\n{END}\nbehind\n'
    table = Table('title', ('', '>a [µs]'), [('x', '1')])
    text = make_cost.measured(table, [('cores', '2'), ('kernel', '6'), ('python', '3.12')])
    head, _, *lines = text.splitlines()
    assert head == 'title; cores 2, python 3.12.'
    assert lines == ['|  | a [µs] |', '| --- | ---: |', '| x | 1 |']


@pytest.mark.parametrize(
    ('typed', 'said'),
    [
        ((), 'one of the arguments SCENE --all is required'),
        (('x.yaml', '--all'), 'not allowed with argument'),
        (('x.yaml',), 'x.yaml: cannot be read'),
        (('bad.yaml',), "bad.yaml:2: rtae: unknown key; did you mean 'rate'?"),
        (('good.yaml', '--ticks', '0'), '0 is not between 1 and 1e+07'),
        (('good.yaml', '--ticks', 'many'), 'many'),
    ],
    ids=str,
)
def test_wrong_input_is_refused_in_a_line(linkage: Run, tmp_path, typed, said):
    (tmp_path / 'good.yaml').write_text(f'linkage: {FOUR_BAR}\n')
    (tmp_path / 'bad.yaml').write_text(f'linkage: {FOUR_BAR}\nrtae: 5\n')
    answer = linkage('cost', *typed)
    assert answer.returncode == 2
    assert said in answer.stderr
    assert 'Traceback' not in answer.stderr
    assert answer.stdout == ''


def test_a_scene_that_publishes_nothing_is_not_measured(tmp_path):
    (tmp_path / 's.yaml').write_text(
        f'linkage: {BUCKET}\ndrive: {{constant_rate: {{rate: 0, start: 100}}}}\n'
    )
    parser = argparse.ArgumentParser()
    command.add_arguments(parser)
    with pytest.raises(LinkageError, match='nothing is published in 20 ticks'):
        command.run(parser.parse_args([f'{tmp_path}/s.yaml', '--ticks', '20']), Event())


def test_it_is_told_in_a_table(linkage: Run):
    answer = linkage('cost', str(CONFIG / 'scenes' / 'demo.yaml'), '--ticks', '50')
    assert answer.returncode == 0, answer.stderr
    title, heads, *rows = answer.stdout.splitlines()
    assert title.endswith('demo.yaml: 50 ticks each')
    assert 'median [µs]' in heads
    assert [row.split('  ')[0] for row in rows if not row.startswith(' ')] == [
        'a tick without effects',
        'velocity',
        'a tick of the scene',
    ]
