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


"""`is_in_use`: asked of the system, while somebody holds the file and after."""

from __future__ import annotations

import subprocess
import sys

from linkage_ros.bag.reader import is_in_use
import pytest

WRITES = 'import sys; stream = open(sys.argv[1], "ab"); print(flush=True); sys.stdin.read()'


def test_it_is_while_another_process_holds_it_open(tmp_path):
    file = tmp_path / 'run.mcap'
    file.write_bytes(b'some')
    with subprocess.Popen(
        [sys.executable, '-c', WRITES, str(file)], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as process:
        process.stdout.readline()
        if not is_in_use(file):
            pytest.skip('this file system grants leases to anybody')
        process.stdin.close()
    assert not is_in_use(file)
    assert file.read_bytes() == b'some'


def test_who_reads_is_no_writer(tmp_path):
    file = tmp_path / 'run.mcap'
    file.write_bytes(b'some')
    with file.open('rb'):
        assert not is_in_use(file)


def test_what_cannot_be_known_is_no_writer(tmp_path):
    assert not is_in_use(tmp_path / 'missing')
    assert not is_in_use(tmp_path)
