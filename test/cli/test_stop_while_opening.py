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


"""Ctrl-C is heeded while a bag is opened whose end is missing, and which is searched for it."""

from __future__ import annotations

from contextlib import suppress
from io import BytesIO
from pathlib import Path
import signal
import subprocess
import sys
import time

from mcap.writer import CompressionType, Writer
import pytest

from .conftest import environment

SIZE = 50_000_000
MESSAGES = 30_000  # in a chunk

# What is typed beside the bag, and what the command says when it was stopped.
COMMANDS = {
    'info': ([], 'linkage info: stopped\n'),
    'replay': ([], 'linkage replay: stopped\n'),
    'play': ([], 'linkage play: stopped\n'),
    'plot': ([], 'linkage plot: stopped\n'),
    'report': (['-o', 'x.html'], 'linkage report: stopped\n'),
    'export': (['-o', 'x.csv'], 'linkage export: stopped; nothing was written\n'),
}


@pytest.fixture(scope='module')
def large(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return 50 MB of a recording that was killed: 1,300 million small messages, packed."""
    stream = BytesIO()
    writer = Writer(stream, chunk_size=2**24, compression=CompressionType.ZSTD)
    writer.start(profile='ros2')
    schema = writer.register_schema('std_msgs/msg/Empty', 'ros2msg', b'')
    channel = writer.register_channel('/t', 'cdr', schema)

    def chunk() -> None:
        for number in range(MESSAGES):
            writer.add_message(channel, 1, b'\0\1\0\0', 1, number)
        writer.flush()

    chunk()
    begin = stream.getvalue()
    chunk()
    again = stream.getvalue().removeprefix(begin)
    file = tmp_path_factory.mktemp('large') / 'large.mcap'
    with file.open('wb') as out:
        out.write(begin)
        for _ in range(SIZE // len(again)):
            out.write(again)
    return file


@pytest.mark.parametrize('command', COMMANDS)
def test_a_signal_is_heeded_while_a_bag_is_searched(tmp_path, large, command) -> None:
    typed, said = COMMANDS[command]
    process = subprocess.Popen(
        [sys.executable, '-m', 'linkage_ros.cli.main', command, str(large), *typed],
        cwd=tmp_path,
        env=environment(tmp_path),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        wait_until_read_from(process, large)
        process.send_signal(signal.SIGINT)
        # Searched to its end it would take many minutes.
        out, err = process.communicate(timeout=60)
    finally:
        process.kill()
    assert (process.returncode, out, err) == (1, '', said)
    assert not (tmp_path / 'x.csv').exists()


def wait_until_read_from(process: subprocess.Popen[str], file: Path) -> None:
    """Wait until a process is some way into a file."""
    folder = Path(f'/proc/{process.pid}')
    while process.poll() is None:
        with suppress(OSError):  # it closes files meanwhile
            for descriptor in (folder / 'fd').iterdir():
                if descriptor.readlink() == file:
                    said = (folder / 'fdinfo' / descriptor.name).read_text()
                    if int(said.split()[1]) > 2**20:
                        return
        time.sleep(0.01)
    pytest.fail('it has ended before it was told to')
