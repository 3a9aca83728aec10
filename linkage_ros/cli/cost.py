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


"""Say what effects, drives and faults cost on this machine, and what leaving them out saves."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
import json
from math import tau
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Event
from types import MappingProxyType
from typing import Any, NamedTuple

from linkage_ros.bag.topic import Topic
from linkage_ros.bag.writer import BagWriter
from linkage_ros.cli.arguments import add_set, bounded, check_no_settings, SCENE_HELP
from linkage_ros.cli.terminal import progress, ProgressCallback, show, Table
from linkage_ros.cost import compare, EffectCost, measure, SceneCost, Times
from linkage_ros.effects.stage import NEEDS
from linkage_ros.errors import LinkageError
from linkage_ros.messages.joint_state import JointStateWriter
from linkage_ros.messages.joint_values import JOINT_STATE
from linkage_ros.resources import shipped
from linkage_ros.scene.load import LINKAGE_FILE, load_scene, parse_scene, SCENE_FILE
from linkage_ros.scene.scene import Scene

ALL = 'all'
"""Name of the scene of all effects."""

_TICKS = 10_000
_MOST_TICKS = 10_000_000

EVERY_EFFECT = b"""
linkage: four_bar.yaml
publish_input: true
loads: {gravity: [0, -9.81]}
effects:
  tolerance: {standard_deviation: 2.0e-5}
  backlash: {play: 0.01}
  velocity: {}
  acceleration: {}
  friction: {joints: {O2: {coulomb: 0.01}}}
  effort: {}
  pin_forces: {}
  compliance: {links: {coupler: 1.0e+7}}
  clearance: {pins: {B: 1.0e-4}}
  jitter: {seconds: 1.0e-4}
  bias: {joints: {rocker_joint: 0.01}}
  noise: {joints: {rocker_joint: {white: 0.001, walk: 0.001, rate_white: 0.01}}}
  measuring_range: {joints: {rocker_joint: {low: 1.0, high: 2.2}}}
  encoder: {joints: {rocker_joint: {counts: 4096}}}
  rate_limit: {rate: 500}
  dropout: {probability: 0.1, burst: 3}
  delay: {seconds: 0.002}
  markers: {rate: 30}
