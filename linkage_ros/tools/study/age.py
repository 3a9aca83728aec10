# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The errors that age makes: of a state until it is used, and of a command until it acts.

A listener who holds a state uses it until the next one comes: up to a period old. One who carries
it forward adds its rates times its age. The error is taken at nodes of Gauss within periods drawn
at random over the motion, which gives its mean square, and at the end of the period, which gives
the worst. A state is used in the process that has made it: what a network adds is not in it.

The samples of a crank come at their own rate, apart from the ticks. What the drive makes of them
is computed by the drive itself, from exact samples in several phases to the ticks, or from those
of a bag as they came.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

from linkage_ros.description import HIGHEST_RATE, LOWEST_RATE, Scene
from linkage_ros.messages import CrankSample, JointStateWriter, NANOSECONDS
from linkage_ros.stages.drives import sample_inputs, TopicDrive
from linkage_ros.tools.study.budget import JointError, Knob, Price, Setting
from linkage_ros.tools.study.measuring import Candidate, Spread, time_in_turn
from linkage_ros.tools.study.member_motion import (
    BEGIN,
    Crank,
    cranks_at,
    draw_instants,
    draw_ticks,
    draw_times,
    error_of,
    joint_distances,
    joints_at,
    LinkageMotion,
    scene_key,
)
from linkage_ros.tools.study.prices import USUAL_RATE
import numpy as np

IN_USE, OF_COMMAND = 'age in use', 'age of the command'

CARRY = 'carry forward by the published rates'

_PERIODS, _QUICK_PERIODS = 300, 100
"""Periods at which a state is used, at most."""

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(4)
_PARTS = (*(0.5 + 0.5 * _NODES), 1.0)
"""Ages of a state when it is used, in periods."""

_FACTORS = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0)
_QUICK_FACTORS = (0.2, 0.5, 1.0, 2.0, 5.0)

_TICKS, _QUICK_TICKS = 1000, 200
_PHASES = (0.1, 0.3, 0.5, 0.7, 0.9, 1.0)
"""Ages of the newest sample at a tick, in periods of the samples."""

_BEFORE = 20
"""Samples before the newest one that a drive gets, for its differences."""

_BLOCK = 100
"""Samples that are read together."""


def measure_age_in_use(
    scene: Scene, motions: Sequence[LinkageMotion], horizon: float, *, quick: bool = False
) -> Knob:
    """
    Return the errors of rates of ticks, for a listener who holds and one who carries forward.

    A LinkageError is raised if the loops close at no state of the motion.
    """
    by_sample = not scene.rate
    rate = scene.rate or max(motion.sample_rate for motion in motions) or USUAL_RATE
    factors = _QUICK_FACTORS if quick else _FACTORS
    rates = [rate * f for f in factors if LOWEST_RATE <= rate * f <= HIGHEST_RATE]
    settings: list[Setting] = []
    for ticks, errors in zip(
        rates,
        errors_in_use(motions, rates, horizon, _QUICK_PERIODS if quick else _PERIODS),
        strict=True,
    ):
        changes: list[tuple[str, object]] = []
        advice = ''
        if ticks != rate:
            changes = [] if by_sample else [('rate', _integer_if_whole(ticks))]
            advice = f'publish the crank at {ticks:g} Hz' if by_sample else ''
        held, carried = errors
        settings.append(Setting(f'{_rate_label(ticks)}, held', held, None, changes, advice))
        fields: list[tuple[str, object]] = [(key, {}) for key in _rates_missing(scene)]
        advice = ', '.join(text for text in (advice, CARRY) if text)
        label = f'{_rate_label(ticks)}, carried forward'
        settings.append(Setting(label, carried, None, [*changes, *fields], advice))
    own = f'{_rate_label(rate)}, held'
    chosen = next(k for k, setting in enumerate(settings) if setting.label == own)
    settings[chosen] = settings[chosen]._replace(changes=())
    return Knob(IN_USE, settings, chosen)


