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


"""
The messages of a bag as rows of a table: one for each tick, or for each message of a topic.

A tick's joint states, motions and pin forces follow each other in the bag, with one publish time;
they make one row. Columns are found in a first reading, since a joint may turn up late; the rows
come in a second one, so that no more than a row is held.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

from linkage_ros.bag.contents import TOLD_EVERY
from linkage_ros.bag.reader import Bag
from linkage_ros.errors import BagError
from linkage_ros.messages.joint_values import FORCE_X, Key, MessageValues, QUANTITIES, Values

TIME, STAMP, PUBLISHED, LOGGED = 'time [s]', 'stamp [ns]', 'publish time [ns]', 'log time [ns]'
"""
The first columns: since the first row's stamp, the stamp of the message itself, the time that was
solved for or at which the source sent it, and the time of the tick that took or published it.
"""

_MOST_COLUMNS = 10_000
_FIRST_OF_PINS = QUANTITIES.index(FORCE_X)

Row = list[float | int | None]
Told = Callable[[int], None]


class Source(NamedTuple):
    """
    What rows are made of.

    Attributes
    ----------
    bag
        The bag.
    types
        The topics, each with its type.
    closing
        Topics whose messages end a tick.
    wanted
        Of a topic with messages of others, what tells which are of the rows.
    dependent
        Names of joints that nobody can command, as for `MessageValues`.

    """

    bag: Bag
    types: Mapping[str, str]
    closing: Collection[str]
    wanted: Mapping[str, Callable[[bytes], bool]]
    dependent: Collection[str] = ()


class Found(NamedTuple):
    """
    What the first reading finds.

    Attributes
    ----------
    keys
        The columns beyond the first four.
    rows
        How many rows there are.
    counts
        Messages of each topic that are in the rows.
    left_out
        How many messages are not, by topic and reason.

    """

    keys: tuple[Key, ...]
    rows: int
    counts: Mapping[str, int]
    left_out: Mapping[tuple[str, str], int]


class _Tick(NamedTuple):
    """The messages of a tick, by topic, and its publish and log time."""

    published: int
    logged: int
    messages: dict[str, Values]


def survey(source: Source, order: Sequence[str], told: Told) -> Found:
    """
    Read a bag for the columns of its rows.

    Parameters
    ----------
    source
        What rows are made of.
    order
        Joints that come first, in this order; others follow as they turn up.
    told
        Takes how many bytes have been read, now and then. What it raises ends the reading.

    Raises
    ------
    BagError
        Where the bag is damaged, or names ever new joints.

    """
    found: dict[Key, None] = {}
    known: set[tuple[Key, ...]] = set()
    counts: Counter[str] = Counter()
    left_out: Counter[tuple[str, str]] = Counter()
    rows = 0
    for tick in _ticks(source, left_out, told):
        rows += 1
        for topic, values in tick.messages.items():
            counts[topic] += 1
            if values.keys not in known:
                known.add(values.keys)
                found |= dict.fromkeys(values.keys)
                if max(len(found), len(known)) > _MOST_COLUMNS:
                    raise BagError(
                        source.bag.path,
                        f'its joints take more than {_MOST_COLUMNS} columns',
                        'name one topic with --topic',
                    )
    return Found(_sorted(found, order), rows, counts, left_out)


def _sorted(keys: Iterable[Key], order: Sequence[str]) -> tuple[Key, ...]:
    """Return columns in order: by quantity, then joint; of a pin, force and torque together."""
    keys = tuple(keys)
    names = dict.fromkeys([*order, *(name for name, _ in keys)])
    ranks = {name: rank for rank, name in enumerate(names)}

    def rank(key: Key) -> tuple[int, int, int]:
        name, quantity = key
        number = QUANTITIES.index(quantity)
        return min(number, _FIRST_OF_PINS), ranks[name], number

    return tuple(sorted(keys, key=rank))


def rows_of(source: Source, keys: Sequence[Key], told: Told) -> Iterator[Row]:
    """Yield the rows of a bag: the first four columns, and the numbers under these keys."""
    places = {key: 4 + number for number, key in enumerate(keys)}
    placed: dict[tuple[Key, ...], tuple[int, ...]] = {}
    blank: Row = [None] * len(keys)
    begin: int | None = None
    for published, logged, messages in _ticks(source, Counter(), told):
        stamp = next(iter(messages.values())).stamp
        if begin is None:
            begin = stamp
        row: Row = [(stamp - begin) / 1_000_000_000, stamp, published, logged, *blank]
        for values in messages.values():
            columns = placed.get(values.keys)
            if columns is None:
                columns = placed[values.keys] = tuple(places[key] for key in values.keys)
            # A motion repeats what its joint state says; it counts where that was dropped.
            for column, number in zip(columns, values.numbers, strict=True):
                if row[column] is None:
                    row[column] = number
        yield row


def _ticks(source: Source, left_out: Counter[tuple[str, str]], told: Told) -> Iterator[_Tick]:
    """Yield the ticks of a bag; count the messages that are left out."""
    readers = {
        topic: MessageValues(kind, source.dependent) for topic, kind in source.types.items()
    }
    closing, wanted = source.closing, source.wanted
    tick: _Tick | None = None
    read = 0
    for number, (topic, logged, published, data) in enumerate(source.bag.messages(), 1):
        read += len(data)
        if not number % TOLD_EVERY:
            told(read)
        reader = readers.get(topic)
        values = reader.read(data) if reader is not None else None
        if isinstance(values, str):
            left_out[topic, values] += 1
        elif values is not None and (topic not in wanted or wanted[topic](data)):
            if tick is not None:
                if tick.published == published and topic not in tick.messages:
                    tick.messages[topic] = values
                    continue
                yield tick
            tick = _Tick(published, logged, {topic: values})
            continue
        if tick is not None and topic in closing:
            yield tick
            tick = None
    if tick is not None:
        yield tick
