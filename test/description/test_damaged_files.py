# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Shipped files, damaged or changed at random: they run, or one line says why not."""

from copy import deepcopy
from functools import cache
from math import isfinite
from pathlib import Path
from typing import Any

from hypothesis import given, HealthCheck, settings, strategies as st
from linkage_ros.description import load_scene, parse_scene, read_linkage, read_yaml, Section
from linkage_ros.errors import FileError
from linkage_ros.kinematics import Closure, Linkage
from linkage_ros.tick import Pipeline
import pytest
import yaml

from .conftest import CONFIG, is_one_line
from ..support.sampling import sample_count

# The shipped files, damaged at random: each still runs, or is refused in one line.


@cache
def shipped() -> list[dict[str, bytes]]:
    """Return the files of all shipped scenes."""
    return [load_scene(scene).files for scene in sorted((CONFIG / 'scenes').glob('*.yaml'))]


def either_runs_or_says_why(files: dict[str, bytes]) -> None:
    refused = None
    try:
        pipeline = Pipeline(parse_scene('damaged', 'bag', files))
    except FileError as error:
        refused = error
    if refused is not None:
        assert is_one_line(refused), refused
        return
    for angle in (0.0, 1.0, -2.0, 1e9):
        for closure in pipeline.closures:
            closure.position(*[angle] * len(closure.linkage.inputs))
    pipeline.tick(1)


@given(data=st.data())
def test_scene_with_damaged_bytes_runs_or_is_refused(data):
    scene = data.draw(st.sampled_from(shipped()))
    files = {name: bytearray(file) for name, file in scene.items()}
    damaged = files[data.draw(st.sampled_from(sorted(files)))]
    for _ in range(data.draw(st.integers(1, 4))):
        place = data.draw(st.integers(0, len(damaged) - 1))
        kind = data.draw(st.sampled_from(('flip', 'cut', 'double')))
        if kind == 'flip':
            damaged[place] ^= 1 << data.draw(st.integers(0, 7))
        elif kind == 'cut':
            end = place + data.draw(st.integers(1, 20))
            del damaged[place:end]
            damaged += b'\n'
        else:
            end = place + 10
            damaged[place:place] = damaged[place:end]
    either_runs_or_says_why({name: bytes(file) for name, file in files.items()})


ODD = [
    None, True, 0, -1, 1e-300, 1e300, 10**400, float('nan'), '', 'left', 'ground', 'O2', 'B',
    'crank', [], [0, 0], [1e9, -1e9], [1e-320, 0], [True, 0], {}, {'O2': [0, 0]}, [[0]], '\0', 'é',
]  # fmt: skip


def places(content, path=()):
    """Yield the path of each key."""
    if isinstance(content, dict):
        for key, value in content.items():
            yield (*path, key)
            yield from places(value, (*path, key))


@given(data=st.data())
def test_scene_with_damaged_keys_runs_or_is_refused(data):
    scene = data.draw(st.sampled_from(shipped()))
    files = {name: yaml.safe_load(file) for name, file in scene.items()}
    damaged = files[data.draw(st.sampled_from(sorted(files)))]
    for _ in range(data.draw(st.integers(1, 3))):
        *path, key = data.draw(st.sampled_from(sorted(places(damaged), key=str) or [('x',)]))
        parent = damaged
        for part in path:
            parent = parent[part]
        kind = data.draw(st.sampled_from(('drop', 'rename', 'replace', 'swap')))
        if kind == 'replace':
            parent[key] = deepcopy(data.draw(st.sampled_from(ODD)))
        elif kind == 'swap':
            other = data.draw(st.sampled_from(list(parent) or [key]))
            parent[key], parent[other] = parent.get(other), parent.get(key)
        else:
            value = parent.pop(key, None)
            if kind == 'rename':
                parent[f'{key}_'] = value
    either_runs_or_says_why({name: yaml.safe_dump(file).encode() for name, file in files.items()})


# A damaged gallery file gives an answer, or one line; never a traceback.


