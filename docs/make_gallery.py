# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Make docs/gallery.md, a page and a picture of each linkage that comes with the package.

Beside each picture there is a small one for an overview, and one linkage is animated for the
first page. The text on a linkage is the comment at the head of its file, and the results of
`linkage check`.
Run it from anywhere: ``python docs/make_gallery.py``.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import compress
from pathlib import Path
import shutil
import sys

from linkage_ros.cli import angle_text, describe_groups, fixed_text
from linkage_ros.description import load
from linkage_ros.kinematics import (
    Closure,
    conditioning_curves,
    Driven,
    InputSweep,
    LinkageView,
    links_of,
    PlanarClosure,
    prepare_view,
    SpaceClosure,
    transmission_angles,
    usual_inputs,
)
from linkage_ros.tools.drawing import (
    animate,
    draw_linkage,
    paint_linkage,
    paint_picture,
    picture_settings,
    range_motion,
    save_picture,
)
from matplotlib.figure import Figure
from PIL import Image

DOCS = Path(__file__).resolve().parent
LINKAGES = DOCS.parent / 'config' / 'linkages'
LARGEST = 150_000
LARGEST_SMALL = 30_000
LARGEST_MOVING = {'svg': 200_000, 'gif': 300_000}
"""Maximum sizes of a picture, a small one and a moving one, in bytes."""

_COLOURS = 96
_HERO = 'jansen_leg'
_HERO_JOINTS = ('parallel_rod_joint', 'lower_rocker_joint', 'leg_joint')

_INTRODUCTION = """\
# Gallery

The linkages that come with the package, in [config/linkages](../config/linkages). Their names
stand for them in all commands, as in `linkage check jansen_leg`; `linkage gallery NAME -o FILE`
copies one. `make gallery` makes this page and theirs from the files; do not edit them.
"""

_PLANAR_LOOK = (
    '*Driven links are orange, poses over the whole range light grey, paths of traced points '
    'dashed.*'
)
_SPATIAL_LOOK = (
    '*Driven links are orange, joints of the ground dark cylinders, balls dots; poses over the '
    'range of a single input are light grey, paths of traced points dashed.*'
)

_CONTENTS = """\

```{toctree}
:hidden:
:glob:

gallery/*
```
"""


def main() -> int:
    """Write the pages and the pictures; return 1 if a picture is too large."""
    folder = DOCS / 'gallery'
    shutil.rmtree(folder, ignore_errors=True)
    (folder / 'thumbnails').mkdir(parents=True)
    files = [*sorted(LINKAGES.glob('*.yaml')), *sorted(LINKAGES.glob('space/*.yaml'))]
    sizes = {}
    for file in files:
        closure = load(file)
        shown = prepare_view(closure, usual_inputs(closure))
        drawn = folder / f'{file.stem}.png'
        paint_picture(shown, file.stem, drawn, names=True)
        small = folder / 'thumbnails' / drawn.name
        thumbnail(shown, small)
        sizes |= {_with_few_colours(drawn): LARGEST, _with_few_colours(small): LARGEST_SMALL}
        page = '\n'.join(chapter(closure, file, drawn))
        drawn.with_suffix('.md').write_text(f'{page}\n', encoding='utf-8')
    first = [_INTRODUCTION, *overview(files), _CONTENTS]
    (DOCS / 'gallery.md').write_text('\n'.join(first), encoding='utf-8')
    for kind, most in LARGEST_MOVING.items():
        sizes[hero(DOCS / f'hero.{kind}')] = most
    large = [(file, most) for file, most in sizes.items() if file.stat().st_size > most]
    for file, most in large:
        sys.stderr.write(f'{file}: more than {most} bytes\n')
    return 1 if large else 0


def thumbnail(shown: LinkageView, file: Path) -> None:
    """Draw a linkage alone, small."""
    with picture_settings():
        figure = Figure(figsize=(4.0, 3.0), dpi=100)
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        paint_linkage(axes, draw_linkage(shown)._replace(has_lengths=False), 2.0)
        axes.set_axis_off()
        save_picture(figure, file)