def errors_in_use(
    motions: Sequence[LinkageMotion],
    rates: Sequence[float],
    horizon: float,
    periods: int = _PERIODS,
) -> list[tuple[JointError, JointError]]:
    """
    Return for each rate the errors of a state in use: held, and carried by its rates.

    A LinkageError is raised if the loops close at no state of the motion.
    """
    blocks = [_times_of_use(rate, horizon, periods) for rate in rates]
    # All in one run, since a drive that integrates takes time for it.
    times = sorted({time for block in blocks for time in block.ravel().tolist()})
    held: list[list[Any]] = [[] for _ in rates]
    carried: list[list[Any]] = [[] for _ in rates]
    for motion in motions:
        joints, speeds = joints_at(motion.closure, cranks_at(motion, times))
        for index, (rate, block) in enumerate(zip(rates, blocks, strict=True)):
            indices = np.searchsorted(times, block)
            exact = joints[:, indices[:, 1:]]
            first, speed = joints[:, indices[:, :1]], speeds[:, indices[:, :1]]
            ahead = speed * (np.array(_PARTS) / rate)
            held[index].append(joint_distances(motion.closure, first + 0.0 * ahead, exact))
            carried[index].append(joint_distances(motion.closure, first + ahead, exact))
    errors_by_rate = []
    for held_error, carried_error in zip(held, carried, strict=True):
        errors = _over_periods(held_error), _over_periods(carried_error)
        if errors[0] is None or errors[1] is None:
            raise motions[0].scene_linkage.content.error(
                'drive',
                'moves the linkage nowhere where its loops close',
                'see linkage check for where they close',
            )
        errors_by_rate.append((errors[0], errors[1]))
    return errors_by_rate


def _times_of_use(rate: float, horizon: float, periods: int) -> Any:
    """
    Return times of ticks, each with the times of its use, in [ns] (ticks, 1 + parts).

    No tick has to be a whole number of periods after the first one: when a node begins to tick is
    chance.
    """
    numbers = np.array(draw_instants(max(1.0, horizon * rate - 1.0), periods))
    uses = numbers[:, None] + np.array((0.0, *_PARTS))
    return np.round(uses * (NANOSECONDS / rate)).astype(int)


def _over_periods(apart: Sequence[Any]) -> JointError | None:
    """Return the error of distances (periods, parts) by the nodes; None if there are none."""
    worst = np.fmax.reduce([np.asarray(distances) for distances in apart])
    worst = worst[np.isfinite(worst).all(axis=1)]
    if not len(worst):
        return None
    squares = (worst[:, :-1] ** 2) @ (0.5 * _WEIGHTS)
    return JointError(float(np.sqrt(squares.mean())), float(worst.max()))


def measure_age_of_command(
    motion: LinkageMotion, scene: Scene, horizon: float, *, quick: bool = False
) -> Knob | None:
    """Return the errors of the samples' rate and use; None if ticks take them as they come."""
    name, use = motion.scene_linkage.drive
    if not motion.sample_rate or (not scene.rate and not motion.samples):
        return None
    key = f'{scene_key(motion.scene_linkage, "drive")}.{name}'
    if not isinstance(use, TopicDrive):
        use = TopicDrive(carry_forward=use.carry_forward, max_age=use.max_age, stamp=use.stamp)
    most = _QUICK_TICKS if quick else _TICKS
    joints = _CommandSamples(motion, scene.rate or motion.sample_rate, horizon, most)

    def measure_setting(
        changes: dict[str, Any], factor: float = 1.0, advice: str = '', label: str = ''
    ) -> Setting | None:
        used = replace(use, **changes)
        error = joints.measure_error(used, factor)
        if error is None:
            return None
        rate = scene.rate or motion.sample_rate
        more = (factor - 1.0) * motion.sample_rate / rate
        price = Price(offer.scale(more), rate) if factor and factor != 1.0 else None
        return Setting(
            label or f'{_rate_label(motion.sample_rate * factor)}, {_use_of(used)}',
            error,
            price,
            [(f'{key}.{parameter}', value) for parameter, value in changes.items()],
            advice,
        )

    offer = _offer_time(motion, 0.1 if quick else 0.5)
    own = measure_setting({})
    if own is None:
        return None
    settings: list[Setting | None] = [own]
    settings.append(measure_setting({'carry_forward': not use.carry_forward}))
    if motion.scene_linkage.drive[1].is_measured and use.acceleration == 'zero':
        differenced = {} if use.carry_forward else {'carry_forward': True}
        settings.append(measure_setting({'acceleration': 'differenced', **differenced}))
    if motion.samples:
        settings.append(
            measure_setting({}, 0.0, 'bring the samples without a delay', 'without delay')
        )
    else:
        for factor in (0.5, 2.0, 5.0) if not quick else (0.5, 2.0):
            advice = f'publish the crank at {motion.sample_rate * factor:g} Hz'
            settings.append(measure_setting({}, factor, advice))
    return Knob(OF_COMMAND, [setting for setting in settings if setting], 0, note=motion.note)


