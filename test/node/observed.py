# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What a run's diagnostics and log say, by its counts and without a graph."""

from types import SimpleNamespace

from linkage_ros.node import make_statuses, RunState, Warnings
from linkage_ros.tick import Counts

BEGIN = 1_700_000_000_000_000_000
NO_LIMITS = {'transmission_angle': 0.0, 'conditioning': 0.0, 'toggle_distance': 0.0}


class Said(list):
    """Takes the place of a logger."""

    def warning(self, line):
        self.append(line)


def fake_loop(**known):
    """Return what takes the place of a tick loop without linkages."""
    pipeline = SimpleNamespace(linkages=[], max_age=0, wrenches=[], silent_inputs=lambda _now: {})
    known = {'newest_stamp': 0, 'missed_messages': 0, 'pipeline': pipeline, **known}
    return SimpleNamespace(failure='', injection=None, **known)


def observe(loop, counts=None, rate=1000.0, limits=NO_LIMITS, **known):
    """Return the state of a run with these counts."""
    scene = SimpleNamespace(name='s', rate=rate)
    recording = SimpleNamespace(recorder=None, snapshots=None, failure='')
    counts = counts or loop.read_counts(BEGIN)
    known = {'crank_topic': '/crank', **known}
    return RunState('node', scene, loop, counts, BEGIN, recording, limits, **known)


def nothing_counted(run):
    """Return the counts at the begin of a run."""
    return Counts(chatter=[0] * len(run.loop.pipeline.linkages))


def status_of(run, task, start=None):
    """Return the status of a task, and its values by key."""
    found = make_statuses(run, start or nothing_counted(run))
    (status,) = [each for each in found if each.name == f'node: {task}']
    return status, {pair.key: pair.value for pair in status.values}


def told(run):
    """Return the lines that the log of a run has of it."""
    lines = Said()
    Warnings(lines, nothing_counted(run)).warn_of_conditions(run, 1.0)
    return lines
