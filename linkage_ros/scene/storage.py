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


"""What a scene may say about how its bag is stored, beside where and under which name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from linkage_ros.bag.storage import COMPRESSIONS, Storage
from linkage_ros.parameters import choice, number, whole
from linkage_ros.scene.read import read_parameters
from linkage_ros.scene.section import Section

SPLITS = {'split_bytes': 1_000_000, 'split_seconds': 1.0}
"""
What makes files of a bag, and the least that it may be where it is not 0.

Each file begins with the scene, the linkages and the types, and costs the disk some ten waits.
"""

LEASTS: Mapping[str, float] = {**SPLITS, 'snapshot_seconds': 0.1}
"""What may be 0, for never, and else has to be so much at least."""

AS_THE_RUN_GOES = ('queue', 'flush_period', *SPLITS, 'keep_files')
"""What has no meaning where a run is kept in memory, and written in one go."""

_DEFAULT = Storage()


@dataclass(frozen=True, slots=True)
class StorageParameters(Storage):
    """How the bag is stored."""

    flush_period: float = number(
        'what a power cut may cost: the disk is waited for a little more often',
        _DEFAULT.flush_period,
        unit='s',
        least=0.05,
        most=60.0,
    )
    split_bytes: int = whole(
        'size at which the next file begins; 0: never',
        _DEFAULT.split_bytes,
        unit='bytes',
        least=0,
        most=10**15,
    )
    split_seconds: float = number(
        'time after which the next file begins; 0: never',
        _DEFAULT.split_seconds,
        unit='s',
        least=0.0,
        most=1e9,
    )
    keep_files: int = whole(
        'how many files are kept: the oldest goes when one more begins; 0: all',
        _DEFAULT.keep_files,
        least=0,
        most=1_000_000,
    )
    min_free_bytes: int = whole(
        'what stays free on the disk: where less is, the recording ends; 0: no matter',
        _DEFAULT.min_free_bytes,
        unit='bytes',
        least=0,
        most=10**15,
    )
    compression: str = choice('how messages are packed', COMPRESSIONS, _DEFAULT.compression)
    snapshot_seconds: float = number(
        'no bag as the run goes: the last so many seconds are kept in memory, and written when '
        '~/snapshot asks for them; 0: off',
        _DEFAULT.snapshot_seconds,
        unit='s',
        least=0.0,
        most=86_400.0,
    )
    snapshot_bytes: int = whole(
        'how much memory that may take: where it is too little, less than snapshot_seconds is '
        'kept; twice as much while a snapshot is written',
        _DEFAULT.snapshot_bytes,
        unit='bytes',
        least=1_000_000,
        most=10**12,
    )


def read_storage(content: Section) -> StorageParameters:
    """Read how a bag is stored out of the section that says how a run is recorded."""
    storage: StorageParameters = read_parameters(content, StorageParameters, {})
    for key, least in LEASTS.items():
        value = getattr(storage, key)
        if 0 < value < least:
            raise content.error(key, f'{value:g} is too small', f'write {least:.9g} or more, or 0')
    if storage.snapshot_seconds:
        _refuse_what_is_for_a_run(content)
    elif 'snapshot_bytes' in content:
        raise content.error(
            'snapshot_bytes', 'nothing is kept in memory', 'write snapshot_seconds too'
        )
    if storage.keep_files and not any(getattr(storage, key) for key in SPLITS):
        raise content.error(
            'keep_files', 'there is one file only', f'write {" or ".join(SPLITS)} too'
        )
    return storage


def _refuse_what_is_for_a_run(content: Section) -> None:
    """Raise FileError for a key that a snapshot has no use for; one that is 0 says nothing."""
    for key in AS_THE_RUN_GOES:
        if content.mapping.get(key, 0) != 0:
            raise content.error(
                key,
                'is for a bag that is written as the run goes, and snapshot_seconds keeps the run '
                'in memory',
                'leave one of the two out',
            )
