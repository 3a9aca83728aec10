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
From a scene to its tick: each linkage looked at, and the messages written.

Building puts in only what the scene names; a tick asks no scene.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple, TYPE_CHECKING

from linkage_ros.effects.stage import Reading
from linkage_ros.joint_state import JointStateWriter, Rejection
from linkage_ros.kinematics.closure import Closure
from linkage_ros.line import Extra, Line
from linkage_ros.look import Look
from linkage_ros.routes import Routes
from linkage_ros.scene.scene import Scene
from linkage_ros.tuples import new

if TYPE_CHECKING:
    from linkage_ros.faults.injection import Injection

_WITHHOLDING = {'rate_limit', 'dropout', 'delay', 'jitter'}
"""Effects that may leave a tick without a message."""

_GOING_ON = {'backlash'}
"""Effects that go on where a linkage is open."""


class Tick(NamedTuple):
    """
    What a tick came to.

    Attributes
    ----------
    looks
        What each linkage came to.
    message
        The JointState, serialized; empty where nothing is published.
    extras
        For each of the pipeline's further topics its message, serialized; empty where nothing is
        published on it. Empty as a whole where nothing is on any.

    """

    looks: tuple[Look, ...]
    message: bytes
    extras: tuple[bytes, ...]


class Pipeline:
    """
    A scene at work. To reset it, build it again.

    Parameters
    ----------
    scene
        The scene.
    closures
        Its linkages, where they are at hand: they remember nothing, and serve every reset.
    injection
        Its faults, where they are at hand: they outlive a reset.

    Raises
    ------
    FileError
        Where something in the scene does not go together.

    """

    def __init__(
        self,
        scene: Scene,
        closures: Sequence[Closure] | None = None,
        injection: Injection | None = None,
    ) -> None:
        if injection is None and scene.faults:
            from linkage_ros.faults.injection import Injection

            injection = Injection(scene.faults)
        self.injection = injection
        """The faults; nothing where the scene has none."""
        self.lines = [
            Line(scene, member, closures[number] if closures else None, injection)
            for number, member in enumerate(scene.members)
        ]
        self.extras = [extra for line in self.lines for extra in line.extras]
        """The topics beside the joint states."""
        topics = sorted({line.topic for line in self.lines} - {''})
        if len(topics) > 1:
            raise scene.members[0].content.error(
                'drive', f'{" and ".join(topics)} are listened to', 'drive all by one of them'
            )
        _refuse_stamps(scene)
        self.topic = topics[0] if topics else ''
        """The topic that the drives listen to; '' for none."""
        # Of the drives only that from a topic remembers nothing of the ticks.
        self._goes_on = any(
            line.member.drive[0] != 'topic' or not _GOING_ON.isdisjoint(line.stages)
            for line in self.lines
        )
        self.withholds = (
            self._goes_on
            or injection is not None
            or any(not _WITHHOLDING.isdisjoint(line.stages) for line in self.lines)
        )
        """Whether there may be ticks without a message of which a replay has to know."""
        if len(self.lines) == 1:
            (line,) = self.lines
            self.tick = _ticking_one(line)
        else:
            self._routes = Routes({line: line.member.inputs for line in self.lines})
            self._offered = 0
            self._newest: dict[Line, int] = {}
            self._writers: dict[tuple[bool, ...], JointStateWriter] = {}
            self.tick = self._tick_many

    def offer(self, message: bytes, now: int) -> Rejection | None:
        """
        Take a crank message, serialized, or say why not.

        Parameters
        ----------
        message
            A ``sensor_msgs/msg/JointState`` in CDR.
        now
            The time, in [ns].

        """
        if len(self.lines) == 1:
            return self.lines[0].offer(message, now)
        # It may be for one linkage or for several: it is good if one of them takes it.
        self._offered += 1
        rejections = []
        for line in self._routes.find(message):
            rejections.append(line.offer(message, now))
            if rejections[-1] is None:
                self._newest[line] = self._offered
        return None if None in rejections else next(iter(rejections), Rejection.MISSING)

    def newly_used(self) -> int:
        """Return of how many of the good messages since the last call no newer one came."""
        if len(self.lines) == 1:
            return 1
        numbers = set(self._newest.values())
        self._newest.clear()
        return len(numbers)

    def remembers(self, tick: Tick) -> bool:
        """Return whether a tick without a message changes what comes after it."""
        return any(
            line.gap_begins
            if look.position is None or not (look.position.joints or self._goes_on)
            else True
            for line, look in zip(self.lines, tick.looks, strict=True)
        )

    def _tick_many(self, now: int) -> Tick:
        """Return all linkages at a time, in [ns], those joints left out that have no reading."""
        looks = tuple([line.look(now) for line in self.lines])
        read = [look[3] for look in looks]
        present = tuple([reading is not None for reading in read])
        extras = tuple(
            _written(extra, now, look)
            for line, look in zip(self.lines, looks, strict=True)
            for extra in line.extras
        )
        readings = [reading for reading in read if reading is not None]
        if not readings:
            return Tick(looks, b'', extras if any(extras) else ())
        writer = self._writers.get(present) or self._writer(present)
        stamp = max(reading.stamp for reading in readings)
        message = writer.write(stamp, *_joined(readings))
        return Tick(looks, message, extras)

    def _writer(self, present: tuple[bool, ...]) -> JointStateWriter:
        joints = [
            joint
            for line, there in zip(self.lines, present, strict=True)
            if there
            for joint in line.member.joints
        ]
        self._writers[present] = writer = JointStateWriter(joints)
        return writer

    @property
    def closures(self) -> list[Closure]:
        """Return the linkages."""
        return [line.closure for line in self.lines]

    @property
    def newest_stamp(self) -> int:
        """Stamp of the newest good sample, in [ns]; 0 before the first."""
        return max(line.drive.stamp for line in self.lines)

    @property
    def max_age(self) -> int:
        """Age of the newest sample beyond which something is amiss, in [ns]; 0 for never."""
        return max(line.drive.max_age for line in self.lines)


