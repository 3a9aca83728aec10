# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A run asks the system for real time, and says where the system refuses.

What is in force is read from the kernel, by another process.
"""

import ctypes
from functools import cache
import os
from pathlib import Path
import re
import resource
import subprocess
import sys

import pytest
from sensor_msgs.msg import JointState

from .graph import wait_for

TURNING = 'drive: {constant_rate: {rate: 1.0}}\nrate: 200'
LAST = max(os.sched_getaffinity(0))
ALL = ['-p', 'thread_priority:=42', '-p', 'lock_memory:=true', '-p', f'cpu_affinity:=[{LAST}]']
PR_CAPBSET_DROP, CAP_IPC_LOCK, CAP_SYS_NICE = 24, 14, 23
ASKS = """
import ctypes, os

REAL_STARTS = True
os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(42))
os._exit(ctypes.CDLL(None).mlockall(3) != 0)
"""


@cache
def has_rights():
    return subprocess.run([sys.executable, '-c', ASKS], check=False).returncode == 0


def without_rights():
    """Take the rights from this process and those that it starts; a user's has neither."""
    libc = ctypes.CDLL(None)
    for capability in (CAP_IPC_LOCK, CAP_SYS_NICE):
        libc.prctl(PR_CAPBSET_DROP, capability, 0, 0, 0)
    for limit, value in ((resource.RLIMIT_RTPRIO, 0), (resource.RLIMIT_MEMLOCK, 1 << 20)):
        resource.setrlimit(limit, (value, value))


def threads(process):
    """Return policy, priority and processors of each thread."""
    tids = [int(task.name) for task in Path(f'/proc/{process.pid}/task').iterdir()]
    return [
        (os.sched_getscheduler(t), os.sched_getparam(t).sched_priority, os.sched_getaffinity(t))
        for t in tids
    ]


def locked(process):
    """Return how much memory of a process stays, in [kB]."""
    lines = Path(f'/proc/{process.pid}/status').read_text().splitlines()
    return int(next(line for line in lines if line.startswith('VmLck:')).split()[1])


def in_force(graph):
    graph.next_status('tick')
    return [graph.value('tick', key) for key in ('Scheduling', 'Processors', 'Locked memory')]


def refusals(node):
    """Return the warnings that name a parameter of these; a loaded machine has others."""
    return [
        line
        for line in node.log.splitlines()
        if 'WARN' in line and re.search('thread_priority|cpu_affinity|lock_memory', line)
    ]


def test_real_time_settings_apply_to_the_tick_thread_only(graph, start, write_scene):
    if not has_rights():
        pytest.skip('this user may not ask for priority and memory')
    node = start(write_scene('asked', TURNING), *ALL)
    scheduling, processors, memory = in_force(graph)
    wanted = os.SCHED_FIFO, 42, {LAST}
    found = threads(node.process)
    assert found.count(wanted) == 1
    assert all(of == wanted or of[0] == os.SCHED_OTHER for of in found)
    assert locked(node.process) > 10_000
    assert (scheduling, processors) == ('SCHED_FIFO, priority 42', str(LAST))
    assert memory.endswith(' kB')
    assert memory != '0 kB'
    assert refusals(node) == []


def test_missing_real_time_rights_are_reported_and_run_continues(graph, start, write_scene):
    heard = graph.listen(JointState, 'joint_states')
    node = start(write_scene('refused', TURNING), *ALL, preexec_fn=without_rights)
    assert in_force(graph) == ['as others', str(LAST), '0 kB']
    wait_for(lambda: len(heard) > 50, 'joint states')
    memory, priority = refusals(node)
    assert 'lock_memory: 1024 KiB may be locked; ' in memory
    assert 'USER - memlock unlimited' in memory
    assert 'thread_priority 42: ' in priority
    assert 'USER - rtprio 99' in priority
    assert node.end() == 0


@pytest.mark.sample(2)
@pytest.mark.parametrize('asked', ['[1000]', '[-2]', f'[{LAST}, 1000]', f'[{2**40}]'])
def test_missing_processor_is_reported(graph, start, write_scene, asked):
    node = start(write_scene('processors', TURNING), '-p', f'cpu_affinity:={asked}')
    node.wait_for_log(f'cpu_affinity {asked}: ticks run on [')
    assert node.end() == 0


def test_real_time_settings_are_off_by_default(graph, start, write_scene):
    node = start(write_scene('unasked', TURNING))
    assert in_force(graph) == ['', '', '']
    assert {policy for policy, _, _ in threads(node.process)} == {os.SCHED_OTHER}
    assert locked(node.process) == 0


@pytest.mark.sample(2)
@pytest.mark.parametrize(
    'wrong', ['thread_priority:=100', 'thread_priority:=-1', 'cpu_affinity:=1', 'lock_memory:=1']
)
def test_real_time_value_out_of_bounds_is_refused(graph, start, write_scene, wrong):
    node = start(write_scene('wrong', TURNING), '-p', wrong, ready='')
    assert wait_for(lambda: node.process.poll() is not None, 'the end')
    assert node.process.returncode == 2
    (line,) = node.log.strip().splitlines()
    assert wrong.partition(':')[0] in line