def hero(file: Path) -> Path:
    """Animate a linkage beside three of its joints, readable where it is 400 pixels wide."""
    closure = load(_HERO)
    motion = range_motion(prepare_view(closure, usual_inputs(closure)), _HERO, 4.0)
    shown = [joint.name in _HERO_JOINTS for joint in motion.joints]
    joints = list(compress(motion.joints, shown))
    animate(motion._replace(joints=joints, values=motion.values[:, shown]), file, compact=True)
    return file


def _with_few_colours(file: Path) -> Path:
    """Store a picture with few colours, which is smaller than SVG."""
    with Image.open(file) as drawn:
        drawn.convert('RGB').quantize(_COLOURS, dither=Image.Dither.NONE).save(file, optimize=True)
    return file


def overview(files: Sequence[Path]) -> Iterator[str]:
    """Yield the linkages as a list of pictures that lead to their pages."""
    for name in (file.stem for file in files):
        yield f'- [![](gallery/thumbnails/{name}.png) {name}](gallery/{name}.md)'


def chapter(closure: Closure | SpaceClosure, file: Path, drawn: Path) -> Iterator[str]:
    """Yield the lines of the page on a linkage."""
    name = file.stem
    yield f'# {name}'
    yield ''
    yield f'![{name}, its range and its joints]({drawn.name})'
    yield ''
    yield _PLANAR_LOOK if isinstance(closure, PlanarClosure) else _SPATIAL_LOOK
    yield ''
    yield _head(file)
    yield ''
    yield f'- [{file.name}](../../config/linkages/{file.relative_to(LINKAGES)})'
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


def group_words(kind: str, links: Sequence[str], method: str, assembly: str) -> Iterator[str]:
    """Yield what the page says of a group of a spatial linkage."""
    yield kind
    yield ', '.join(links)
    yield f'({method}{"; " * bool(assembly)}{assembly})'


def _sequence(closure: Closure | SpaceClosure) -> str:
    if isinstance(closure, SpaceClosure):
        return '; '.join(' '.join(filter(None, group_words(*group))) for group in closure.groups)
    steps = []
    described = zip(closure.structure.groups, describe_groups(closure), strict=True)
    for group, (kind, links, how, assembly) in described:
        if isinstance(group, Driven):
            driven = closure.linkage.driven_joints[group.index].joint
            steps.append(f'{kind} {driven}')
        else:
            beside = assembly if how == 'closed form' else how
            steps.append(f'{kind} {", ".join(links)} ({beside})')
    return '; '.join(steps)


def _range(closure: Closure | SpaceClosure) -> str:
    if len(closure.linkage.inputs) > 1:
        return 'depends on every input'
    sweep = InputSweep(closure)
    intervals = []
    for interval in sweep.ranges:
        if interval.is_whole:
            return 'the input turns fully'
        low, high = interval.lowest, interval.highest
        intervals.append(
            f'{angle_text(low, 2)} to {angle_text(high, 2)}'
            if sweep.turning
            else f'{fixed_text(low, 4)} to {fixed_text(high, 4)} m'
        )
    return ' or '.join(intervals)


def _worst(closure: Closure | SpaceClosure) -> str:
    """Return the smallest transmission angle of all dyads, or the worst conditioning."""
    if len(closure.linkage.inputs) > 1 or isinstance(closure, SpaceClosure):
        return ''
    sweep = InputSweep(closure)
    angles = transmission_angles(sweep)
    if angles:
        group, extremes = min(angles.items(), key=lambda item: item[1].lowest.value)
        text = f'Least transmission angle: {angle_text(extremes.lowest.value, 1)}'
    else:
        group, extremes = min(
            conditioning_curves(sweep).items(), key=lambda item: item[1].lowest.value
        )
        text = f'Worst conditioning: {extremes.lowest.value:.3f}'
    links = ', '.join(links_of(closure.structure.groups[group]))
    at = extremes.lowest.at
    if not at:
        return f'{text}, everywhere'
    places = [
        angle_text(value, 1) if sweep.turning else f'{fixed_text(value, 4)} m' for value in at
    ]
    return f'{text} ({links}) at {", ".join(places)}'


if __name__ == '__main__':
    sys.exit(main())
