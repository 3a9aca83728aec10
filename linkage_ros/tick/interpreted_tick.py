# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The tick of a scene, step by step, and its result."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from linkage_ros.messages import JointStateWriter
from linkage_ros.stages.drives import CrankState
from linkage_ros.stages.effects import SensorReading
from linkage_ros.tick.linkage_pipeline import LinkagePipeline
from linkage_ros.tick.linkage_state import LinkageState


class Tick(NamedTuple):
    """
    The result of a tick.

    Attributes
    ----------
    message
        The serialized JointState; empty where nothing is published.
    extras
        One serialized message for each auxiliary topic, b'' where that topic has none; an empty
        tuple where no auxiliary topic has a message.
    computed
        State of each linkage; instead of a compiled state that is published, the values of its
        crank state and of its reading, its reactions and its given numbers, as plain tuples.
    linkages
        The linkage pipelines.

    """

    message: bytes
    extras: tuple[bytes, ...]
    computed: Sequence[LinkageState | tuple[Any, ...]]
    linkages: Sequence[LinkagePipeline]

    @property
    def states(self) -> tuple[LinkageState, ...]:
        """State of each linkage."""
        return tuple(
            state if isinstance(state, LinkageState) else _name_values(linkage, *state)
            for linkage, state in zip(self.linkages, self.computed, strict=True)
        )


class InterpretedTick:
    """Computes the ticks of linkages that share a message, step by step."""

    def __init__(self, linkages: Sequence[LinkagePipeline]) -> None:
        self.linkages = linkages
        self.extras = [extra for linkage in linkages for extra in linkage.extras]
        self._writers: dict[tuple[bool, ...], JointStateWriter] = {}

    def run(self, now: int) -> Tick:
        """Return the tick at a time, in [ns], step by step."""
        return self.make_tick(now, [linkage.interpret(now) for linkage in self.linkages])

    def make_tick(self, now: int, states: Sequence[LinkageState]) -> Tick:
        """Return the result of a tick; joints without a reading are left out."""
        extras: tuple[bytes, ...] = ()
        if self.extras:
            pairs = zip(self.linkages, states, strict=True)
            extras = tuple(
                [extra for linkage, state in pairs for extra in linkage.write_extras(now, state)]
            )
        readings = [state.reading for state in states if state.reading is not None]
        if not readings:
            return Tick(b'', extras if any(extras) else (), states, self.linkages)
        present = tuple([state.reading is not None for state in states])
        writer = self._writers.get(present) or self.make_writer(present)
        stamp = max([reading.stamp for reading in readings])
        return Tick(writer.write(stamp, *_join_readings(readings)), extras, states, self.linkages)

    def make_writer(self, present: tuple[bool, ...]) -> JointStateWriter:
        """Return the writer of the joints of the linkages that are present."""
        joints = [
            joint
            for linkage, there in zip(self.linkages, present, strict=True)
            if there
            for joint in linkage.scene_linkage.joint_names
        ]
        self._writers[present] = writer = JointStateWriter(joints)
        return writer


def _name_values(
    linkage: LinkagePipeline, crank: Any, reading: Any, reactions: Any, loads: Any
) -> LinkageState:
    crank = crank if isinstance(crank, CrankState) else CrankState(*crank)
    return LinkageState(linkage.solve_mechanism, crank, SensorReading(*reading), reactions, loads)


def _join_readings(
    readings: Sequence[SensorReading],
) -> tuple[list[float], list[float], list[float]]:
    """
    Return positions, rates and efforts of all readings.

    The arrays of a JointState have equal length or are empty. Where one reading has no rates (at
    a singularity, or without the effect), no rates are published. The same holds for efforts.
    """
    positions = [value for reading in readings for value in reading.joints]
    rates = [value for reading in readings for value in reading.rates]
    efforts = [value for reading in readings for value in reading.efforts]
    n = len(positions)
    return positions, rates if len(rates) == n else [], efforts if len(efforts) == n else []
