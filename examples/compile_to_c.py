# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Compile a linkage to C with the C compiler of this machine, and call it."""

import ctypes
from pathlib import Path
import subprocess

import linkage_ros as lr
from linkage_ros.tools.models.source_code import C, Subject, write_source

closure = lr.load('four_bar')
subject = Subject(closure, 'four_bar', 'four_bar.yaml', 0, closure.joint_names)
Path('four_bar.c').write_text(write_source(subject, C('four_bar', header=False)))
compile_it = 'cc -O2 -ffp-contract=off -shared -fPIC four_bar.c -o four_bar.so -lm'
subprocess.run(compile_it.split(), check=True)

position = ctypes.CDLL('./four_bar.so').four_bar_position
inputs, joints = (ctypes.c_double * 1)(0.7), (ctypes.c_double * 2)()
print('status:', position(inputs, joints))
print('in C:     ', *joints)
print('in Python:', *closure.position(0.7).values())
