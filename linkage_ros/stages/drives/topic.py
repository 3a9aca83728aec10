# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Drive from a topic: the newest measured sample, extrapolated by its rate.

A rate that is absent, or NaN as joint_state_broadcaster fills it in for an interface that is not
there, is the backward difference of the angles, where one is needed: ω = (q − q₋₁)/Δt, for a
revolute input by the shorter way around. Before a second sample there is none, and no crank state.

A JointState has no accelerations. With ``acceleration: differenced`` they come from the rates of
the samples: their backward difference d = (ω − ω₋₁)/Δt, and behind it a low-pass of order one,

    α ← α + (1 − e^(−2π·cutoff·Δt))·(d − α)

which is exact for a d that is held over the time Δt between both stamps. The difference lags by
half an interval, the low-pass by 1/(2π·cutoff) (A. V. Oppenheim, R. W. Schafer, Discrete-Time
Signal Processing, 3rd ed., 2010, ch. 7).

Of several inputs a message names one, some or all: each is carried to the tick by its own stamp.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from math import expm1, isfinite, nan, remainder, tau
from typing import Any

from linkage_ros.description import choice, flag, name_or_names, number, whole_number
from linkage_ros.errors import DefinitionError
from linkage_ros.kinematics import Input, where
from linkage_ros.messages import CrankSample, input_reader, NANOSECONDS, Rejection
from linkage_ros.stages.drives.drive import (
    Context,
    CrankState,
    Drive,
    FormulaCrank,
    LARGEST,
    Reader,
)

_Values = tuple[float, ...]

_ZERO, _NO_RATE = (0.0,), (nan,)


@dataclass(frozen=True, slots=True)
class TopicDrive(Drive):
    """A measured crank: the newest sample of crank_states, a sensor_msgs/JointState."""

    carry_forward: bool = flag(
        "carry the crank to the tick's time by its rate; else it is held as measured", True
    )
    max_age: float = number(
        'age of the newest sample beyond which there is no crank',
        0.2,
        unit='s',
        least=1e-6,
        most=3600.0,
    )
    max_lead: float = number(
        'longest time by which a stamp may be ahead of the clock',
        0.1,
        unit='s',
        least=0.0,
        most=3600.0,
    )
    stamp: str = choice(
        'time of a sample: its stamp, or its arrival whatever the stamp',
        ('measured', 'arrival'),
        'measured',
    )
    acceleration: str = choice(
        "the crank's acceleration: zero, or the differences of the samples' rates",
        ('zero', 'differenced'),
        'zero',
    )
    cutoff: float = number(
        'of the low-pass behind the differences; 0: none', 0.0, unit='Hz', least=0.0, most=1e6
    )
    joint: tuple[str, ...] = name_or_names(
        'what the samples name instead of the inputs, which are computed: a dependent joint, a '
        'coordinate P.x, a distance A-B of two points, in the plane the angle LINK.angle of a '
        'link; as many in a list as there are inputs; absent, they name the inputs',
        'a joint',
    )
    branch: int = whole_number(
        'with one input, branch of that joint on which the crank is, as linkage check --branches '
        'lists them; 0: that of the pose, or the only one',
        0,
        least=0,
        most=10_000,
    )

    listens_to = 'crank_states'
    is_measured = True
    keeps_state = False

    @property
    def instead_of_inputs(self) -> tuple[str, ...]:
        """Return the joints that samples name instead of the inputs; none if the inputs."""
        return self.joint

    @property
    def moves_by_rates(self) -> bool:
        """Return whether the crank moves at its rates between samples."""
        return self.carry_forward

    @property
    def is_recoverable(self) -> bool:
        """Return whether no filter remembers earlier samples."""
        return not self.cutoff

    def build(self, context: Context) -> SampledCrank | SampledInputs:
        """
        Build the drive.

        Raise `DefinitionError` if a low-pass has nothing to filter, or if a branch has no joint.
        """
        if self.cutoff and self.acceleration == 'zero':
            raise DefinitionError(
                'drive.topic.cutoff', 'has nothing to filter', 'add acceleration: differenced'
            )
        if self.branch and not self.joint:
            raise DefinitionError('drive.topic.branch', 'has no joint', 'name it: joint: NAME')
        return sample_inputs(self, context.needs_rate, context.closure.linkage.inputs)

    def reader(self, context: Context) -> Reader:
        """
        Build the reader of the messages.

        Raise `DefinitionError` if the joints do not determine the inputs.
        """
        if self.joint:
            from linkage_ros.stages.drives.dependent_samples import (  # local import: seldom named
                DependentSampleReader,
                ExchangedInputs,
            )

            exchange = ExchangedInputs(context.closure, self.joint, self.branch)
            names = [context.prefix + joint for joint in self.joint]
            return DependentSampleReader(exchange, names, context.takes_efforts).read
        return input_reader(context.inputs_in_messages, context.takes_efforts)


