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


"""The scenes that are measured: a four-bar with rates, recorded or not, or a hundred of them."""

from __future__ import annotations

from pathlib import Path

from bench.processes import ROOT


def write_scene(folder: Path, rate: float, record: bool = False) -> Path:
    """
    Write a scene and return its file.

    Parameters
    ----------
    folder
        Where to; a bag goes there too.
    rate
        Ticks a second; 0 for one for every sample.
    record
        Whether it is recorded.

    """
    file = folder / f'four_bar_{rate:g}{"_recorded" if record else ""}.yaml'
    lines = [
        f'linkage: {ROOT / "config" / "linkages" / "four_bar.yaml"}',
        f'rate: {rate:g}',
        'drive: {topic: {carry_forward: true, max_age: 0.2}}',
        'effects: {velocity: {}}',
    ]
    if record:
        lines.append(f'record: {{directory: {folder / "bags"}}}')
    file.write_text('\n'.join(lines) + '\n', encoding='utf-8')
    return file


def write_turning(folder: Path, rate: float) -> Path:
    """Write a scene of a four-bar that turns by itself, at a rate in [Hz]; return its file."""
    file = folder / f'turning_{rate:g}.yaml'
    lines = [
        f'linkage: {ROOT / "config" / "linkages" / "four_bar.yaml"}',
        f'rate: {rate:g}',
        'drive: {constant_rate: {rate: 1.0}}',
        'effects: {velocity: {}}',
    ]
    file.write_text('\n'.join(lines) + '\n', encoding='utf-8')
    return file


def write_many(folder: Path, rate: float, count: int) -> Path:
    """
    Write a scene of several four-bars that turn by themselves, each at a speed of its own.

    Parameters
    ----------
    folder
        Where to.
    rate
        Ticks a second.
    count
        How many.

    """
    file = folder / f'{count}_four_bars.yaml'
    linkage = ROOT / 'config' / 'linkages' / 'four_bar.yaml'
    lines = [f'rate: {rate:g}', 'effects: {velocity: {}}', 'linkages:']
    for number in range(count):
        lines += [
            f'  - name: bar_{number}',
            f'    linkage: {linkage}',
            f'    drive: {{constant_rate: {{rate: {1.0 + 0.01 * number:g}}}}}',
        ]
    file.write_text('\n'.join(lines) + '\n', encoding='utf-8')
    return file
