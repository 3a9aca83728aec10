# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
What a program sets before it imports anything else: it imports this first.

SIGINT ends it without a word until it handles signals: Python's own handler shows a traceback of
whatever import is going on. OpenBLAS takes one thread, unless its user wants more: for matrices of
some ten rows its threads wait for each other, which costs a program in space a tenth of its time,
and a node the core that its ticks need.
"""

import os
import signal

signal.signal(signal.SIGINT, signal.SIG_DFL)
os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
