# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Solve a turn of the crank at once, and write joints, rates and accelerations as CSV."""

import linkage_ros as lr
import numpy as np

closure = lr.load('four_bar')
crank = np.linspace(0.0, 2 * np.pi, 361)
batch = closure.solve(crank, rates=3.0)
(open_states,) = np.nonzero(np.isnan(batch.positions).any(axis=0))
print(f'{len(crank)} states, {len(open_states)} of them open')
columns = ['crank_joint [rad]']
for unit in ('rad', 'rad/s', 'rad/s^2'):
    columns += [f'{joint} [{unit}]' for joint in closure.joint_names]
table = np.vstack((crank, batch.positions, batch.velocities, batch.accelerations)).T
np.savetxt('four_bar.csv', table, delimiter=',', header=','.join(columns), comments='')
print('four_bar.csv')
