# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""What a campaign writes where nobody reads it."""

import os
from pathlib import Path
from subprocess import PIPE, run
import sys

import pytest


def test_closed_output_ends_a_campaign_without_a_traceback():
    pytest.importorskip('flint')
    reader, writer = os.pipe()
    os.close(reader)
    command = [sys.executable, '-m', 'campaigns', 'space', '--cases', '10', '--only', 'RSSR']
    root = Path(__file__).parents[2]
    found = run(command, stdout=writer, stderr=PIPE, text=True, check=False, cwd=root, timeout=60)
    os.close(writer)
    assert (found.returncode, found.stderr) == (1, '')
