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


"""The messages of a bag for a command: with a word on how far it is, up to damage or Ctrl-C."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import count
from pathlib import Path
import sys
from threading import Event

from linkage_ros.bag.contents import layout_of, TOLD_EVERY
from linkage_ros.bag.reader import Bag, BagMessage, MOST_ATTACHED, read_bag
from linkage_ros.bag.recording_stats import counts_in
from linkage_ros.bag.recover import NOTHING_LOST, RECOVERED
from linkage_ros.bag.run_events import run_account, run_said, RunAccount
from linkage_ros.cli.progress import progress
from linkage_ros.errors import BagError, clean, listed
from linkage_ros.replay.replay import recorded_scene
from linkage_ros.scene.scene import Scene
from linkage_ros.signals import heeded, StoppedError

_MIB = 2**20
_BESIDE = 47  # bytes that a message takes in an MCAP file and its index beside its own


def opened(path: Path, stop: Event) -> Bag:
    """
    Open a bag for reading, as far as it goes; say what of its attachments is not read.

    Raises
    ------
    BagError
        As `read_bag`.
    StoppedError
        A signal has come while it was searched for what its missing index would tell.

    """

    def look(_read: int) -> None:
        if stop.is_set():
            raise StoppedError

    bag = read_bag(path, allow_truncated=True, told=look)
    if bag.passed_over:
        line = (
            f'linkage: {path}: attachments beyond {MOST_ATTACHED // _MIB} MiB are not read: '
            f'{listed(bag.passed_over)}'
        )
        print(clean(line), file=sys.stderr)
    return bag


def add_trust(parser: argparse.ArgumentParser) -> None:
    """Declare the option by which a user trusts a bag."""
    parser.add_argument(
        '--trust-effects',
        action='store_true',
        help='import the modules that the scene of the bag names as effects, which runs their '
        'code; it is said which',
    )


def scene_of(bag: Bag, *, trust_effects: bool) -> Scene:
    """
    Return the scene that a bag carries; what it imports, if that is wished, is said before.

    Raises
    ------
    LinkageError
        As `recorded_scene`.

    """
    scene = recorded_scene(bag)
    if not trust_effects or not scene.not_imported:
        return scene
    from linkage_ros.effects.user_effects import found_in

    for name in scene.not_imported:
        where = found_in(name)
        line = f'linkage: {bag.path} is trusted: imports {name}, and the name leads to {where}'
        print(clean(line), file=sys.stderr, flush=True)
    return recorded_scene(bag, trust_effects=True)


def beside(bag: Path, suffix: str) -> Path:
    """Return the file beside a bag that is named as it, with a suffix behind its name."""
    # The folder that one is in has no name.
    named = bag if bag.name not in ('', '..') else bag.resolve()
    return named.with_name(named.name + suffix) if named.name else named


def unfinished_text(bag: Bag) -> str:
    """Return why an end is missing, of a bag that is truncated."""
    text = 'its recording was killed, or still runs'
    return text if bag.path.is_dir() else f'{text}, or goes on in another file'


def run_or_blank(bag: Bag) -> RunAccount:
    """Return what a run says of itself in its bag; blank where it does not, or damaged."""
    try:
        return run_account(bag)
    except BagError:
        return RunAccount()


def gaps(bag: Bag) -> Iterator[str]:
    """Yield what is missing of a bag within it, so that what comes after may differ."""
    diagnostics = run_said(bag).get('diagnostics_topic')
    dropped = sum(
        count for topic, count in counts_in(bag.custom, 'dropped').items() if topic != diagnostics
    )
    if dropped:
        yield f'{dropped} messages had to be dropped when it was recorded: {_GAP}'
    recovered = bag.custom.get(RECOVERED, '')
    if recovered and not recovered.endswith(NOTHING_LOST):
        yield f'recovered {recovered}: {_GAP}'


_GAP = 'what depends on one that is not there may differ'


class BagReading:
    """
    The messages of a bag, up to damage or a wish to stop, with a word on how far it is.

    Parameters
    ----------
    bag
        The bag.
    stop
        The wish.

    """

    def __init__(self, bag: Bag, stop: Event) -> None:
        self.damage = ''
        """What is damaged, on one line; '' where it was read to its end."""
        self.stopped = False
        """Whether it was stopped."""
        self._bag, self._stop = bag, stop
        self._told: Callable[[int, int], None] = lambda _done, _of: None
        self._size = max(1, sum(layout_of(file).content for file in bag.files) // _MIB)

    def glance(self) -> Iterator[BagMessage]:
        """Yield the messages to one who looks for something; raise StoppedError at the wish."""
        for number, message in enumerate(self._bag.messages(), 1):
            yield message
            if not number % TOLD_EVERY and self._stop.is_set():
                raise StoppedError

    @contextmanager
    def told(self) -> Iterator[Iterator[BagMessage]]:
        """Give the messages, and tell on the terminal how far they are."""
        with heeded(), progress('replayed [MiB]') as self._told:
            yield self._messages()

    def _messages(self) -> Iterator[BagMessage]:
        read = 0
        messages = self._bag.messages()
        for number in count(1):
            try:
                message = next(messages, None)
            except BagError as error:
                self.damage = f'{error.where}: {error.reason}'
                return
            if message is None:
                return
            read += len(message.data) + _BESIDE
            yield message
            if not number % TOLD_EVERY:
                self._told(read // _MIB, max(self._size, read // _MIB))
                if self._stop.is_set():
                    self.stopped = True
                    return
