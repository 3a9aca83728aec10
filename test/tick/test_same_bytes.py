# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Two runs of one scene, in processes of their own, give identical bytes: every shipped scene."""

import os
from pathlib import Path
import subprocess
import sys

import pytest

ROOT = Path(__file__).parents[2]
SCENES = sorted((ROOT / 'config' / 'scenes').glob('*.yaml'))

# Cranks swing and efforts push as the ticks go, in simulated time.
PROGRAM = """
import hashlib, sys
from math import cos, sin
from linkage_ros.messages.joint_state import JointStateWriter
from linkage_ros.tick.pipeline import Pipeline
from linkage_ros.description.scene_file import load_scene
scene = load_scene(sys.argv[1])
pipeline = Pipeline(scene)
names = [name for linkage in scene.linkages for name in linkage.input_names]
write = JointStateWriter(names).write
begin, digest, published = 1_700_000_000_000_000_000, hashlib.sha256(), 0
for number in range(3000):
    now = begin + number * 1_000_000
    if pipeline.injection is not None:
        pipeline.injection.advance(now)
    if number % 2 == 0 and pipeline.topic:
        values = ([f(0.002 * number)] * len(names) for f in (sin, cos, cos))
        pipeline.offer(write(now, *values), now)
    tick = pipeline.tick(now)
    for message in (tick.message, *tick.extras):
        digest.update(message)
    published += bool(tick.message)
print(published, digest.hexdigest())
"""


def run(scene, hash_seed):
    done = subprocess.run(
        [sys.executable, '-c', PROGRAM, str(scene)],
        cwd=ROOT,
        env=os.environ | {'PYTHONPATH': str(ROOT), 'PYTHONHASHSEED': hash_seed},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    published, digest = done.stdout.split()
    return int(published), digest


@pytest.mark.sample(1)
@pytest.mark.parametrize('scene', SCENES, ids=lambda scene: scene.stem)
def test_two_processes_publish_the_same_bytes(scene):
    published, digest = run(scene, '1')
    assert published > 100
    assert run(scene, '2') == (published, digest)
