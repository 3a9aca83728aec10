# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""No message names a temporary file: who reads the message finds nothing there."""

from tempfile import gettempdir

import pytest

from ..support.commands import linkage

zstandard = pytest.importorskip('zstandard')

SCENE = 'linkage: linkage.yaml\nrate: 100\ndrive: {constant_rate: {rate: 1e-4, start: 3.0}}\n'
OPEN = 'four_bar: {a: 1.0, b: 1.0, c: 1.0, d: 2.0}'
"""It does not close at 3 rad."""


def says(folder, *words):
    """Return what a command writes, whatever its exit code; folders of tests are temporary too."""
    done = linkage(folder, *words)
    return (done.stdout + done.stderr).replace(str(folder), 'FOLDER')


def test_simulate_refuses_a_table_without_joint_states(tmp_path):
    (tmp_path / 'scene.yaml').write_text(SCENE)
    (tmp_path / 'linkage.yaml').write_text(OPEN)
    assert says(tmp_path, 'simulate', 'scene.yaml', '--seconds', '1', '-o', 'x.csv') == (
        'linkage simulate: scene.yaml: publishes no joint states in 101 ticks; name a folder by '
        '-o, and linkage info says why\n'
    )
    assert not (tmp_path / 'x.csv').exists()


def damage(kind, content):
    match kind:
        case 'cut':
            return content[: len(content) // 2]
        case 'flipped':
            changed = bytearray(content)
            changed[len(content) // 2] ^= 0xFF
            return bytes(changed)
        case 'foreign':
            return b'a text' * 100
        case _:
            return b''


@pytest.mark.parametrize('kind', ['cut', 'flipped', 'foreign', 'empty'])
def test_messages_on_a_packed_bag_name_no_temporary_file(tmp_path, kind):
    (tmp_path / 'scene.yaml').write_text(SCENE)
    (tmp_path / 'linkage.yaml').write_text('four_bar: {a: 0.04, b: 0.12, c: 0.08, d: 0.1}')
    says(tmp_path, 'simulate', 'scene.yaml', '--seconds', '3', '-o', 'run')
    content = damage(kind, (tmp_path / 'run' / 'run_0.mcap').read_bytes())
    packed = zstandard.ZstdCompressor().compress(content)
    (tmp_path / 'x.mcap.zstd').write_bytes(packed)
    told = 0
    for words in (['info'], ['replay'], ['export', '-o', 'x.csv', '--force'], ['plot', '--force']):
        text = says(tmp_path, words[0], 'x.mcap.zstd', *words[1:])
        assert gettempdir() not in text
        told += 'x.mcap.zstd: is ' in text
    assert told == (4 if kind != 'cut' else 0)
