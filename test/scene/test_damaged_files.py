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


"""The shipped files, damaged at random: what comes of them runs, or is refused with one line."""

from __future__ import annotations

from copy import deepcopy

from hypothesis import given, HealthCheck, settings
from hypothesis import strategies as st
from linkage_ros.errors import FileError
from linkage_ros.pipeline import Pipeline
from linkage_ros.scene.load import load_scene, parse_scene
import yaml

from .files import CONFIG, is_one_line

SHIPPED = [load_scene(scene).files for scene in sorted((CONFIG / 'scenes').glob('*.yaml'))]


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


@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(data=st.data())
def test_files_with_damaged_bytes_run_or_say_why_not(data):
    shipped = data.draw(st.sampled_from(SHIPPED))
    files = {name: bytearray(file) for name, file in shipped.items()}
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


@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(data=st.data())
def test_damaged_contents(data):
    shipped = data.draw(st.sampled_from(SHIPPED))
    files = {name: yaml.safe_load(file) for name, file in shipped.items()}
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