def sample_inputs(
    use: TopicDrive, needs_rate: bool, inputs: Sequence[Input]
) -> SampledCrank | SampledInputs:
    """Return a crank that samples of some inputs move."""
    cranks = [SampledCrank(use, needs_rate, slides=bool(driven.slider)) for driven in inputs]
    return cranks[0] if len(cranks) == 1 else SampledInputs(cranks)


class SampledCrank(FormulaCrank):
    """
    One input that keeps the newest good sample only.

    Its acceleration is 0, as the extrapolation at constant rate implies. If it is estimated, the
    input is carried forward with it, rates included. An absent rate counts as 0 if only the
    extrapolation needs the rate. The way between two samples of an input that does not slide is
    the shorter one around.
    """

    __slots__ = (
        '_at_arrival',
        '_bend',
        '_carry_forward',
        '_estimate',
        '_last',
        '_max_lead',
        '_needs_rate',
        '_slides',
        'efforts',
        'jump',
        'max_age',
        'sample',
    )

    HELD = 'sample'

    max_age: int
    """Age of the newest sample above which there is no crank state, in [ns]."""
    sample: tuple[int, _Values, _Values, _Values] | None
    """The newest good sample with rates: its stamp, in [ns], angle, rate, acceleration."""
    jump: float
    """Greatest change from one sample to the next, in [rad] or [m]."""
    efforts: _Values
    """Effort in the newest good sample, in [N·m] or [N]; NaN if it has none."""

    def __init__(self, use: TopicDrive, needs_rate: bool, *, slides: bool = False) -> None:
        self._carry_forward = use.carry_forward
        self.max_age = round(use.max_age * NANOSECONDS)
        self._max_lead = round(use.max_lead * NANOSECONDS)
        self._at_arrival = use.stamp == 'arrival'
        self._estimate = use.acceleration == 'differenced'
        self._bend = -tau * use.cutoff
        self._needs_rate = needs_rate or use.carry_forward or self._estimate
        self._slides = slides
        self._last: tuple[int, _Values] | None = None
        """Stamp and angles of the newest good sample."""
        self.sample = None
        self.jump = 0.0
        self.efforts = _NO_RATE

    @property
    def stamp(self) -> int:
        """Stamp of the newest good sample, in [ns]; 0 before the first."""
        return self._last[0] if self._last else 0

    def offer(self, sample: CrankSample, now: int) -> Rejection | None:
        """Take a sample at a time [ns], or return why it is rejected; then nothing changes."""
        stamp, angles, rates, _, efforts = sample
        if rates is None:
            rates = _NO_RATE
        complete = -LARGEST <= angles[0] <= LARGEST and -LARGEST <= rates[0] <= LARGEST
        if not complete and (why := _find_rejection(angles, rates)) is not None:
            return why
        if self._at_arrival:
            stamp = now
        if stamp == 0:
            return Rejection.STAMP_ZERO
        if stamp > now + self._max_lead:
            return Rejection.STAMP_FUTURE
        if self._last is not None:
            before, last = self._last
            if stamp < before:
                return Rejection.STAMP_OLD
            jump = abs(angles[0] - last[0])
            if jump > self.jump:
                self.jump = jump
        self.efforts = efforts or _NO_RATE
        if not complete:
            known = self._mean_rate(stamp, angles[0]) if self._needs_rate else _ZERO
            if known is None:
                self._last = stamp, angles
                return None
            rates = known
        acceleration = self._estimate_acceleration(stamp, rates[0]) if self._estimate else _ZERO
        self.sample = stamp, angles, rates, acceleration
        self._last = stamp, angles
        return None

    def hold(self, stamp: int, angles: _Values, rates: _Values) -> None:
        """Keep a sample of accelerations of 0, whatever was before."""
        self.sample = stamp, angles, rates, _ZERO

    def _mean_rate(self, stamp: int, angle: float) -> _Values | None:
        """Return the mean rate since the last sample; None without one of another stamp."""
        if self._last is None or stamp == self._last[0]:
            return self.sample and self.sample[2]
        before, (earlier,) = self._last
        way = angle - earlier
        return ((way if self._slides else remainder(way, tau)) / ((stamp - before) * 1e-9),)

    def _estimate_acceleration(self, stamp: int, rate: float) -> _Values:
        """Return the acceleration at a new sample; 0 at the first one, and after a gap."""
        if self.sample is None or stamp - self.sample[0] > self.max_age:
            return _ZERO
        before, _, (earlier,), bent = self.sample
        if stamp == before:
            return bent
        seconds = (stamp - before) * 1e-9
        share = -expm1(self._bend * seconds) if self._bend else 1.0
        acceleration = bent[0] + share * ((rate - earlier) / seconds - bent[0])
        return (acceleration,) if -LARGEST <= acceleration <= LARGEST else _ZERO

    def usual(self, _inputs: int) -> tuple[int, Any]:
        """Return a time, in [ns], and a sample."""
        return 1, (0, (0.5,), (1.25,), (0.75,))

    def crank_state(
        self, now: int, held: tuple[int, _Values, _Values, _Values]
    ) -> CrankState | None:
        """Return the crank state at a time, in [ns]; None if the newest sample is too old."""
        stamp, angles, rates, accelerations = held
        age = now - stamp
        if age > self.max_age:
            return None
        if self._carry_forward and self._estimate:
            seconds = age * 1e-9
            change = accelerations[0] * (0.5 * seconds)
            angles = (angles[0] + (rates[0] + change) * seconds,)
            rates = (rates[0] + accelerations[0] * seconds,)
        elif self._carry_forward:
            seconds = age * 1e-9
            angles = (angles[0] + rates[0] * seconds,)
        return CrankState(angles, rates, accelerations, age)


