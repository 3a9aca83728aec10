# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Where the error of the published joints comes from, and what each digit costs.

A source of error is a knob with settings, such as the step of the drive or the rate of the ticks.
Each setting has an error, measured against the exact solution of the scene, and a price, measured
on this machine. One setting is the scene's own. Modules that measure fill these types; the text,
the JSON, the page and the picture only read them.

All errors are in one unit: angles in [rad]; slides in parts of the linkage's size, which are the
angles that they seem from that distance.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from linkage_ros.tools.study.measuring import Spread


class JointError(NamedTuple):
    """How far the published joints are from the exact ones over a run, in [rad]."""

    rms: float  # Root mean square over the ticks of the worst joint
    worst: float  # Greatest of all joints and ticks


class Price(NamedTuple):
    """What a setting costs a tick."""

    tick: Spread  # Processor time that it takes of a tick, in [µs]: median and quartiles
    rate: float  # Ticks per second

    @property
    def core_share(self) -> float:
        """Return the share of a processor core, 0 to 1."""
        return self.tick.middle * 1e-6 * self.rate

    @property
    def is_noise(self) -> bool:
        """Return whether the time is smaller than its spread, so that it says nothing."""
        return abs(self.tick.middle) <= self.tick.high - self.tick.low

    def negate(self) -> Price:
        """Return the price of the other way round: what is saved instead of added."""
        low, middle, high = self.tick
        return self._replace(tick=Spread(-high, -middle, -low))


class Setting(NamedTuple):
    """One setting of a knob."""

    label: str  # For tables and pictures: 'rk4, 1 ms', '1 kHz, held', 'float32'
    error: JointError
    # Of the scene's own setting: what it takes of the tick. Of another: what it adds to the tick
    # of the scene as it is, less than 0 where it saves; its rate is the one it asks for. None if
    # it costs no time of a tick.
    price: Price | None
    # Keys of the scene with their values, as `--set` takes them. Empty for the scene's own
    # setting; None for a comparison that no scene can ask for, such as single precision.
    changes: Sequence[tuple[str, object]] | None = ()
    advice: str = ''  # What a user does where no key of the scene does it: 'carry forward by …'

    @property
    def instruction(self) -> str:
        """Return what a user writes, and does: 'drive.torque.step: 0.0005'."""
        written = [_setting_text(*change) for change in self.changes or ()]
        return ', '.join([*written, *([self.advice] if self.advice else [])])


def _setting_text(key: str, value: object) -> str:
    if isinstance(value, bool):
        value = 'true' if value else 'false'
    elif isinstance(value, float):
        value = f'{value:.9f}'.rstrip('0').rstrip('.')  # YAML takes 1e-05 for a text
    return f'{key}: {value}'


class Knob(NamedTuple):
    """A source of error, with the settings that were measured."""

    name: str  # 'step of the drive', 'age in use', 'age of the command', 'solving'
    settings: Sequence[Setting]
    chosen: int  # Index of the scene's own setting
    after: float | None = None  # For an error that grows: the time that it was taken after, in [s]
    # Whether the scene asks for the difference: an effect or a fault, which is not an error.
    is_deliberate: bool = False
    note: str = (
        ''  # What is assumed or to be known, below the table; of effects in the last column
    )

    @property
    def own_setting(self) -> Setting:
        """Return the scene's own setting."""
        return self.settings[self.chosen]


class RecordingLoss(NamedTuple):
    """What recording costs, and what it may lose, with one setting."""

    instruction: str  # What a user writes: 'record.flush_period: 0.2'
    seconds: float  # Longest time of a run that a crash loses, in [s]
    price: Price
    dropped: int  # Messages that found no room before the disk was ready


class Budget(NamedTuple):
    """All that was measured of a scene."""

    scene: str  # Name
    rate: float  # Ticks per second
    tick: Price  # The whole tick
    knobs: Sequence[Knob]  # Errors and deliberate differences, each sorted by size
    recording: Sequence[
        RecordingLoss
    ]  # The scene's own setting, then others; empty if it records nothing
    machine: Sequence[tuple[str, str]]  # Day, machine and versions: names and values
    left_out: Sequence[str] = ()  # What `--quick` or the scene left out, a sentence each

    def core_of(self, knob: Knob, setting: Setting) -> float:
        """Return the share of a core that the whole scene takes with a setting, 0 to 1."""
        if setting is knob.own_setting or setting.price is None:
            return self.tick.core_share
        return (self.tick.tick.middle + setting.price.tick.middle) * 1e-6 * setting.price.rate


class NeedAnswer(NamedTuple):
    """What meets a need, or what stands in the way."""

    is_met: bool
    error: float  # Sum of the worst errors with these settings, in [rad]
    changes: Sequence[tuple[str, object]]  # Keys of the scene with their values
    text: str  # What to write, what is off then and what it costs; or what stands in the way
