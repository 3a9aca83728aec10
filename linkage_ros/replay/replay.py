# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Replay a run from its bag: the same pipeline on the same samples in the same order.

The bag holds the messages in the order in which the tick took and published them. The log time of
a sample is the time against which the tick checked it; the publish time of a published message is
the time that the tick solved for. So the pipeline, built from the scene in the bag, reproduces the
same states. Faults and resets follow the bag, not the timeline of the scene, since a service call
may have caused them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
import platform
from typing import Any, NamedTuple, TYPE_CHECKING

from linkage_ros import __version__
from linkage_ros.bag import (
    Bag,
    BagMessage,
    Event,
    FaultEvent,
    read_run_metadata,
    recorded_events,
    ResetEvent,
    RUN_FILE,
    RunFiles,
    SampleEvent,
    TickEvent,
    VERSIONS,
    WrenchEvent,
)
from linkage_ros.description import LINKAGE_FILE, parse_scene, Scene, SCENE_FILE
from linkage_ros.errors import BagError, list_names
from linkage_ros.messages import TIME_END
from linkage_ros.replay.node_messages import own_joint_states, read_change
from linkage_ros.tick import Pipeline, Tick

if TYPE_CHECKING:
    from linkage_ros.stages.faults import Injection


class ReplayedTick(NamedTuple):
    """
    A tick of a bag and the result of the same tick now.

    Attributes
    ----------
    time
        Time of the tick, in [ns].
    recorded
        Recorded joint state; empty if there is none.
    recorded_extras
        Recorded message of each auxiliary topic of the pipeline; empty if there is none.
    tick
        Result of the pipeline for the samples of the bag.

    """

    time: int
    recorded: bytes
    recorded_extras: tuple[bytes, ...]
    tick: Tick


def recorded_scene(
    bag: RunFiles, *, trust_effects: bool = False, settings: Sequence[str] = ()
) -> Scene:
    """
    Return the scene stored in a bag.

    Parameters
    ----------
    bag
        The bag, or an `AnnouncedScene`.
    trust_effects
        As for `parse_scene`: the bag may come from an untrusted source.
    settings
        As for `load_scene`.

    Raises
    ------
    BagError
        The bag has no scene.
    FileError
        This version cannot read the scene.

    """
    missing = {RUN_FILE, SCENE_FILE} - set(bag.attachments)
    if missing:
        raise BagError(
            bag.path,
            f'carries no {list_names(sorted(missing))}',
            'name a bag that linkage_ros has recorded',
        )
    run = read_run_metadata(bag)
    kinds = ('.yaml', '.urdf')
    files = {name: data for name, data in bag.attachments.items() if name.endswith(kinds)}
    if len(files) < 2:
        raise BagError(
            bag.path, f'carries no {LINKAGE_FILE}', 'name a bag that linkage_ros has recorded'
        )
    return parse_scene(
        run.scene,
        str(bag.path),
        files,
        str(_folder_of(bag.path) / run.scene_folder),
        run.seed,
        trust_effects=trust_effects,
        settings=settings,
    )


def _folder_of(path: Any) -> Path:
    return path if isinstance(path, Path) and path.is_dir() else Path(path).parent


def replay_ticks(bag: Bag, scene: Scene) -> Iterator[ReplayedTick]:
    """Run a scene on a bag's samples; yield every tick with a message in the bag."""
    for tick in replay_all(bag, scene, bag.messages()):
        if tick.recorded or any(tick.recorded_extras):
            yield tick


def replay_all(bag: Bag, scene: Scene, messages: Iterable[BagMessage]) -> Iterator[ReplayedTick]:
    """
    Run a scene on a bag's samples; yield the ticks with suppressed messages too.

    Parameters
    ----------
    bag
        The bag.
    scene
        The scene in the bag.
    messages
        Messages of the bag.

    """
    rerun = Rerun(bag, scene)
    for event in recorded_events(read_run_metadata(bag), own_joint_states(scene), messages):
        rerun.take(event)
        if isinstance(event, TickEvent):
            if event.time >= TIME_END:
                raise BagError(
                    bag.path,
                    f'has a tick at {event.time} ns, beyond the range of message times',
                    'name another bag',
                )
            joint_states, *extras = event.messages
            tick = rerun.tick(event.time)
            yield ReplayedTick(event.time, joint_states, tuple(extras), tick)


class Rerun:
    """The scene of a run once more: it takes the run's events, and ticks when it is asked to."""

    def __init__(self, bag: Bag, scene: Scene) -> None:
        self._bag, self._scene = bag, scene
        self.pipeline = Pipeline(scene)
        """The pipeline as the last reset built it."""
        self._closures, self._injection = self.pipeline.closures, self.pipeline.injection
        self._last = 0

    def take(self, event: Event) -> None:
        """Take the next event; a tick only moves the time on."""
        is_back, self._last = event.log_time < self._last, event.log_time
        if is_back or isinstance(event, ResetEvent):
            self.pipeline = Pipeline(self._scene, self._closures, self._injection)
        if isinstance(event, SampleEvent):
            self.pipeline.offer(event.data, event.log_time)
        elif isinstance(event, WrenchEvent):
            # The account of a damaged bag may name more topics than its scene.
            if event.number < len(self.pipeline.wrenches):
                self.pipeline.wrenches[event.number].offer_wrench(event.data, event.log_time)
        elif isinstance(event, FaultEvent) and self._injection is not None:
            turn_fault(self._bag, self._injection, event.data)

    def tick(self, time: int) -> Tick:
        """Return the tick at a time, in [ns]."""
        return self.pipeline.tick(time)


def turn_fault(bag: Bag, injection: Injection, message: bytes) -> None:
    """Turn a fault on or off by a message of a bag; raise `BagError` if that is impossible."""
    try:
        injection.switch_fault(*read_change(message))
    except (ValueError, KeyError):
        raise BagError(
            bag.path,
            'a message on its faults topic names no fault of its scene',
            'name another bag',
        ) from None


def versions_here() -> dict[str, str]:
    """Return the versions of the installed software, in the form of a run's account."""
    here = (__version__, platform.python_version(), platform.machine())
    return dict(zip(VERSIONS, here, strict=True))
