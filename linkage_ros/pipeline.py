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
From a scene to its tick: drive, closure, the stages that the scene calls for, and the messages.

Building puts in only what the scene names; a tick asks no scene.
"""

from __future__ import annotations

from importlib import import_module
from typing import NamedTuple

from linkage_ros.drives.topic import TopicDrive
from linkage_ros.effects.stage import EFFECTS, Motion, NEEDS, Stage, Writer
from linkage_ros.effects.turns import Continuous, Wrapped
from linkage_ros.joint_state import JointStateReader, JointStateWriter, Rejection
from linkage_ros.kinematics.closure import Closure, Position
from linkage_ros.scene.scene import Scene
from linkage_ros.tuples import new


class Tick(NamedTuple):
    """
    What a tick came to.

    Attributes
    ----------
    position
        The loop at the tick; nothing where there is no crank.
    motion
        What is published; nothing where nothing is.
    message
        The JointState, serialized; empty where nothing is published.
    trajectory
        The JointTrajectory, serialized; empty where nothing is published, or none is called for.

    """

    position: Position | None
    motion: Motion | None
    message: bytes
    trajectory: bytes


_SILENT = Tick(None, None, b'', b'')


class Pipeline:
    """
    A scene at work. To reset it, build it again.

    Parameters
    ----------
    scene
        The scene.
    closure
        Its linkage, where that is at hand: it remembers nothing, and serves every reset.

    Raises
    ------
    FileError
        Where the scene names an effect that does not exist, or gives it a wrong parameter.
    DefinitionError
        Where the linkage does not close.

    """

    __slots__ = ('_drive', '_path', '_reader', 'closure')

    def __init__(self, scene: Scene, closure: Closure | None = None) -> None:
        self.closure = closure or Closure(scene.linkage)
        self._reader = JointStateReader([driven.joint for driven in scene.linkage.inputs])
        called_for = {*scene.effects, *(n for name in scene.effects for n in NEEDS.get(name, ()))}
        effects = {name: import_module(EFFECTS[name]) for name in EFFECTS if name in called_for}
        stages: list[Stage] = [
            effect.build(effect.read(scene.effects.section(name, required=False)), self.closure)
            for name, effect in effects.items()
        ]
        scene.effects.finish(tuple(EFFECTS))
        turns = Wrapped if scene.wrapped else Continuous
        stages.append(turns(self.closure.turning))
        self._drive = TopicDrive(
            scene.drive, needs_rate=any(e.NEEDS_CRANK_RATE for e in effects.values())
        )
        joints = list(scene.linkage.joints)
        write = JointStateWriter(joints).write
        write_motion: Writer | None = None
        if 'acceleration' in effects:
            write_motion = effects['acceleration'].writer(joints)
        self._path = (self._drive.state, self.closure.position, tuple(stages), write, write_motion)

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
        sample = self._reader.read(message)
        if isinstance(sample, Rejection):
            return sample
        return self._drive.offer(sample, now)

    def tick(self, now: int) -> Tick:
        """
        Return the linkage at a time.

        Parameters
        ----------
        now
            The time, and the stamp of the message, in [ns].

        """
        state, close, stages, write, write_motion = self._path
        crank = state(now)
        if crank is None:
            return _SILENT
        position = close(*crank[0])
        joints = position[2]
        if not joints:
            return Tick(position, None, b'', b'')
        motion = new(Motion, (crank, position, joints, (), (), None))
        for stage in stages:
            motion = stage(motion)
        _, _, joints, rates, _, _ = motion
        trajectory = b'' if write_motion is None else write_motion(now, motion)
        return new(Tick, (position, motion, write(now, joints, rates), trajectory))

    @property
    def writes_trajectory(self) -> bool:
        """Whether a tick that publishes has a JointTrajectory too."""
        return self._path[-1] is not None

    @property
    def newest_stamp(self) -> int:
        """Stamp of the newest good sample, in [ns]; 0 before the first."""
        return self._drive.stamp
