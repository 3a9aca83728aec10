# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Tick a scene in Python, as the node does, and print what its sensors read."""

import linkage_ros as lr

pipeline = lr.Pipeline(lr.load_scene('worn_press'))
joints = pipeline.closures[0].joint_names
period = 1_000_000  # ns
for tick_number in range(5):
    tick = pipeline.tick(tick_number * period)
    (linkage,) = tick.states
    print(f'{tick_number} ms, a message of {len(tick.message)} bytes')
    for joint, reading in zip(joints, linkage.reading.joints):
        print(f'  {joint}: read {reading:.6f}, true {linkage.position[joint]:.6f}')
