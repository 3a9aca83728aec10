# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Make the pictures, lists and tables of docs/effects.md and the pages in docs/effects.

Their text is written by hand. The text between two marks comes from the declarations in the code,
and every picture from runs of the scene next to it. Run it in the folder of the checkout, as `make
effects` does: ``python -m docs.make_effects``.
"""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
import re
import sys
from typing import NamedTuple

from bench.report import fill_marks, part_marks, table_lines
from linkage_ros.cli import parameters_of, REGISTRIES, Table, table_of
from linkage_ros.description import first_docstring_line, parameter_rows, parse_scene
from linkage_ros.dynamics import AppliedLoads
from linkage_ros.errors import FileError
from linkage_ros.stages.effects import BASES, EFFECTS, MessageEffect, needed_effects
from linkage_ros.tick import Pipeline
import yaml

DOCS = Path(__file__).resolve().parent
PAGE = DOCS / 'effects.md'
PICTURES = DOCS / 'effects'
PAGES = [
    PAGE,
    *(PICTURES / f'{name}.md' for kind in ('drive', 'effect') for name in REGISTRIES[kind]),
    PICTURES / 'faults.md',
    PICTURES / 'loads.md',
]
REFUSED = DOCS / 'refused.yaml'
LINKAGES = DOCS.parent / 'config' / 'linkages'

LARGEST = 80_000
LARGEST_SMALL = 30_000
"""Maximum sizes of a picture and of a small one, in bytes."""

_WORKS_ON = {
    'LinkageEffect': 'the linkage, once, when the scene is built',
    'DriveEffect': 'the crank, before the loops are closed',
    'MechanismEffect': 'the mechanism, once its loops are closed',
    'SensorEffect': 'the reading of the sensors',
    'MessageEffect': 'nothing: it draws the mechanism',
    'ForceEffect': 'all effects and drives that compute forces; it is not a stage of the tick',
    'clock': 'the time of a tick',
    'message': 'the messages of the crank',
    'mechanism': 'the loop, once it is closed',
}
"""The object of an effect of this base, or of a fault that has this method."""


class Section(NamedTuple):
    """A part of the page: its heading, and the text from there to the next one."""

    name: str
    text: str

    @property
    def scene(self) -> str:
        """Return the scene of the section; '' for none."""
        match = re.search(r'^```yaml\n(.*?)^```$', self.text, re.MULTILINE | re.DOTALL)
        return match.group(1) if match else ''


def main() -> int:
    """Write pages and pictures; return 1 if a picture is too large."""
    for page in PAGES:
        page.write_text(filled(page.read_text('utf-8')), 'utf-8')
    small = PICTURES / 'thumbnails'
    for old in (*PICTURES.glob('*.png'), *small.glob('*.png')):
        old.unlink()
    small.mkdir(exist_ok=True)
    drawn = _draw(text_of_pages())
    large = [(file, most) for file, most in drawn if file.stat().st_size > most]
    for file, most in large:
        sys.stderr.write(f'{file}: more than {most} bytes\n')
    return 1 if large else 0


def text_of_pages() -> str:
    """Return the text of all pages, one after the other."""
    return ''.join(page.read_text('utf-8') for page in PAGES)


def _draw(page: str) -> Iterator[tuple[Path, int]]:
    """Yield the drawn pictures, each with its maximum size."""
    # Tests check the page without matplotlib.
    from .pictures import drives, faults, markers, mechanism, paper, sensors

    modules = (drives, mechanism, sensors, markers, faults)
    draw = {name: picture for module in modules for name, picture in module.PICTURES.items()}
    for section in sections(page):
        if section.scene:
            name = section.name.lower()
            file = PICTURES / f'{name}.png'
            figure = draw[name](yaml.safe_load(section.scene))
            paper.save(figure, section.scene, file)
            yield file, LARGEST
            yield paper.save_small(figure, PICTURES / 'thumbnails' / file.name), LARGEST_SMALL


def sections(page: str) -> list[Section]:
    """Return the sections of a page, in their order."""
    parts = []
    fenced = False
    lines: list[str] = []
    for line in page.splitlines(keepends=True):
        if line.startswith('```'):
            fenced = not fenced
        if not fenced and re.match(r'#+ ', line):
            parts.append(lines)
            lines = []
        lines.append(line)
    parts.append(lines)
    return [Section(lines[0].lstrip('#').strip(), ''.join(lines)) for lines in parts if lines]


def filled(page: str) -> str:
    """Return a page with new text between all its marks."""
    kinds = {name: kind for kind, names in REGISTRIES.items() for name in names}
    parts = []
    for section in sections(page):
        text = section.text
        for mark, made in _MADE.items():
            if part_marks(mark)[0] in text:
                text = fill_marks(text, mark, made())
        if section.name in kinds:
            kind = kinds[section.name]
            text = fill_marks(text, 'place', place(kind, section.name))
            text = fill_marks(text, 'parameters', parameters(kind, section.name))
        parts.append(text)
    return ''.join(parts)


def thumbnails(kind: str) -> str:
    """Return the drives or effects as a list of pictures that lead to their pages."""
    return '\n'.join(
        f'- [![](effects/thumbnails/{name}.png) {name}](effects/{name}.md)'
        for name in REGISTRIES[kind]
    )


def order() -> str:
    """Return the effects in their order, each with its summary."""
    return '\n'.join(
        f'{number}. [{name}](effects/{name}.md): {_summary("effect", name)}'
        for number, name in enumerate(EFFECTS, 1)
    )


def place(kind: str, name: str) -> str:
    """Return the summary of a drive, an effect or a fault, and its place in the order."""
    owner = parameters_of(kind, name)
    module = import_module(owner.__module__)
    lines = [f'*{_summary(kind, name)}*', '']
    if kind == 'drive':
        topic = owner.listens_to
        listens = f'Listens to `{topic}`, sensor_msgs/msg/JointState.' if topic else ''
        lines.append(listens or 'Listens to no topic.')
    elif kind == 'fault':
        works_on = next((text for key, text in _WORKS_ON.items() if key in vars(owner)), '')
        if 'sensor' in vars(owner):
            works_on = _WORKS_ON['SensorEffect']
        lines.append(f'Works on {works_on}.')
    else:
        works_on = next(_WORKS_ON[b.__name__] for b in BASES if issubclass(owner, b))
        lines.append(f'Works on {works_on}.')
        if owner.publishes_with:
            lines.append(f'Needs {_listed(owner.publishes_with)}, published with it.')
        elif needs := needed_effects(name):
            lines.append(f'Needs {_listed(needs)}, computed but not published for it.')
        if issubclass(owner, MessageEffect):
            lines.append(f'Publishes `{owner.topic}`, {owner.message}.')
    source = Path(str(module.__file__)).relative_to(DOCS.parent).as_posix()
    lines.append(f'In [{source}](../../{source}).')
    return '\n'.join(lines)


def _summary(kind: str, name: str) -> str:
    return first_docstring_line(parameters_of(kind, name))


def _listed(names: tuple[str, ...]) -> str:
    return ', '.join(f'`{name}`' for name in names)


def parameters(kind: str, name: str) -> str:
    """Return the table of parameters of a drive, an effect or a fault."""
    table = table_of(kind, name)
    if len(table.heads) == 1:
        return 'It has no parameters.'
    rows = [(f'`{row[0]}`', *row[1:]) for row in table.rows]
    return '\n'.join(table_lines(Table('', table.heads, rows)))


def loads() -> str:
    """Return the table of parameters of the loads on joints and points."""
    heads = 'parameter', 'unit', 'default', 'values', 'meaning'
    rows = [(f'`{key}`', *more) for key, *more in parameter_rows(AppliedLoads)]
    return '\n'.join(table_lines(Table('', heads, rows)))


def refused() -> str:
    """Return the table of refused scenes with their errors."""
    scenes = yaml.safe_load(REFUSED.read_text('utf-8'))
    rows = [(each['what'], f'`{_error_of(**each)}`') for each in scenes]
    return '\n'.join(table_lines(Table('', ('scene', 'error'), rows)))


_MADE = {
    'drives': lambda: thumbnails('drive'),
    'effects': lambda: thumbnails('effect'),
    'loads': loads,
    'order': order,
    'refused': refused,
}
"""The parts of the first page that are made, by their marks."""


def _error_of(what: str, linkage: str, scene: str) -> str:
    files = {
        'scene.yaml': f'linkage: {linkage}.yaml\n{scene}'.encode(),
        'linkage.yaml': (LINKAGES / f'{linkage}.yaml').read_bytes(),
    }
    try:
        Pipeline(parse_scene('scene', 'here', files))
    except FileError as error:
        return str(error).removeprefix('here: ')
    raise AssertionError(f'{what}: is not refused')


if __name__ == '__main__':
    sys.exit(main())
