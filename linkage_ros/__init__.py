# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Linkages for ROS 2: crank angle in, dependent joints out, run logged.

This is the public API. It does not need ROS.

Load a linkage, by the path of its file or by the name of one that comes with the package, and
close its loops at a value of its input. Angles are in [rad], lengths in [m]:

>>> import linkage_ros as lr
>>> closure = lr.load('four_bar')
>>> closure
<PlanarClosure four_bar: 1 input, 2 joints>
>>> position = closure.position(0.7)
>>> position.status
<Status.CLOSED: 'closed'>
>>> round(position['rocker_joint'], 6)
1.001032
>>> closure.joint_names
('coupler_joint', 'rocker_joint')

Points are complex numbers x + iy in the frame of the ground. Velocities start from a position,
accelerations from both:

>>> round(abs(position.points['A']), 6)
0.04
>>> velocity = closure.velocity(position, 3.0)
>>> acceleration = closure.acceleration(position, velocity, 0.0)
>>> round(velocity['rocker_joint'], 6)
0.843928

A loop that does not close is an answer, not an exception:

>>> lr.load('double_rocker').position(2.5)
<Position open by 0.0619 m>

Arrays solve many states at once; there is a row for each joint:

>>> batch = closure.solve([0.0, 0.7, 1.4], rates=3.0)
>>> batch.positions.shape
(2, 3)

A scene adds the drive of the linkage and its sensor effects; `Pipeline` ticks it. Times
are whole nanoseconds, and a message is what the node would publish:

>>> pipeline = lr.Pipeline(lr.load_scene('two_fingers'))
>>> len(pipeline.tick(0).message)
280

Design a four-bar whose rocker follows a function of the crank:

>>> from math import radians
>>> crank, rocker = (radians(45), radians(105)), (radians(135), radians(225))
>>> design = lr.generate_function('log10(x)', (1, 2), crank, rocker)
>>> lr.PlanarClosure(design.four_bar.linkage(), 'logarithm')
<PlanarClosure logarithm: 1 input, 2 joints>
"""

from linkage_ros.faces import lazy_names

__version__ = '1.0.0'

__getattr__, __dir__ = lazy_names(__name__)
