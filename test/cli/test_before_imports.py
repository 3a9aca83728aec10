# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What a program sets before it imports anything else."""

import os
from pathlib import Path
import subprocess
import sys

import pytest

THREADS = """
import os
import linkage_ros.__main__
import numpy as np
np.linalg.svd(np.ones((60, 60)))
print(len(os.listdir('/proc/self/task')))
"""


@pytest.mark.skipif(not Path('/proc/self/task').is_dir(), reason='counts threads as Linux does')
@pytest.mark.skipif((os.cpu_count() or 1) < 2, reason='one core has one thread')
@pytest.mark.parametrize(('wanted', 'threads'), [(None, '1'), ('2', '2')])
def test_linear_algebra_has_one_thread_unless_told(wanted, threads):
    given = {name: value for name, value in os.environ.items() if name != 'OPENBLAS_NUM_THREADS'}
    told = given | ({'OPENBLAS_NUM_THREADS': wanted} if wanted else {})
    done = subprocess.run(
        [sys.executable, '-c', THREADS], env=told, capture_output=True, text=True, check=True
    )
    assert done.stdout == f'{threads}\n'
