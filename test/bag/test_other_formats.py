# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Bags as others keep them: files packed by rosbag2, bags of SQLite and of ROS 1."""

from pathlib import Path
import sqlite3

from linkage_ros.bag import BagWriter, MOST_UNPACKED, read_bag, Topic
from linkage_ros.errors import BagError
import pytest
import yaml
import zstandard

from ..support.commands import linkage

# Each command that takes a bag, with what it needs besides.
COMMANDS = {
    'info': [],
    'replay': [],
    'plot': ['-o', 'new.png'],
    'report': ['-o', 'new.html'],
    'export': ['-o', 'new.csv'],
    'recover': ['-o', 'new'],
    'animate': ['-o', 'new.gif'],
    'view': ['-o', 'new.html'],
}

INFORMATION = 'rosbag2_bagfile_information'


@pytest.fixture(scope='module')
def plain(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp('bags') / 'plain'
    writer = BagWriter(folder, [Topic('/t', 'std_msgs/msg/Empty', '', '')])
    for index in range(1000):
        writer.write(0, index, index, b'\0\1\0\0\0')
    writer.close()
    return folder


def packed(plain: Path, folder: Path) -> Path:
    """Pack the file of a bag as rosbag2 does with ``compression_mode: file``."""
    folder.mkdir()
    (name,) = (file.name for file in plain.glob('*.mcap'))
    content = zstandard.ZstdCompressor().compress((plain / name).read_bytes())
    (folder / f'{name}.zstd').write_bytes(content)
    metadata = yaml.safe_load((plain / 'metadata.yaml').read_text())
    information = metadata[INFORMATION]
    information |= {
        'compression_format': 'zstd',
        'compression_mode': 'FILE',
        'relative_file_paths': [f'{name}.zstd'],
    }
    for file in information['files']:
        file['path'] = f'{name}.zstd'
    (folder / 'metadata.yaml').write_text(yaml.safe_dump(metadata))
    return folder


@pytest.mark.parametrize('given', ['folder', 'folder without metadata', 'file'])
def test_packed_file_is_read_as_the_plain_one(tmp_path, plain, given) -> None:
    folder = packed(plain, tmp_path / 'packed')
    if given == 'folder without metadata':
        (folder / 'metadata.yaml').unlink()
    path = next(folder.glob('*.zstd')) if given == 'file' else folder
    assert list(read_bag(path).messages()) == list(read_bag(plain).messages())


def test_commands_read_a_packed_bag_without_leftover_files(tmp_path, plain) -> None:
    folder = packed(plain, tmp_path / 'packed')
    temporary = tmp_path / 'temporary'
    temporary.mkdir()
    for command in ('info', 'export', 'recover'):
        more = ['--topic', '/t'] if command == 'export' else []
        done = linkage(
            tmp_path,
            *(command, str(folder), *COMMANDS[command], *more),
            TMPDIR=str(temporary),
        )
        assert done.returncode in (0, 2), done.stderr
        assert 'Traceback' not in done.stderr
        assert not list(temporary.iterdir())
    saved = list(read_bag(tmp_path / 'new').messages())
    assert saved == list(read_bag(plain).messages())


def test_packed_bomb_is_refused(tmp_path) -> None:
    bomb = tmp_path / 'bomb.mcap.zstd'
    packer = zstandard.ZstdCompressor(level=3).compressobj()
    with bomb.open('wb') as stream:
        for _ in range(2 * MOST_UNPACKED // 2**20):
            stream.write(packer.compress(bytes(2**20)))
        stream.write(packer.flush())
    with pytest.raises(BagError, match='no recording packs as densely'):
        read_bag(bomb)


@pytest.mark.parametrize('content', [b'', b'\x28\xb5\x2f\xfd', b'\x28\xb5\x2f\xfd' + b'\xff' * 99])
def test_broken_packed_file_raises_a_bag_error(tmp_path, content) -> None:
    file = tmp_path / 'x.mcap.zstd'
    file.write_bytes(content)
    with pytest.raises(BagError, match=r'x\.mcap'):
        read_bag(file)


def others(folder: Path) -> dict[str, Path]:
    """Make bags of other formats."""
    sqlite = folder / 'sqlite'
    sqlite.mkdir(parents=True)
    file = sqlite / 'sqlite_0.db3'
    with sqlite3.connect(file) as base:
        base.execute('create table messages(id integer primary key, data blob)')
    base.close()
    information = {
        'version': 5,
        'storage_identifier': 'sqlite3',
        'relative_file_paths': ['sqlite_0.db3'],
    }
    (sqlite / 'metadata.yaml').write_text(yaml.safe_dump({INFORMATION: information}))
    bare = folder / 'bare'
    bare.mkdir()
    (bare / 'x.db3').write_bytes(file.read_bytes())
    packed = folder / 'x.db3.zstd'
    packed.write_bytes(zstandard.ZstdCompressor().compress(file.read_bytes()))
    ros = folder / 'x.bag'
    ros.write_bytes(b'#ROSBAG V2.0\n' + bytes(4096))
    return {
        'folder': sqlite,
        'without metadata': bare,
        'file': file,
        'packed': packed,
        'ROS 1': ros,
    }


@pytest.mark.sample(3)
@pytest.mark.parametrize('command', COMMANDS)
@pytest.mark.parametrize('kind', ['folder', 'without metadata', 'file', 'packed', 'ROS 1'])
def test_bags_of_other_formats_are_refused_in_one_line(tmp_path, command, kind) -> None:
    bag = others(tmp_path / 'others')[kind]
    done = linkage(tmp_path, command, str(bag), *COMMANDS[command])
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert line.startswith(f'linkage {command}: ')
    assert 'ros2 bag convert' in line
    assert ('rosbags-convert' in line) == (kind == 'ROS 1')
    assert not list(tmp_path.glob('new*'))
