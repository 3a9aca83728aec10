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


"""Kill recordings, and judge what is left."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
import json
import os
from pathlib import Path
import select
import subprocess
import sys
from tempfile import TemporaryDirectory
from time import monotonic, monotonic_ns, sleep

from campaigns.kills.judge import judge, Outcome
from campaigns.kills.marks import Marks
from campaigns.kills.plan import Phase, Plan
from campaigns.processes import results_of

_PATIENCE = 30.0
"""How long a process may take to come to what is waited for [s]."""


class KillError(Exception):
    """A recording ended without having been killed."""


def run(plans: list[Plan], jobs: int) -> Iterator[Outcome]:
    """Carry plans out, several at once; yield what came of each."""
    yield from results_of(kill, plans, jobs)


def kill(plan: Plan) -> Outcome:
    """Start a recording, kill it as planned, and judge."""
    with TemporaryDirectory(prefix='linkage_ros_kill_') as name:
        work = Path(name)
        marks = Marks.make(work / 'marks', plan.ticks)
        try:
            killed = _kill(plan, work / 'bag', work / 'marks', work / 'log')
            return judge(plan, work / 'bag', marks, killed)
        finally:
            marks.close()


def _kill(plan: Plan, folder: Path, marks: Path, log: Path) -> int:
    """Return when the process was killed, in [ns] of the steady clock."""
    hears, bell = os.pipe()
    arguments = [folder, marks, bell, plan.ticks, json.dumps(asdict(plan.storage))]
    command = [sys.executable, '-m', 'campaigns.kills.child', *map(str, arguments)]
    with log.open('wb') as errors:
        process = subprocess.Popen(
            command, cwd=Path(__file__).parents[2], pass_fds=[bell], stderr=errors
        )
    os.close(bell)
    try:
        if not _wait_for(plan, hears):
            raise KillError(f'ended by itself: {log.read_text(errors="replace").strip()}')
        sleep(plan.delay)
        killed = monotonic_ns()
        process.kill()
    finally:
        # This very process, whatever went wrong; its end is waited for before anything is judged.
        process.kill()
        process.wait()
        os.close(hears)
    return killed


def _wait_for(plan: Plan, hears: int) -> bool:
    """Wait for the phase, or for the close where it does not come; False if the process ended."""
    until = monotonic() + _PATIENCE + plan.ticks * 1e-3
    missing = plan.time
    while (left := until - monotonic()) > 0:
        if not select.select([hears], [], [], left)[0]:
            break
        heard = os.read(hears, 1)
        if not heard:
            return False
        missing -= heard[0] == plan.aim
        if not missing or heard[0] == Phase.CLOSED:
            return True
    return False
