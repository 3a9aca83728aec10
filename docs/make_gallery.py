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


"""
Make docs/gallery.md and its pictures from the linkage files that come with the package.

The text on a linkage is the comment at the head of its file, with the results of `linkage check`.
Run it from anywhere: ``python docs/make_gallery.py``.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
import sys

from linkage_ros.cli.arguments import angle_text, fixed
from linkage_ros.cli.check import describe_group
from linkage_ros.drawing.figure import picture, view
from linkage_ros.files.linkage_file import load
from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.sweep_analysis import (
    conditionings,
    InputSweep,
    transmission_angles,
    usual_inputs,
)
from linkage_ros.kinematics.topology import Driven
from PIL import Image

DOCS = Path(__file__).resolve().parent
LINKAGES = DOCS.parent / 'config' / 'linkages'
LARGEST = 150_000
"""Bytes of a picture, at most."""

_COLOURS = 96

_INTRODUCTION = """\
# Gallery

The linkages in [config/linkages](../config/linkages), drawn by `linkage draw` and measured by
`linkage check`. This page is made from these files by `make gallery`; do not edit it. Driven links
are orange, poses all over the range light grey, paths of traced points dashed.
"""


def main() -> int:
    """Write the page and the pictures; return 1 where a picture is too large."""
    folder = DOCS / 'gallery'
    folder.mkdir(exist_ok=True)
    files = sorted(LINKAGES.glob('*.yaml'))
    for old in folder.iterdir():
        old.unlink()
    page = [_INTRODUCTION]
    large = []
    for file in files:
        closure = load(file)
        drawn = _draw(closure, file.stem, folder)
        if drawn.stat().st_size > LARGEST:
            large.append(drawn)
        page += [*chapter(closure, file, drawn), '']
    (DOCS / 'gallery.md').write_text('\n'.join(page).rstrip() + '\n', encoding='utf-8')
    for drawn in large:
        sys.stderr.write(f'{drawn}: more than {LARGEST} bytes\n')
    return 1 if large else 0


def _draw(closure: Closure, name: str, folder: Path) -> Path:
    """Draw a linkage, in as many colours as are told apart: as SVG it would be larger."""
    file = folder / f'{name}.png'
    picture(view(closure, usual_inputs(closure)), name, file, names=True)
    with Image.open(file) as drawn:
        drawn.convert('RGB').quantize(_COLOURS, dither=Image.Dither.NONE).save(file, optimize=True)
    return file


def chapter(closure: Closure, file: Path, drawn: Path) -> Iterator[str]:
    """Yield the lines on a linkage."""
    name = file.stem
    yield f'## {name}'
    yield ''
    yield f'![{name}]({drawn.relative_to(DOCS).as_posix()})'
    yield ''
    yield _head(file)
    yield ''
    yield f'- [{file.name}](../config/linkages/{file.name})'
    yield f'- Solved: {_sequence(closure)}'
    yield f'- Range: {_range(closure)}'
    extreme = _worst(closure)
    if extreme:
        yield f'- {extreme}'


def _head(file: Path) -> str:
    """Return the comment at the head of a file as one paragraph."""
    lines = []
    for line in file.read_text(encoding='utf-8').splitlines():
        if not line.startswith('#'):
            break
        if not line.startswith('# yaml-language-server:'):
            lines.append(line.lstrip('# ').rstrip())
    return ' '.join(lines)


def _sequence(closure: Closure) -> str:
    said = []
    for number, group in enumerate(closure.structure.groups):
        kind, links, how, assembly = describe_group(closure, number)
        if isinstance(group, Driven):
            said.append(f'input {closure.linkage.inputs[group.index].joint}')
        else:
            beside = assembly if how == 'closed form' else how
            said.append(f'{kind} {links} ({beside})')
    return '; '.join(said)


def _range(closure: Closure) -> str:
    if len(closure.linkage.inputs) > 1:
        return 'it depends on every input'
    way = InputSweep(closure)
    said = []
    for interval in way.ranges:
        if interval.whole:
            return 'the input turns fully'
        low, high = interval.lowest, interval.highest
        said.append(
            f'{angle_text(low, 2)} to {angle_text(high, 2)}'
            if way.turning
            else f'{fixed(low, 4)} to {fixed(high, 4)} m'
        )
    return ' or '.join(said)


def _worst(closure: Closure) -> str:
    """Return the smallest transmission angle of all dyads, or the worst conditioning."""
    if len(closure.linkage.inputs) > 1:
        return ''
    way = InputSweep(closure)
    angles = transmission_angles(way)
    if angles:
        group, found = min(angles.items(), key=lambda item: item[1].lowest.value)
        said = f'Least transmission angle: {angle_text(found.lowest.value, 1)}'
    else:
        group, found = min(conditionings(way).items(), key=lambda item: item[1].lowest.value)
        said = f'Worst conditioning: {found.lowest.value:.3f}'
    links = describe_group(closure, group)[1]
    at = found.lowest.at
    if not at:
        return f'{said}, everywhere'
    places = [angle_text(value, 1) if way.turning else f'{fixed(value, 4)} m' for value in at]
    return f'{said} ({links}) at {", ".join(places)}'


if __name__ == '__main__':
    sys.exit(main())