"""
"""A scene with every effect, each on one joint, pin or link of the shipped four-bar."""

_BAG = 'samples'
"""Name of the bag for the drive that plays samples from a bag."""

EVERY_DRIVE = {
    'topic': '{}',
    'constant_rate': '{rate: 6.2832}',
    'profile': '{table: [[0, 0], [1, 2], [1.5, 2], [2.5, 0.5]], repeat: true}',
    'sine': '{mean: 1.0, amplitude: 0.5, frequency: 1.0}',
    'chirp': '{mean: 1.0, amplitude: 0.5, start_frequency: 0.5, end_frequency: 4.0, '
    'seconds: 4.0, repeat: true}',
    'bag': f'{{file: {_BAG}, repeat: true}}',
    'torque': '{start: 1.0, rate: 6.2832}',
}
"""Every drive with its parameters, moving the shipped four-bar."""

EVERY_LOAD = {
    'joint_springs': '{rocker_joint: {stiffness: 0.01, free: 1.5}}',
    'stops': '{rocker_joint: {stiffness: 50}}',
    'efforts': '{rocker_joint: {over_position: [[1, 0], [1.5, 0.01], [2, 0]]}}',
    'forces': '{coupler.P: {direction: [0, -1], constant: 0.1}}',
    'wrenches': '{coupler: {point: P}}',
}
"""Every load on joints and points, on the shipped four-bar; its rocker gets limits."""

OF_TORQUE = {
    'motor': 'motor: {torque_constant: 0.05, ratio: 10, resistance: 2, command: voltage}',
    'motor with inductance': 'motor: {torque_constant: 0.05, ratio: 10, resistance: 2, '
    'inductance: 0.01, command: voltage}',
    'play': 'play: {width: 0.05, inertia: 1.0e-4}',
    'motor_encoder': 'motor_encoder: {counts: 2048}',
}
"""Every part of the torque drive."""

FRICTION = {
    'coulomb friction': '{coulomb: 1.0e-9}',
    'friction by the force': '{coefficient: 0.1, radius: 0.004}',
    'Stribeck friction': '{coulomb: 1.0e-9, breakaway: 2.0e-9, stribeck: 1}',
}
"""Friction in a pin, so small that the linkage goes on: at rest a tick takes less."""

EVERY_FAULT = {
    'time_jump': '{by: 1.0}',
    'not_a_number': '{}',
    'broken_link': '{link: coupler}',
    'stuck': '{joint: rocker_joint}',
    'freeze': '{}',
    'silence': '{}',
}
"""Every fault with its parameters, on the shipped four-bar."""


EXAMPLE = 'linkage cost worn_press --ticks 2000'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    one = parser.add_mutually_exclusive_group(required=True)
    one.add_argument('scene', nargs='?', metavar='SCENE', help=SCENE_HELP)
    one.add_argument(
        '--all',
        action='store_true',
        help='every effect, drive, load and fault, alone, on the four-bar that is shipped',
    )
    parser.add_argument(
        '--ticks',
        type=bounded(1, _MOST_TICKS, int),
        default=_TICKS,
        metavar='N',
        help=f'how often each variant of the scene ticks (default: {_TICKS})',
    )
    parser.add_argument('--json', action='store_true', help='the same as JSON, in microseconds')
    add_set(parser)


def run(arguments: argparse.Namespace, stop: Event) -> int:
    """Measure; return 1 if stopped."""
    ticks = arguments.ticks
    if arguments.all:
        check_no_settings(arguments.set)
    with progress('ticks of each variant') as advance:
        if arguments.all:
            costs = all_effects(ticks, stop.is_set, advance)
        else:
            scene = load_scene(arguments.scene, arguments.set)
            cost = measure(scene, ticks, stopped=stop.is_set, progress=advance)
            costs = None if cost is None else Costs(cost)
    if costs is None:
        return 1
    if not arguments.all and not costs.scene.published:
        raise LinkageError(
            arguments.scene,
            f'nothing is published in {ticks} ticks: there is nothing to measure',
            'see that the linkage closes where the drive brings it',
        )
    if arguments.json:
        account = {'file': arguments.scene, 'ticks': ticks, **account_of(costs)}
        print(json.dumps(account, indent=1, allow_nan=False))
    elif arguments.all:
        show(table_of_all(costs, ticks))
    else:
        show(table_of_scene(arguments.scene, costs.scene, ticks))
    return 0


class Costs(NamedTuple):
    """Measured costs."""

    scene: SceneCost  # Cost of a scene, or of the scene of all effects
    # What each drive takes beyond the topic drive; empty unless all are measured.
    drives: Mapping[str, Times] = MappingProxyType({})
    # What each fault takes while it is not injected; empty unless all are measured.
    faults: Mapping[str, Times] = MappingProxyType({})
    # What each part, friction and load takes under the torque drive; empty unless all are
    # measured.
    under_torque: Mapping[str, Times] = MappingProxyType({})


def all_effects(
    ticks: int,
    stopped: Callable[[], bool] = lambda: False,
    advance: ProgressCallback = lambda _done, _of: None,
) -> Costs | None:
    """Measure all that a scene can name, on the four-bar; return None if stopped."""

    def part(number: int) -> ProgressCallback:
        return lambda done, of: advance(number * of + done, 3 * of)

    cost = measure(every_effect(), ticks, leave_out=False, stopped=stopped, progress=part(0))
    if cost is None:
        return None
    with TemporaryDirectory() as folder:
        _record_samples(Path(folder) / _BAG)
        bare = _of_four_bar(_with_drive('topic'))
        drives = {name: _of_four_bar(_with_drive(name), folder) for name in EVERY_DRIVE}
        del drives['topic']
        faults = {name: _of_four_bar(_with_fault(name)) for name in EVERY_FAULT}
        found = compare(bare, {**drives, **faults}, ticks, stopped=stopped, progress=part(1))
    moved = {name: _of_four_bar(text) for name, text in _under_torque().items()}
    under_torque = compare(
        _of_four_bar(_with_drive('torque')), moved, ticks, stopped=stopped, progress=part(2)
    )
    if found is None or under_torque is None:
        return None
    return Costs(cost, {n: found[n] for n in drives}, {n: found[n] for n in faults}, under_torque)


def account_of(costs: Costs) -> dict[str, Any]:
    """Return measured costs as JSON holds them; times are in [µs]."""
    cost = costs.scene
    return {
        'published': cost.published,
        'crank_message': _times_account(cost.offer),
        'bare_tick': _times_account(cost.bare),
        'whole_tick': _times_account(cost.whole),
        'effects': [
            {
                'name': effect.name,
                'adds': _times_account(effect.adds),
                'added_beside': effect.beside or None,
                'saves_us': effect.saves,
                'left_out_with': effect.left_out_with or None,
                'needed_by': list(effect.needed_by),
            }
            for effect in cost.effects
        ],
        'drives': {name: _times_account(times) for name, times in costs.drives.items()},
        'under_torque': {
            name: _times_account(times) for name, times in costs.under_torque.items()
        },
        'faults': {name: _times_account(times) for name, times in costs.faults.items()},
    }


def _times_account(times: Times | None) -> dict[str, float] | None:
    return times and {f'{name}_us': value for name, value in times._asdict().items()}


def every_effect() -> Scene:
    """Return the scene of all effects."""
    return _of_four_bar(EVERY_EFFECT.decode())


def _of_four_bar(text: str, folder: str = '') -> Scene:
    linkage = shipped('linkages/four_bar.yaml').read_bytes()
    if 'stops: ' in text:
        linkage = linkage.replace(b'child: rocker}', b'child: rocker, limits: [0.5, 2.6]}')
    return parse_scene(ALL, ALL, {SCENE_FILE: text.encode(), LINKAGE_FILE: linkage}, folder)


def _with_drive(name: str) -> str:
    """Return a scene of one drive; all publish the input, as every drive but a topic does."""
    return f'linkage: four_bar.yaml\npublish_input: true\ndrive: {{{name}: {EVERY_DRIVE[name]}}}\n'


def _under_torque() -> dict[str, str]:
    """Return the scenes with one part, friction or load each, under the torque drive."""
    drive = _with_drive('torque')
    rubbed = f'{drive}effects: {{friction: {{joints: {{O2: %s}}}}}}\n'
    return {
        **{name: drive.replace('}}', f', {part}}}}}') for name, part in OF_TORQUE.items()},
        **{name: rubbed % friction for name, friction in FRICTION.items()},
        **{name: f'{drive}loads: {{{name}: {load}}}\n' for name, load in EVERY_LOAD.items()},
    }


def _with_fault(name: str) -> str:
    """Return the scene that others are compared with, and a fault that is never injected."""
    return f'{_with_drive("topic")}faults: {{one: {{{name}: {EVERY_FAULT[name]}}}}}\n'


def _record_samples(folder: Path) -> None:
    """Record a turn of the crank at 100 samples a second, for the drive that plays a bag."""
    writer = BagWriter(folder, [Topic('/crank', JOINT_STATE, '', '')])
    write = JointStateWriter(['crank_joint']).write
    for number in range(100):
        stamp = number * 10_000_000 + 1
        sample = write(stamp, [tau * number / 100], [tau])
        writer.write(0, stamp, stamp, sample)
    writer.close()


def table_of_scene(title: str, cost: SceneCost, ticks: int) -> Table:
    """Return the table of a scene."""
    rows = [
        (
            effect.name,
            *_adds(effect.adds),
            f'{effect.adds.median / cost.whole.median:.1%}' if effect.adds else '',
            '' if effect.saves is None else f'{effect.saves:.2f}',
            _note(effect),
        )
        for effect in cost.effects
    ]
    part = '' if cost.published == 1.0 else f'; {cost.published:.1%} of them published something'
    return Table(
        f'{title}: {ticks} ticks each{part}',
        ('', '>median [µs]', '>p99 [µs]', '>of the tick', '>saved if left out [µs]', ''),
        [
            _whole('a tick without effects', cost.bare, cost),
            *([_whole('  of it the crank message', cost.offer, cost)] if cost.offer else []),
            *rows,
            _whole('a tick of the scene', cost.whole, cost),
        ],
    )


def table_of_all(costs: Costs, ticks: int) -> Table:
    """Return the table of all effects, drives, loads and faults, each alone."""
    cost = costs.scene
    rows = [
        (
            effect.name,
            *_adds(effect.adds),
            f'{effect.adds.median / cost.bare.median:+.2f}' if effect.adds else '',
            effect.beside or ', '.join(NEEDS.get(effect.name, ())),
        )
        for effect in cost.effects
    ]
    for found, beside in (
        (costs.drives, 'in the place of topic'),
        (costs.under_torque, 'under torque'),
        (costs.faults, 'not injected'),
    ):
        rows += [
            (name, *_adds(times), f'{times.median / cost.bare.median:+.2f}', beside)
            for name, times in found.items()
        ]
    bare = f'{cost.bare.median:.2f}', f'{cost.bare.p99:.2f}', '1.00'
    return Table(
        f'Every effect, drive, load and fault, alone, on the four-bar: {ticks} ticks each',
        ('', '>median [µs]', '>p99 [µs]', '>in bare ticks', 'with'),
        [('a tick without effects', *bare, ''), *rows],
    )


def _whole(name: str, times: Times, cost: SceneCost) -> tuple[str, ...]:
    share = times.median / cost.whole.median
    return name, f'{times.median:.2f}', f'{times.p99:.2f}', f'{share:.1%}', '', ''


def _adds(times: Times | None) -> tuple[str, str]:
    return (f'{times.median:+.2f}', f'{times.p99:+.2f}') if times else ('', '')


def _note(effect: EffectCost) -> str:
    notes = [
        f'added beside {effect.beside}' if effect.beside else '',
        f'left out with {effect.left_out_with}' if effect.left_out_with else '',
        f'needed by {", ".join(effect.needed_by)}' if effect.needed_by else '',
    ]
    return '; '.join(filter(None, notes))
