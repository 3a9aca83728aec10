# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Write the made parts of the reference pages; ``make reference`` runs it.

A part stands between two comments on lines of their own, ``<!-- made: commands -->`` and
``<!-- end -->``. The written text is committed, so that a forge and the site show the same.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from inspect import cleandoc
from itertools import chain, zip_longest
import json
from pathlib import Path
import re
from typing import Any

from bench.report import table_lines
from linkage_ros.cli import (
    COMMANDS,
    EXIT_CODES,
    find_command,
    parser_of,
    REGISTRIES,
    Table,
    table_of,
)
from linkage_ros.description import linkage_schema, scene_schema


def table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table; the cells are Markdown."""
    return '\n'.join(table_lines(Table('', heads, [*rows]))) + '\n'


def plain(text: str) -> str:
    """Return a text escaped for Markdown, also in a table, except for code in backticks."""
    parts = re.split(r'(`[^`]+`)', ' '.join(text.split()))
    escaped = [re.sub(r'([\\`*_\[\]<>|~{}$])', r'\\\1', part) for part in parts[::2]]
    kept = [part.replace('|', '\\|') for part in parts[1::2]]
    return ''.join(chain.from_iterable(zip_longest(escaped, kept, fillvalue='')))


def code(text: str) -> str:
    """Return a text as code, also in a table; '' for no text."""
    escaped = text.replace('|', '\\|')
    return f'`{escaped}`' if text else ''


def exit_codes() -> Iterator[tuple[str, str]]:
    """Yield the exit codes of all commands and their meanings."""
    for number, text in EXIT_CODES.items():
        yield str(number), plain(text)


def commands() -> str:
    """Return all commands with description, usage and options."""
    return '\n'.join(line for name in COMMANDS for line in _command(name))


def _command(name: str) -> Iterator[str]:
    parser = parser_of(name, find_command(name))
    yield f'## linkage {name}\n'
    yield from (f'{plain(part)}\n' for part in cleandoc(parser.description or '').split('\n\n'))
    # The width of a page.
    parser.formatter_class = _narrow
    yield f'```text\n{parser.format_usage().strip()}\n```\n'
    for group in parser._action_groups:  # noqa: SLF001 (argparse has no other way)
        rows = [
            (_typed(action), plain(_help(parser, action)))
            for action in group._group_actions  # noqa: SLF001
            if not isinstance(action, argparse._HelpAction)  # noqa: SLF001
        ]
        if rows:
            yield table((plain(group.title or '').capitalize(), ''), rows)
        elif group.description:
            yield f'Example: `{group.description}`\n'


def _narrow(prog: str) -> argparse.HelpFormatter:
    return argparse.HelpFormatter(prog, width=88)


def _typed(action: argparse.Action) -> str:
    """Return an argument as the user types it."""
    if not action.option_strings:
        return code(str(action.metavar or action.dest))
    values = ''
    if action.nargs == argparse.REMAINDER:
        values = ' …'
    elif action.nargs != 0:
        choices = '|'.join(map(str, action.choices or ()))
        shown = action.metavar or choices or action.dest.upper()
        names = (shown,) if isinstance(shown, str) else shown
        values = ' ' + ' '.join(names)
    return ', '.join(code(option + values) for option in action.option_strings)


def _help(parser: argparse.ArgumentParser, action: argparse.Action) -> str:
    formatter = parser._get_formatter()  # noqa: SLF001 (as above)
    return formatter._expand_help(action) if action.help else ''  # noqa: SLF001


def parameters(kind: str) -> str:
    """Return all drives, effects or faults with their parameters."""
    return '\n'.join(part for name in REGISTRIES[kind] for part in _one(kind, name))


def _one(kind: str, name: str) -> Iterator[str]:
    parameters_ = table_of(kind, name)
    yield f'### {plain(name)}\n'
    yield f'{plain(parameters_.title.removeprefix(f"{kind} {name}: "))}\n'
    if len(parameters_.columns) == 1:
        yield 'No parameters.\n'
        return
    rows = [(code(row[0]), *map(plain, row[1:])) for row in parameters_.rows]
    yield table(parameters_.columns, rows)


_ELSEWHERE = ('drive', 'effects')
"""Keys whose keys are in the reference of parameters."""

_NAMED = 'NAME'
_HEADS = ('key', 'takes', 'default', 'meaning')


def scene_keys() -> str:
    """Return the keys of scene files."""
    return _keys(scene_schema())


def linkage_keys() -> str:
    """Return the keys of linkage files."""
    return _keys({**linkage_schema(), **linkage_schema()['else']})


def spatial_keys() -> str:
    """Return the keys of files of spatial linkages."""
    return _keys({**linkage_schema(), **linkage_schema()['then']})


def _keys(whole: Mapping[str, Any]) -> str:
    return table(_HEADS, _rows('', whole, whole))


def _rows(path: str, schema: Mapping[str, Any], whole: Mapping[str, Any]) -> Iterator[Any]:
    required = schema.get('required', ())
    for key, of in schema.get('properties', {}).items():
        if isinstance(of, dict):
            yield from _row(f'{path}{key}', of, whole, key in required)


def _row(
    key: str, schema: Mapping[str, Any], whole: Mapping[str, Any], needed: bool
) -> Iterator[Any]:
    of = _resolved(schema, whole)
    default = code(json.dumps(of['default'])) if 'default' in of else 'required' if needed else ''
    yield code(key), plain(_takes(of)), default, plain(str(of.get('description', '')))
    if key.rpartition('.')[2] in _ELSEWHERE or key.startswith('faults'):
        return
    if len(key.split('.')) > 1 and 'linkages' in key:
        return
    for part, inner in _mappings_within(of):
        found = _resolved(inner, whole)
        if 'properties' in found or part == _NAMED:
            yield from _rows(f'{key}{part and f".{part}"}.', found, whole)


def _mappings_within(of: Mapping[str, Any]) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Yield the mappings within a value: itself, one for each name, one for each item."""
    if 'properties' in of:
        yield '', of
    if isinstance(of.get('additionalProperties'), dict):
        yield _NAMED, of['additionalProperties']
    for branch in ('then', 'else'):
        inner = of.get(branch, {})
        if 'properties' in inner and 'properties' not in of:
            yield '', inner