def _refuse_stamps(scene: Scene) -> None:
    """Refuse stamps of measurement that one message of several linkages could not bear."""
    delays = [member.effects.get('delay') for member in scene.members]
    for member, delay in zip(scene.members, delays, strict=True):
        if delay is not None and delay.stamp == 'measured' and set(delays) != {delay}:
            raise member.content.error(
                'effects.delay.stamp',
                'measured is a stamp of its own, and all linkages share one message',
                'give all linkages the same delay, or write arrival',
            )


def _ticking_one(line: Line) -> Callable[[int], Tick]:
    """Return what ticks where there is one linkage; a method takes longer, in every tick."""
    look_at, write = line.look, JointStateWriter(line.member.joints).write
    extras = tuple(extra.write for extra in line.extras)
    tells_open = any(extra.write_open for extra in line.extras)

    def tick(now: int) -> Tick:
        look = look_at(now)
        _, _, motion, reading = look
        if reading is None:
            if tells_open and motion is None:
                opened = tuple([_written(extra, now, look) for extra in line.extras])
                return new(Tick, ((look,), b'', opened if any(opened) else ()))
            return new(Tick, ((look,), b'', ()))
        stamp, joints, rates, _, efforts = reading
        message = write(stamp, joints, rates, efforts)
        if not extras:
            return new(Tick, ((look,), message, ()))
        if motion is None:
            written = tuple([_written(extra, now, look) for extra in line.extras])
            return new(Tick, ((look,), message, written if any(written) else ()))
        written = tuple([write_extra(now, motion, reading) for write_extra in extras])
        return new(Tick, ((look,), message, written))

    return tick


def _written(extra: Extra, now: int, look: Look) -> bytes:
    """Return an extra of a linkage at a time, in [ns]; b'' for none."""
    _, position, motion, reading = look
    if reading is not None and (motion is not None or extra.of_reading):
        return extra.write(now, motion, reading)
    if motion is not None:
        return b''
    if position is None or extra.write_open is None:
        return b''
    return extra.write_open(now, position)


def _joined(
    readings: Sequence[Reading],
) -> tuple[list[float], list[float], list[float]]:
    """
    Return positions, rates and efforts of all readings.

    The arrays of a JointState are of one length or empty. Where some readings have rates and
    others, at a toggle or without the effect, have none, none are published; so with efforts.
    """
    positions = [value for reading in readings for value in reading[1]]
    rates = [value for reading in readings for value in reading[2]]
    efforts = [value for reading in readings for value in reading[4]]
    n = len(positions)
    return positions, rates if len(rates) == n else [], efforts if len(efforts) == n else []
