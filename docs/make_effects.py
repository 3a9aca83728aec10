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
Make the pictures, lists and tables of docs/effects.md.

Its text is written by hand. The text between two marks comes from the declarations in the code,
and every picture from runs of the scene beside it. Run it in the checkout's own folder, as `make
effects` does: ``python -m docs.make_effects``.
"""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
import re
import sys
from typing import NamedTuple

from linkage_ros.cli.scene import REGISTRIES, table_of
from linkage_ros.effects.stage import EFFECTS, NEEDS, PUBLISHED_WITH
from linkage_ros.errors import FileError
from linkage_ros.files.parameters import summary
from linkage_ros.pages import markdown
from linkage_ros.pipeline.pipeline import Pipeline
from linkage_ros.scene.load import parse_scene
import yaml

DOCS = Path(__file__).resolve().parent
PAGE = DOCS / 'effects.md'
PICTURES = DOCS / 'effects'
REFUSED = DOCS / 'refused.yaml'
LINKAGES = DOCS.parent / 'config' / 'linkages'

LARGEST = 80_000
"""Bytes of a picture, at most."""

_STANDS = {
    'alter': 'the linkage, once, when the scene is built',
    'drive_stage': 'the crank, before the loops are closed',
    'stage': 'the mechanism, once its loops are closed',
    'sensor': 'the reading of the sensors',
    'writer': 'nothing: it draws the mechanism',
    'friction': 'all effects and drives that compute forces; it is no stage of the tick',
    'clock': 'the time of a tick',
    'message': 'the messages of the crank',
    'mechanism': 'the loop, once it is closed',
}
"""What a module works on that has this function, or whose parameters have this."""


class Section(NamedTuple):
    """
    A part of the page under a heading.

    Attributes
    ----------
    name
        The heading.
    text
        The heading's line, and all up to the next one.

    """

    name: str
    text: str

    @property
    def scene(self) -> str:
        """The scene that it shows; '' for none."""
        found = re.search(r'^```yaml\n(.*?)^```$', self.text, re.MULTILINE | re.DOTALL)
        return found.group(1) if found else ''


def main() -> int:
    """Write page and pictures; return 1 where a picture is too large."""
    page = filled(PAGE.read_text('utf-8'))
    PAGE.write_text(page, 'utf-8')
    PICTURES.mkdir(exist_ok=True)
    for old in PICTURES.iterdir():
        old.unlink()
    large = [drawn for drawn in _draw(page) if drawn.stat().st_size > LARGEST]
    for drawn in large:
        sys.stderr.write(f'{drawn}: more than {LARGEST} bytes\n')
    return 1 if large else 0


def _draw(page: str) -> Iterator[Path]:
    # The page can be checked where matplotlib is missing.
    from .pictures import drives, faults, markers, mechanism, paper, sensors

    modules = (drives, mechanism, sensors, markers, faults)
    draw = {name: picture for module in modules for name, picture in module.PICTURES.items()}
    for section in sections(page):
        if section.scene:
            name = section.name.lower()
            file = PICTURES / f'{name}.png'
            figure = draw[name](yaml.safe_load(section.scene))
            paper.save(figure, section.scene, file)
            yield file


def sections(page: str) -> list[Section]:
    """Return the parts of a page, in their order."""
    found = []
    fenced = False
    lines: list[str] = []
    for line in page.splitlines(keepends=True):
        if line.startswith('```'):
            fenced = not fenced
        if not fenced and re.match(r'#+ ', line):
            found.append(lines)
            lines = []
        lines.append(line)
    found.append(lines)
    return [Section(lines[0].lstrip('#').strip(), ''.join(lines)) for lines in found if lines]


def filled(page: str) -> str:
    """Return a page with what is made anew between all its marks."""
    kinds = {name: kind for kind, names in REGISTRIES.items() for name in names}
    parts = []
    for section in sections(page):
        text = section.text
        for mark, made in (('order', order), ('refused', refused)):
            if markdown.marks(mark)[0] in text:
                text = markdown.filled(text, mark, made())
        if section.name in kinds:
            kind = kinds[section.name]
            text = markdown.filled(text, 'place', place(kind, section.name))
            text = markdown.filled(text, 'parameters', parameters(kind, section.name))
        parts.append(text)
    return ''.join(parts)


def order() -> str:
    """Return the effects in their order, each with its summary."""
    return '\n'.join(
        f'{number}. [{name}](#{name}): {_summary("effect", name)}'
        for number, name in enumerate(EFFECTS, 1)
    )


def place(kind: str, name: str) -> str:
    """Return what a drive, an effect or a fault is, and its place."""
    module = import_module(REGISTRIES[kind][name])
    said = [f'*{_summary(kind, name)}*', '']
    works_on = next(
        (
            w
            for has, w in _STANDS.items()
            if hasattr(module, has) or hasattr(module.PARAMETERS, has)
        ),
        '',
    )
    if kind == 'drive':
        topic = getattr(module, 'TOPIC', '')
        listens = f'Listens to `{topic}`, sensor_msgs/msg/JointState.' if topic else ''
        said.append(listens or 'Listens to no topic.')
    elif kind == 'fault':
        said.append(f'Works on {works_on}.')
    else:
        said.append(f'{_neighbours(name)}. Works on {works_on}.')
        if name in NEEDS:
            said.append(f'Needs {_listed(NEEDS[name])}, computed but not published for it.')
        if name in PUBLISHED_WITH:
            said[-1] = f'Needs {_listed(PUBLISHED_WITH[name])}, published with it.'
        if hasattr(module, 'TOPIC'):
            said.append(f'Publishes `{module.TOPIC}`, {module.MESSAGE}.')
    source = Path(str(module.__file__)).relative_to(DOCS.parent).as_posix()
    said.append(f'In [{source}](../{source}).')
    return '\n'.join(said)


def _neighbours(name: str) -> str:
    names = list(EFFECTS)
    number = names.index(name)
    beside = [f'after `{names[number - 1]}`'] if number else []
    if number + 1 < len(names):
        beside.append(f'before `{names[number + 1]}`')
    return f'Number {number + 1} of {len(names)}, {" and ".join(beside)}'


def _summary(kind: str, name: str) -> str:
    return summary(import_module(REGISTRIES[kind][name]).PARAMETERS)


def _listed(names: tuple[str, ...]) -> str:
    return ', '.join(f'`{name}`' for name in names)


def parameters(kind: str, name: str) -> str:
    """Return the table of parameters of a drive, an effect or a fault."""
    _, heads, rows = table_of(kind, name)
    if len(heads) == 1:
        return 'It has no parameters.'
    return '\n'.join(markdown.table_lines(heads, [(f'`{row[0]}`', *row[1:]) for row in rows]))


def refused() -> str:
    """Return the scenes that are refused, each with its error."""
    scenes = yaml.safe_load(REFUSED.read_text('utf-8'))
    rows = [(each['what'], f'`{_said(**each)}`') for each in scenes]
    return '\n'.join(markdown.table_lines(('scene', 'error'), rows))


def _said(what: str, linkage: str, scene: str) -> str:
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
