# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Print the script with which a shell completes commands, options, shipped names and files.

bash and zsh: eval "$(linkage completion bash)", in ~/.bashrc or ~/.zshrc. fish: linkage completion
fish > ~/.config/fish/completions/linkage.fish. The library argcomplete has to be installed.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
import os
from threading import Event
from typing import Any

from linkage_ros.cli.arguments import LINKAGES
from linkage_ros.cli.main import COMMANDS, find_command, Parser, parser_of
from linkage_ros.errors import check_installed
from linkage_ros.resources import linkage_names, scene_names, spatial_linkage_names

EXAMPLE = 'linkage completion bash'

SHELLS = ('bash', 'zsh', 'fish')


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument('shell', choices=SHELLS, metavar='SHELL', help='bash, zsh or fish')


def run(arguments: argparse.Namespace, _stop: Event) -> int:
    """Print the script."""
    check_installed(
        'argcomplete', "pip install 'linkage_ros[completion]', or apt install python3-argcomplete"
    )
    from argcomplete.shell_integration import shellcode

    print(shellcode(['linkage'], shell=arguments.shell))
    return 0


def complete() -> None:
    """Answer the shell, which passes its line in the environment, and end; or return."""
    try:
        from argcomplete import autocomplete
        from argcomplete.completers import ChoicesCompleter, FilesCompleter
    except ImportError:
        return
    parser = Parser(prog='linkage')
    commands = parser.add_subparsers()
    for name, text in COMMANDS.items():
        commands.add_parser(name, help=text)
    # Of the commands only the one in the line is loaded.
    named = [word for word in os.environ.get('COMP_LINE', '').split()[1:2] if word in COMMANDS]
    for name in named:
        try:
            typed = parser_of(name, find_command(name))
        except ImportError:  # the command itself says what to install
            return
        commands.choices[name] = typed
        files, yaml_files = FilesCompleter(), FilesCompleter(LINKAGES)
        completers: dict[Any, Any] = dict.fromkeys(
            ('BAG', 'CSV', 'FOLDER', 'OUTPUT', 'URDF'), files
        )
        completers |= {
            'FILE': _names_or(yaml_files, linkage_names, spatial_linkage_names),
            'SCENE': _names_or(yaml_files, scene_names, linkage_names, spatial_linkage_names),
            'NAME': _names_or(None, scene_names, linkage_names, spatial_linkage_names),
        }
        for action in typed._actions:  # noqa: SLF001 (argparse has no other way)
            if action.metavar in completers:
                action.completer = completers[action.metavar]  # type: ignore[attr-defined]
    autocomplete(parser, always_complete_options='long', default_completer=ChoicesCompleter({}))


def _names_or(files: Any, *lists: Callable[[], list[str]]) -> Callable[..., list[str]]:
    """Return a completer of shipped names, and of files if there is a completer of files."""

    def complete_name(prefix: str, **more: Any) -> list[str]:
        names = {name for names in lists for name in names() if name.startswith(prefix)}
        return [*sorted(names), *(files(prefix=prefix, **more) if files is not None else ())]

    return complete_name