class SampledInputs(FormulaCrank):
    """
    Several inputs, each of which keeps its own newest good sample.

    A message may name some of them. There is no crank state before each has a sample, and while
    the newest sample of one is too old. The age is that of the oldest.
    """

    __slots__ = ('_cranks', '_newest_inputs', 'max_age')

    HELD = 'samples'

    max_age: int
    """Age of an input's newest sample above which there is no crank state, in [ns]."""

    def __init__(self, cranks: Sequence[SampledCrank]) -> None:
        self._cranks = cranks
        self.max_age = cranks[0].max_age
        self._newest_inputs: tuple[int, ...] = ()

    @property
    def newest_inputs(self) -> tuple[int, ...]:
        """Numbers of the inputs that took the last sample."""
        return self._newest_inputs

    @property
    def samples(self) -> tuple[Any, ...] | None:
        """Return the samples of all inputs, one behind the other; None if one has none."""
        samples = [crank.sample for crank in self._cranks if crank.sample is not None]
        return tuple(chain.from_iterable(samples)) if len(samples) == len(self._cranks) else None

    @property
    def stamps(self) -> tuple[int, ...]:
        """Stamp of the newest good sample of each input, in [ns]; 0 before the first."""
        return tuple([crank.stamp for crank in self._cranks])

    @property
    def stamp(self) -> int:
        """Stamp of the newest good sample, in [ns]; 0 before the first."""
        return max(self.stamps)

    @property
    def sample(self) -> tuple[int, _Values, _Values, _Values] | None:
        """All inputs at the stamp of the newest sample; None if one has no state then."""
        state = self.state(self.stamp)
        return None if state is None else (self.stamp, *state[:3])

    @property
    def efforts(self) -> _Values:
        """Effort of each input in its newest good sample, in [N·m] or [N]; NaN if it has none."""
        return tuple([crank.efforts[0] for crank in self._cranks])

    @property
    def jump(self) -> float:
        """Greatest change of the first input from one sample to the next, in [rad] or [m]."""
        return self._cranks[0].jump

    def offer(self, sample: CrankSample, now: int) -> Rejection | None:
        """Take a sample at a time [ns]; or return why no input takes it: then nothing changes."""
        stamp, angles, rates, named, efforts = sample
        indices = [index for index in range(len(angles)) if named >> index & 1]
        self._newest_inputs = ()
        parts = [
            CrankSample(stamp, (angles[i],), rates and (rates[i],), 1, efforts and (efforts[i],))
            for i in indices
        ]
        for part in parts:
            why = _find_rejection(part.angles, part.rates or _NO_RATE)
            if why is not None:
                return why
        reasons = [
            self._cranks[index].offer(part, now)
            for index, part in zip(indices, parts, strict=True)
        ]
        self._newest_inputs = tuple(
            [index for index, why in zip(indices, reasons, strict=True) if why is None]
        )
        return None if self._newest_inputs else reasons[0]

    def hold(self, stamp: int, angles: _Values, rates: _Values) -> None:
        """Keep a sample of accelerations of 0, whatever was before."""
        for crank, angle, rate in zip(self._cranks, angles, rates, strict=True):
            crank.hold(stamp, (angle,), (rate,))

    def usual(self, inputs: int) -> tuple[int, Any]:
        """Return a time, in [ns], and samples."""
        now, sample = self._cranks[0].usual(1)
        return now, sample * inputs

    def crank_state(self, now: int, held: tuple[Any, ...]) -> CrankState | None:
        """Return the crank state at a time, in [ns]; None if a newest sample is too old."""
        states = []
        parts = iter(held)
        for crank in self._cranks:
            state = crank.crank_state(now, (next(parts), next(parts), next(parts), next(parts)))
            if state is None:
                return None
            states.append(state)
        age: Any = states[0].age
        for state in states[1:]:
            age = where(state.age > age, state.age, age)
        angles, rates, accelerations = (
            tuple(chain.from_iterable(values))
            for values in zip(*(state[:3] for state in states), strict=True)
        )
        return CrankState(angles, rates, accelerations, age)


def _find_rejection(angles: _Values, rates: _Values) -> Rejection | None:
    """Return why a sample is rejected for its numbers; a rate that is NaN is absent."""
    bad = [value for value in angles if not -LARGEST <= value <= LARGEST]
    bad += [rate for rate in rates if abs(rate) > LARGEST]
    if not bad:
        return None
    return Rejection.TOO_LARGE if all(map(isfinite, bad)) else Rejection.NOT_FINITE
