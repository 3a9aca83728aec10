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

"""
Bags that an earlier version has recorded replay to the same bytes.

They were recorded on 22 November 2026, before linkages were compiled: all shipped linkages with
one input and a closed form, through their ranges and a little beyond; forces, friction and play;
a torque drive; a cylinder behind a delay.
"""

from __future__ import annotations

from hashlib import sha256
import math
from pathlib import Path
import subprocess
import sys

import pytest

FOLDER = Path(__file__).parent / 'recorded'

RECORDED_BY = 'e67be17d07eb4374'
"""What the functions of the machine that recorded them come to; others have other last digits."""


def functions_of_this_machine() -> str:
    """Return what sine, cosine and arc tangent come to at many places."""
    places = [0.001 * i - 5.0 for i in range(10_000)]
    values = [f(x).hex() for f in (math.sin, math.cos, math.atan) for x in places]
    return sha256(''.join(values).encode()).hexdigest()[:16]


@pytest.mark.skipif(functions_of_this_machine() != RECORDED_BY, reason='another C library')
@pytest.mark.parametrize('name', sorted(path.stem for path in FOLDER.glob('*.mcap')))
def test_an_old_bag_replays_to_the_same_bytes(name: str) -> None:
    done = subprocess.run(
        [sys.executable, '-m', 'linkage_ros.cli.main', 'replay', str(FOLDER / f'{name}.mcap')],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    (row,) = [
        line.split() for line in done.stdout.splitlines() if line.startswith('/joint_states')
    ]
    recorded, same = map(int, row[1:3])
    assert recorded == same > 30
