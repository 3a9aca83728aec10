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


"""The reference of the command line, from the parsers of its commands."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from importlib import import_module
from inspect import cleandoc

from linkage_ros.cli.main import COMMANDS, module_of

from docs.website.markdown import code, plain, table


def commands() -> str:
    """Return all commands: what each does, its usage and its options."""
    return '\n'.join(line for name in COMMANDS for line in _command(name))


def _command(name: str) -> Iterator[str]:
    module = import_module(module_of(name))
    parser = argparse.ArgumentParser(prog=f'linkage {name}', description=module.__doc__)
    module.add_arguments(parser)
    yield f'## linkage {name}\n'
    yield from (f'{plain(part)}\n' for part in cleandoc(parser.description or '').split('\n\n'))
    # Of the width that a page shows in one piece; a terminal has its own.
    parser.formatter_class = _narrow
    yield f'```text\n{parser.format_usage().strip()}\n```\n'
    for group in parser._action_groups:  # noqa: SLF001 (argparse has no other way)
        rows = [
            (_typed(action), plain(_said(parser, action)))
            for action in group._group_actions  # noqa: SLF001
            if not isinstance(action, argparse._HelpAction)  # noqa: SLF001
        ]
        if rows:
            yield table((plain(group.title or '').capitalize(), ''), rows)
    if parser.epilog:
        yield f'{plain(parser.epilog)}\n'


def _narrow(prog: str) -> argparse.HelpFormatter:
    return argparse.HelpFormatter(prog, width=88)


def _typed(action: argparse.Action) -> str:
    """Return what one types for an argument."""
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


def _said(parser: argparse.ArgumentParser, action: argparse.Action) -> str:
    formatter = parser._get_formatter()  # noqa: SLF001 (as above)
    return formatter._expand_help(action) if action.help else ''  # noqa: SLF001