def _resolved(schema: Mapping[str, Any], whole: Mapping[str, Any]) -> Mapping[str, Any]:
    if '$ref' in schema:
        return {**whole['$defs'][schema['$ref'].rpartition('/')[2]], **schema}
    return schema


def _number(value: float) -> str:
    """Return a number in the shortest form that is exact."""
    short = f'{value:g}'.replace('e+', 'e').replace('e0', 'e').replace('e-0', 'e-')
    return short if float(short) == value else str(value)


_WORDS = {'object': 'a mapping', 'array': 'a list', 'string': 'a text', 'boolean': 'true or false'}


def _takes(of: Mapping[str, Any]) -> str:
    """Return the description of the values of a key."""
    if 'enum' in of:
        return ' or '.join(map(str, of['enum']))
    kind = of.get('type', '')
    if kind in ('number', 'integer'):
        word = 'a whole number' if kind == 'integer' else 'a number'
        bounds = (
            (' more than', 'exclusiveMinimum'),
            (' from', 'minimum'),
            (' to', 'maximum'),
        )
        return word + ''.join(f'{text} {_number(of[key])}' for text, key in bounds if key in of)
    if not kind and 'then' in of:
        branches = (_takes(of['then']) or 'a list', _takes(of.get('else', {})))
        return ' or '.join(dict.fromkeys(filter(None, branches)))
    return _WORDS.get(kind, '')


MADE: Mapping[str, Callable[[], str]] = {
    'exit codes': lambda: table(('exit code', ''), exit_codes()),
    'commands': commands,
    'drives': lambda: parameters('drive'),
    'effects': lambda: parameters('effect'),
    'faults': lambda: parameters('fault'),
    'scene keys': scene_keys,
    'linkage keys': linkage_keys,
    'spatial linkage keys': spatial_keys,
}
"""The parts that a page can request, by name."""

_PAGES = Path(__file__).parent / 'reference'
_PART = re.compile(r'^<!-- made: ([\w ]+) -->$.*?^<!-- end -->$', re.MULTILINE | re.DOTALL)


def made_pages() -> dict[Path, str]:
    """Return the text of each page that has made parts, with these parts made anew."""
    pages = {page: page.read_text('utf-8') for page in sorted(_PAGES.glob('*.md'))}
    return {page: _PART.sub(_made, text) for page, text in pages.items() if _PART.search(text)}


def _made(part: re.Match[str]) -> str:
    name = part[1]
    return f'<!-- made: {name} -->\n\n{MADE[name]().strip()}\n\n<!-- end -->'


if __name__ == '__main__':
    for page, text in made_pages().items():
        page.write_text(text, 'utf-8')
