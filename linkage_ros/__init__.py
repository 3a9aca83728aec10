# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Planar linkages for ROS 2: crank angle in, dependent joints out, run logged.

What stands here is the public API. None of it needs ROS.

Load a linkage, by the path of its file or by the name of one that comes with the package, and
close its loops at a value of its input. Angles are in [rad], lengths in [m]:

>>> import linkage_ros as lr
>>> closure = lr.load('four_bar')
>>> closure
<Closure four_bar: 1 input, 2 joints>
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

A scene adds what drives the linkage, and what its sensors make of it; `Pipeline` ticks it. Times
are whole nanoseconds, and a message is what the node would publish:

>>> pipeline = lr.Pipeline(lr.load_scene('two_fingers'))
>>> len(pipeline.tick(0).message)
280

Design a four-bar whose rocker follows a function of the crank:

>>> from math import radians
>>> crank, rocker = (radians(45), radians(105)), (radians(135), radians(225))
>>> design = lr.generate_function('log10(x)', (1, 2), crank, rocker)
>>> lr.Closure(design.four_bar.linkage(), 'logarithm')
<Closure logarithm: 1 input, 2 joints>
"""

from __future__ import annotations

from importlib import import_module
import sys
from typing import Any

__version__ = '0.1.0'

# A name is imported when it is used, so that nothing else is; type checkers read __init__.pyi.
_HOMES = {
    'linkage_ros.bag.reader': 'Bag BagMessage read_bag',
    'linkage_ros.tools.drawing.svg_picture': 'svg',
    'linkage_ros.errors': 'BagError DefinitionError FileError LinkageError SynthesisError',
    'linkage_ros.description.linkage_file': 'load',
    'linkage_ros.kinematics.batch': 'Batch',
    'linkage_ros.kinematics.closure': 'Closure',
    'linkage_ros.kinematics.inverse_closure': 'InverseClosure',
    'linkage_ros.kinematics.linkage': (
        'Input Limits Linkage Mass Ratio RevoluteJoint SlideJoint Slider'
    ),
    'linkage_ros.kinematics.results': 'Acceleration InputRange Position Velocity',
    'linkage_ros.kinematics.status': 'Status',
    'linkage_ros.messages.joint_state': 'JointStateReader Rejection',
    'linkage_ros.tick.pipeline': 'Pipeline Tick',
    'linkage_ros.replay.replay': 'recorded_scene',
    'linkage_ros.resources': 'linkage_names scene_names',
    'linkage_ros.description.scene_file': 'load_scene',
    'linkage_ros.description.scene': 'Scene',
    'linkage_ros.tools.design.defects': 'assess Assessment',
    'linkage_ros.tools.design.design': 'Design',
    'linkage_ros.tools.design.function.task': 'generate_function',
    'linkage_ros.tools.design.motion': 'from_fixed_pivots from_moving_pivots Pose',
    'linkage_ros.tools.design.path.curves': 'PathTask',
    'linkage_ros.tools.design.path.generate': 'generate_path',
    'linkage_ros.tools.view.linkage_page': 'LinkagePage',
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names.split()}

__all__ = [*_HOME_OF]  # noqa: PLE0604 (they are strings)


def __getattr__(name: str) -> Any:
    if name not in _HOME_OF:
        message = f'module {__name__!r} has no attribute {name!r}'
        raise AttributeError(message, name=name, obj=sys.modules[__name__])
    value = globals()[name] = getattr(import_module(_HOME_OF[name]), name)
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