FOLDER = Path(__file__).parents[2] / 'config' / 'linkages'
GALLERY = {file.stem: yaml.safe_load(file.read_text('utf-8')) for file in FOLDER.glob('*.yaml')}
Path_ = tuple[Any, ...]

NUMBERS = st.sampled_from(
    [0, 0.0, -0.0, 1, -1, 1e-12, 1e-300, 5e-324, 1e9, -1e9, 1e300, float('nan'), float('inf')]
)

WORDS = st.sampled_from(
    ['ground', 'crank', 'A', 'B', 'O2', 'left', 'right', 'ahead', 'behind', '', 'nowhere']
)

JUNK = st.one_of(NUMBERS, WORDS, st.none(), st.booleans(), st.builds(list), st.builds(dict))


def damaged_places(content: Any, path: Path_ = ()) -> list[Path_]:
    """Return the path of everything within a file."""
    found: list[Path_] = []
    items = content.items() if isinstance(content, dict) else enumerate(content)
    for key, value in items:
        found.append((*path, key))
        if isinstance(value, dict | list):
            found += damaged_places(value, (*path, key))
    return found


def at(content: Any, path: Path_) -> Any:
    for key in path:
        content = content[key]
    return content


@st.composite
def spoilt(draw: st.DrawFn) -> tuple[str, Any]:
    """Return the name of a gallery file, and what is left of it after one to three accidents."""
    name = draw(st.sampled_from(sorted(GALLERY)))
    content = deepcopy(GALLERY[name])
    for _ in range(draw(st.integers(1, 3))):
        known = damaged_places(content)
        if not known:
            break
        *above, last = path = draw(st.sampled_from(known))
        holder = at(content, tuple(above))
        accident = draw(st.sampled_from(['drop', 'junk', 'number', 'swap', 'rename', 'copy']))
        if accident == 'drop':
            del holder[last]
        elif accident == 'junk':
            holder[last] = draw(JUNK)
        elif accident == 'number':
            holder[last] = draw(NUMBERS)
        elif accident == 'rename' and isinstance(holder, dict):
            holder[draw(WORDS)] = holder.pop(last)
        elif accident == 'copy' and isinstance(holder, dict):
            holder[f'{last}_2'] = deepcopy(holder[last])
        else:
            other = draw(st.sampled_from(known))
            if other[: len(path)] != path and path[: len(other)] != other:
                first, second = deepcopy(at(content, path)), deepcopy(at(content, other))
                holder[last] = second
                at(content, other[:-1])[other[-1]] = first
    return name, content


def read(name: str, content: Any) -> Linkage | FileError:
    """Return what a file holds, or how it is refused."""
    try:
        return read_linkage(Section(f'{name}.yaml', '', content))
    except FileError as error:
        return error


@settings(
    derandomize=True,
    max_examples=sample_count(600, 100),
    suppress_health_check=list(HealthCheck),
)
@given(spoilt())
def test_damaged_linkage_file_is_solved_or_refused(case):
    name, content = case
    found = read(name, content)
    if isinstance(found, FileError):
        assert str(found).startswith(f'{name}.yaml')
        assert '\n' not in str(found)
        assert found.reason
        assert found.remedy
        return
    linkage = found
    closure = Closure(linkage)
    count = len(linkage.inputs)
    for value in (0.0, 0.3, 1.0, -2.5, 1e6):
        position = closure.position(*(value,) * count)
        assert all(map(isfinite, position.joints))
        assert isfinite(position.gap)
        assert position.gap >= 0.0
        if position.status.has_rates:
            velocity = closure.velocity(position, *(1.0,) * count)
            closure.acceleration(position, velocity, *(0.0,) * count)
            closure.residual(position)
            closure.singularity_margin(position)
        else:
            assert bool(position.joints) == position.status.has_pose


@pytest.mark.parametrize('name', sorted(GALLERY))
def test_gallery_linkage_is_valid_before_damage(name):
    read_linkage(read_yaml(FOLDER / f'{name}.yaml')[0])
