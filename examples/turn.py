# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Print the joint angles of Jansen's leg over a turn of its crank."""

from math import degrees, tau

import linkage_ros as lr

closure = lr.load('jansen_leg')
print('crank', *closure.joint_names)
for step in range(12):
    angle = tau * step / 12
    position = closure.position(angle)
    print(f'{degrees(angle):5.0f}', *(f'{degrees(value):.2f}' for value in position.values()))
