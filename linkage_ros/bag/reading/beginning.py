# Copyright 2026 The linkage_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.


"""Whether a bag holds its run from the beginning: without it, what was remembered is missing."""

from __future__ import annotations

import re

from linkage_ros.bag.account import counts_in
from linkage_ros.bag.reading.reader import Bag
from linkage_ros.bag.reading.run_events import MID_RUN, RunAccount

_NUMBER = re.compile(r'_([0-9]{1,9})\.mcap$')


def lost_beginning(bag: Bag, run: RunAccount) -> str:
    """
    Return in words why the first messages of a run are not in its bag; '' where they are.

    Parameters
    ----------
    bag
        The bag.
    run
        What the run says of itself in it.

    """
    let_go = sum(counts_in(bag.custom, 'let_go').values())
    if let_go:
        return f'its first {let_go} messages have made way for newer ones'
    if run.begun == MID_RUN:
        return 'begun in mid-run'
    first = bag.files[0].name
    number = _NUMBER.search(first)
    if number and int(number[1]):
        return f'begins with {first}, which is not the first file of its recording'
    return ''
