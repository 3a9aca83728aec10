# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Use your own effect, ``mine/dead_zone.py``, in a scene."""

from pathlib import Path

import linkage_ros as lr

Path('four_bar.yaml').write_text('four_bar: {a: 0.04, b: 0.12, c: 0.08, d: 0.1}')
Path('scene.yaml').write_text("""
linkage: four_bar.yaml
drive: {constant_rate: {rate: 1.0}}
effects: {mine.dead_zone: {width: 0.05}}
""")
pipeline = lr.Pipeline(lr.load_scene('scene.yaml'))
rocker = pipeline.closures[0].joint_names.index('rocker_joint')
for milliseconds in range(0, 1000, 100):
    (linkage,) = pipeline.tick(milliseconds * 1_000_000).states
    true = linkage.position['rocker_joint']
    print(f'{milliseconds:4} ms: true {true:.4f}, read {linkage.reading.joints[rocker]:.4f} rad')