def _offer_time(motion: LinkageMotion, seconds: float) -> Spread:
    """Return how long the node takes to read and accept a sample, in [µs]."""
    names = motion.scene_linkage.sampled_joints
    zeros = (0.0,) * len(names)
    message = JointStateWriter(names).write(BEGIN, zeros, zeros, zeros)
    _, use = motion.scene_linkage.drive
    if not use.is_measured or motion.scene_linkage.instead_of_inputs:
        return Spread(0.0, 0.0, 0.0)
    read = use.reader(motion.context)
    drive = sample_inputs(use, True, motion.closure.linkage.inputs)

    def run() -> None:
        for _ in range(_BLOCK):
            drive.offer(read(message), BEGIN)

    (spread,) = time_in_turn([Candidate(run, _BLOCK)], seconds)
    return spread.scale(1e6)


class _CommandSamples:
    """Ticks of a linkage, and the samples that come to them."""

    def __init__(self, motion: LinkageMotion, rate: float, horizon: float, most: int) -> None:
        self._motion = motion
        # The samples of a bag came at ticks, those of a sine come at any time between two.
        self._ticks = (
            draw_ticks(rate, horizon, most) if motion.samples else draw_times(horizon, most)
        )
        self._exact, _ = joints_at(motion.closure, cranks_at(motion, self._ticks))

    def measure_error(self, use: TopicDrive, factor: float) -> JointError | None:
        """Return the error of a use, with ``factor`` times the samples; 0 for samples at once."""
        cranks: list[Crank | None] = []
        if self._motion.samples:
            cranks = self._crank_states(use, self._recorded_samples(factor > 0.0), self._ticks)
            return error_of([self._distances_to_exact(cranks, slice(None))])
        apart = []
        for index, phase in enumerate(_PHASES):
            chosen = slice(index, None, len(_PHASES))
            ticks = self._ticks[chosen]
            cranks = self._crank_states(use, self._exact_samples(factor, phase, ticks), ticks)
            apart.append(self._distances_to_exact(cranks, chosen))
        return error_of([np.concatenate(apart)])

    def _distances_to_exact(self, cranks: Sequence[Crank | None], chosen: slice) -> Any:
        closure = self._motion.closure
        return joint_distances(closure, joints_at(closure, cranks)[0], self._exact[:, chosen])

    def _recorded_samples(self, delayed: bool) -> Callable[[int], Iterator[tuple[int, int]]]:
        """Return for a tick the samples of a bag that have come: stamps and arrivals."""
        samples = [(stamp, come if delayed else stamp) for stamp, come in self._motion.samples]
        arrivals = [come for _, come in samples]

        def samples_before(tick: int) -> Iterator[tuple[int, int]]:
            end = bisect_right(arrivals, tick)
            begin = max(0, end - _BEFORE)
            yield from samples[begin:end]

        return samples_before

    def _exact_samples(
        self, factor: float, phase: float, _ticks: Sequence[int]
    ) -> Callable[[int], Iterator[tuple[int, int]]]:
        """Return for a tick the samples before it, the newest a part of a period old."""
        period = 1e9 / (self._motion.sample_rate * factor)

        def samples_before(tick: int) -> Iterator[tuple[int, int]]:
            for index in range(_BEFORE - 1, -1, -1):
                stamp = tick - round((phase + index) * period)
                if stamp >= 0:
                    yield stamp, stamp

        return samples_before

    def _crank_states(
        self,
        use: TopicDrive,
        samples_before: Callable[[int], Iterator[tuple[int, int]]],
        ticks: Sequence[int],
    ) -> list[Crank | None]:
        """Return what a drive makes of the samples at each tick."""
        inputs = self._motion.closure.linkage.inputs
        cranks: list[Crank | None] = []
        for tick in ticks:
            drive = sample_inputs(use, True, inputs)
            for stamp, come in samples_before(tick):
                crank = cranks_at(self._motion, [stamp])[0]
                if crank is not None:
                    drive.offer(CrankSample(BEGIN + stamp, *crank), BEGIN + come)
            state = drive.state(BEGIN + tick)
            cranks.append(None if state is None else (state.angles, state.rates))
        return cranks


def _rates_missing(scene: Scene) -> list[str]:
    """Return the keys of the effects that publish rates, where they are missing."""
    missing = {
        scene_key(scene_linkage, 'effects')
        for scene_linkage in scene.linkages
        if not {'velocity', 'acceleration'} & set(scene_linkage.effects)
    }
    return [f'{key}.velocity' for key in sorted(missing)]


def _use_of(use: TopicDrive) -> str:
    if not use.carry_forward:
        return 'held'
    return 'carried forward' + (' with its acceleration' if use.acceleration != 'zero' else '')


def _rate_label(rate: float) -> str:
    return f'{rate / 1000.0:.4g} kHz' if rate >= 1000.0 else f'{rate:.4g} Hz'


def _integer_if_whole(rate: float) -> float | int:
    return round(rate) if float(rate).is_integer() else rate
