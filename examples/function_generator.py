# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Design a four-bar whose rocker follows the logarithm of the crank, and check it."""

from math import degrees, log10, radians

import linkage_ros as lr

x_range = (1.0, 2.0)
crank_range = (radians(45), radians(105))
rocker_range = (radians(135), radians(225))
design = lr.generate_function('log10(x)', x_range, crank_range, rocker_range)
print('crank, coupler, rocker, ground:', *(f'{link:.4f}' for link in design.four_bar.lengths))

closure = lr.Closure(design.four_bar.linkage(), 'logarithm')
for step in range(11):
    x = 1.0 + step / 10
    crank = crank_range[0] + (x - 1.0) * (crank_range[1] - crank_range[0])
    rocker = closure.position(crank)['rocker_joint'] % radians(360)
    y = log10(2) * (rocker - rocker_range[0]) / (rocker_range[1] - rocker_range[0])
    print(f'x {x:.1f}: rocker {degrees(rocker):.3f} deg, y {y:.5f}, log10(x) {log10(x):.5f}')
