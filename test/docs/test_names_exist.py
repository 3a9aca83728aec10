# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What stands in backticks in pages and docstrings exists: commands, options, names."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
import re

from linkage_ros.cli import COMMANDS, find_command, parser_of
from linkage_ros.cli.main import top_parser
import pytest

from .blocks import blocks, PAGES, ROOT

WORKSHOP = sorted(file for name in ('campaigns', 'bench') for file in (ROOT / name).rglob('*.py'))
SOURCES = sorted((ROOT / 'linkage_ros').rglob('*.py'))
MODULES = {file.stem for file in SOURCES}

NOT_OURS = {
    'shells, Linux, Docker': 'grep LD_PRELOAD VmRSS awk compinit isolcpus sched_rt_runtime_us '
    'sh rst --cap-add --ulimit',
    'ROS and its middleware': 'FollowJointTrajectory SharedMemGlobal hpp current_state_monitor '
    'cpp healthy_check_timeout_ms configure joint_state_topic_hardware_interface ros_gz_bridge '
    'loop_closure_relay trigger_joint_command_threshold SUBNET --clock --packages-select '
    'RRBotTransmissionsSystemPositionOnlyHardware',
    'Gazebo and MuJoCo': 'actuatorfrc jointvel nsample precision stddev zoh bias_mean bias_stddev '
    'dynamic_bias_correlation_time dynamic_bias_stddev',
    'FMI': 'canGetAndSetFMUState fatal fmi3Discard fmi3Error fmi3Fatal fmi3GetFloat32 fmi3OK',
    'Python packages': 'fusion jit grad jax_enable_x64 record_size_limit safe_load vmap '
    'validate_crcs --host',
    'made from the names of a user': 'acceleration_valid effort_valid velocity_valid my_effect '
    'my_package left_ground right_ linkage_1 four_bar_motion four_bar_velocity leg1_x leg1_y '
    'guide_joint finger_joint',
    'ends of keys': '_hz _m _us',
}
"""Words that others have defined."""

PLACEHOLDER = re.compile('[A-Z]{2,}')
"""Stands for a name in what a user writes: INPUT, NAME_0, SLIDER_on_LINK."""

TOKEN = re.compile(
    r"""(?:\"{3}.*?\"{3}|'{3}.*?'{3}|\#[^\n]*)"""  # Docstrings, templates of text and comments
    r"""|'((?:\\.|[^'\\\n])*)'|"((?:\\.|[^"\\\n])*)"|\b([^\W\d]\w*)""",
    re.DOTALL,
)
"""A text that names nothing, or one in single quotes, one in double quotes, an identifier."""

FENCED = re.compile(r'^( *)(```|:::).*?^\1\2', re.MULTILINE | re.DOTALL)


@cache
def names_of_the_code() -> frozenset[str]:
    """Return the names in code and stubs: identifiers, modules, and texts of one word."""
    names: set[str] = set()
    for file in [*SOURCES, *(ROOT / 'linkage_ros').rglob('*.pyi')]:
        text = file.read_text('utf-8')
        names |= {file.stem, file.parent.name}
        for single, double, name in {*TOKEN.findall(text)}:
            if name:
                names.add(name)
            elif ' ' not in single + double:
                names.update(re.findall(r'\w+', single + double))
    return frozenset(names | {*re.findall(r'[\w.]+', ' '.join(NOT_OURS.values()))})


@cache
def words_of_the_project() -> frozenset[str]:
    """Return the names of the code, and all words of what else is run or read."""
    files = [ROOT / name for name in ('setup.py', 'Makefile', 'pyproject.toml', 'package.xml')]
    files += [*WORKSHOP, *SOURCES]
    for folder in ('config', 'launch', 'examples', 'requirements'):
        files += [
            file
            for file in (ROOT / folder).rglob('*')
            if file.suffix in {'.yaml', '.py', '.json', '.urdf', '.txt'}
        ]
    words = {word for file in files for word in re.findall(r'\w+', file.read_text('utf-8'))}
    return names_of_the_code() | words | {file.stem for file in files}


@cache
def options() -> frozenset[str]:
    """Return the options of all commands, of campaigns and benches, and those of others."""
    parsers = [top_parser(), *(parser_of(name, find_command(name)) for name in COMMANDS)]
    found = {
        option
        for parser in parsers
        for action in parser._actions
        for option in action.option_strings
    }
    for file in WORKSHOP:
        found.update(re.findall(r"'(--[\w-]+)'", file.read_text('utf-8')))
    return frozenset(found | {*' '.join(NOT_OURS.values()).split()})


@cache
def words_of_blocks(page: str) -> frozenset[str]:
    """Return the words of a page's own blocks, which define what its text is about."""
    file = ROOT / page.partition(':')[0]
    return (
        frozenset(word for block in blocks(file) for word in re.findall(r'\w+', block.text))
        if file.suffix == '.md'
        else frozenset()
    )


def in_backticks() -> Iterator[tuple[str, str]]:
    """Yield place and text of all that stands in backticks: of pages, docstrings and comments."""
    for page in PAGES:
        text = FENCED.sub('', page.read_text('utf-8'))
        for found in re.finditer(r'(?<!`)`([^`\n]+)`(?!`)', text):
            yield page.relative_to(ROOT).as_posix(), found[1]
    for file in SOURCES:
        for number, line in enumerate(file.read_text('utf-8').splitlines(), 1):
            for found in re.finditer(r'(`{1,2})([^`]+)\1', line):
                yield f'{file.relative_to(ROOT).as_posix()}:{number}', found[2]


def misses_a_module(text: str) -> str:
    """Return a dotted name whose last part is a module, but not in what stands before; or ''."""
    before, _, last = text.rpartition('.')
    if not before or before[0].isupper() or last not in MODULES:
        return ''
    inside = re.compile(rf'^\s*(def|class) {last}\b', re.MULTILINE)
    found = any(
        f'.{file.relative_to(ROOT).with_suffix("")}'.replace('/', '.').endswith(f'.{text}')
        for file in SOURCES
    ) or any(inside.search(file.read_text('utf-8')) for file in SOURCES if file.stem == before)
    return '' if found else text


def unknown_in(where: str, text: str) -> Iterator[str]:
    """Yield what a text in backticks names and is not there."""
    for option in re.findall(r'(?<![\w-])--[a-z][\w-]*', text):
        if option not in options():
            yield option
    for command in re.findall(r'^linkage ([a-z]\w*)', text):
        if command not in COMMANDS:
            yield f'linkage {command}'
    if not re.fullmatch(r'[A-Za-z_][\w.]*(\(\))?', text):
        return
    if '.py:' in where and (wrong := misses_a_module(text)):
        yield wrong
        return
    known = names_of_the_code() if '.py:' in where else words_of_the_project()
    for word in re.findall(r'\w+', text):
        if not (word in known or word in words_of_blocks(where) or PLACEHOLDER.search(word)):
            yield word


def test_names_in_backticks_exist() -> None:
    unknown = [
        f'{where}: {word}' for where, text in in_backticks() for word in unknown_in(where, text)
    ]
    assert unknown == []


@pytest.mark.parametrize(
    'text',
    [
        'linkage cost demo',
        '--sweeep',
        'files.linkage_rewriting',
        'Nearness',
        'is_nearness()',
    ],
)
def test_stale_names_are_found(text: str) -> None:
    assert [*unknown_in('linkage_ros/errors.py:1', text)]
