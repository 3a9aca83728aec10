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


"""A bag's account of itself, held against what it holds."""

from __future__ import annotations

from collections import Counter
import json
from pathlib import Path

from linkage_ros.bag.reader import read_bag
from linkage_ros.bag.recording_stats import STATS_RECORD
from linkage_ros.errors import BagError
from mcap.reader import make_reader

Account = dict[str, dict[str, int]]


def account_of(folder: Path) -> Account:
    """Return what the bag's last file says of each topic: received, recorded, dropped, let go."""
    with read_bag(folder).files[-1].open('rb') as stream:
        said = {record.name: record.metadata for record in make_reader(stream).iter_metadata()}
    return {word: json.loads(text) for word, text in said.get(STATS_RECORD, {}).items()}


def shortcomings(folder: Path) -> list[str]:
    """Return what does not add up in a bag, or is not there."""
    try:
        bag = read_bag(folder)
        counts = Counter(message.topic for message in bag.messages())
        account = account_of(folder)
    except BagError as error:
        return [str(error)]
    if not account:
        return ['the bag has no account']
    found = []
    for topic, received in account['received'].items():
        kept = account['recorded'][topic]
        if kept != counts[topic]:
            found.append(f'{topic}: {kept} recorded by the account, {counts[topic]} in the bag')
        if received != kept + account['dropped'][topic] + account['let_go'][topic]:
            found.append(f'{topic}: the account does not close')
        if account['dropped'][topic]:
            found.append(f'{topic}: {account["dropped"][topic]} dropped')
    return found
