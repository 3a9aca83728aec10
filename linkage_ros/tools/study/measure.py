# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Measure a scene: where its errors come from, what each digit costs, what it does on purpose."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from math import floor, inf
from pathlib import Path
from time import process_time

from linkage_ros.description import Scene
from linkage_ros.errors import FileError
from linkage_ros.messages import NANOSECONDS
from linkage_ros.tick import Pipeline
from linkage_ros.tools.study.age import measure_age_in_use, measure_age_of_command
from linkage_ros.tools.study.budget import Budget, Knob, RecordingLoss, Setting
from linkage_ros.tools.study.deliberate import measure_deliberate
from linkage_ros.tools.study.measuring import describe_machine, Progress
from linkage_ros.tools.study.member_motion import cranks_at, LinkageMotion, scene_key
from linkage_ros.tools.study.prices import add_prices, change_scene, Feed, tick_price, USUAL_RATE
from linkage_ros.tools.study.scene_motion import feed_of, motions_of

ERRORS, EFFECTS, RECORDING = 'errors', 'effects', 'recording'
PARTS = (ERRORS, EFFECTS, RECORDING)
"""The parts of a measurement."""

_SHARES = {ERRORS: 0.7, EFFECTS: 0.2, RECORDING: 0.1}

_QUICK_LEFT_OUT = '--quick: steps of a drive beyond its half and double, some rates, repetitions'

_QUICK_RUN = 0.5
"""Longest time that one run of the torque drives may take in a quick measurement, in [s]."""

_QUICK_DRIVE, _QUICK_PRICES, _QUICK_TICK = 4.0, 3.0, 0.7
"""Time that a quick measurement gives to the drives, to prices, and to the whole tick, in [s]."""


def measure_budget(
    scene: Scene,
    *,
    horizon: float = 10.0,
    like: str | None = None,
    quick: bool = False,
    parts: Sequence[str] = PARTS,
    progress: Progress = lambda _: None,
) -> Budget:
    """
    Measure a scene on this machine.

    Its motion is followed for ``horizon``, in [s]. ``like`` says what a topic drive's crank does,
    or which commands a torque drive gets: 'sine', or the path of a bag. A ``quick`` measurement
    takes less than 20 s, with fewer settings; ``parts`` are among `PARTS`. Recording is measured
    on the disk of the present folder. ``progress`` is called now and then with the fraction that
    is done; an exception from it ends the measurement.

    A LinkageError is raised if the scene has no motion, it runs away before the horizon, its loops
    do not close, or a package is not installed.
    """
    left_out: list[str] = [_QUICK_LEFT_OUT] if quick else []
    motions = motions_of(scene, like, horizon) if ERRORS in parts or like else []
    horizon = min([horizon, *(motion.length for motion in motions)])
    if quick and ERRORS in parts and (followed := _affordable_horizon(motions, horizon)) < horizon:
        horizon = followed
        left_out.append(f'--quick: what comes after {horizon:g} s')
    feed = feed_of(motions)
    done, whole = 0.0, sum(_SHARES[part] for part in parts)

    def part_progress(part: str) -> Progress:
        begin, share = done, _SHARES[part] / whole
        return lambda fraction: progress(min(1.0, begin + share * fraction))

    knobs: list[Knob] = []
    if ERRORS in parts:
        error_knobs, more = _measure_errors(
            scene, motions, horizon, quick, feed, part_progress(ERRORS)
        )
        knobs += sorted(error_knobs, key=lambda knob: knob.own_setting.error.worst, reverse=True)
        left_out += more
        done += _SHARES[ERRORS] / whole
    tick = tick_price(scene, 0.5 if quick else 3.0, feed, _QUICK_TICK if quick else inf)
    if EFFECTS in parts:
        knobs += measure_deliberate(
            scene,
            quick=quick,
            horizon=horizon,
            feed=feed,
            tick=1e-6 * tick.tick.middle,
            progress=part_progress(EFFECTS),
        )
        done += _SHARES[EFFECTS] / whole
    losses: list[RecordingLoss] = []
    if RECORDING in parts:
        from linkage_ros.tools.study.recording import (
            measure_recording,  # local import: it needs a disk
        )

        losses = measure_recording(
            scene, Path(), quick=quick, feed=feed, progress=part_progress(RECORDING)
        )
    progress(1.0)
    today = datetime.now().astimezone().date().isoformat()
    return Budget(
        scene.name,
        scene.rate or USUAL_RATE,
        tick,
        knobs,
        losses,
        [('measured', today), *describe_machine()],
        left_out,
    )


def _affordable_horizon(motions: Sequence[LinkageMotion], horizon: float) -> float:
    """Return how much of the motion a quick measurement has time to follow, in [s]."""
    sample = min(0.2, horizon)
    begun = process_time()
    for motion in motions:
        if motion.path is None:
            cranks_at(motion, [round(sample * NANOSECONDS)])
    speed = (process_time() - begun) / sample
    return min(horizon, max(1.0, floor(_QUICK_RUN / speed))) if speed else horizon


def _measure_errors(
    scene: Scene,
    motions: Sequence[LinkageMotion],
    horizon: float,
    quick: bool,
    feed: Feed,
    progress: Progress,
) -> tuple[list[Knob], list[str]]:
    """Return the knobs of all errors with their prices, and what was left out."""
    rate = scene.rate or USUAL_RATE
    knobs: list[Knob] = [measure_age_in_use(scene, motions, horizon, quick=quick)]
    left_out: list[str] = []
    integrated = sum(motion.path is None for motion in motions)
    progress(0.1)
    for motion in motions:
        if motion.scene_linkage.drive[1].gives_torque:
            from linkage_ros.tools.study.drive_step import (
                measure_drive_step,  # local import: few scenes have forces
            )

            knob, missing = measure_drive_step(
                motion,
                rate,
                horizon,
                key=scene_key(motion.scene_linkage, 'drive') + '.torque',
                quick=quick,
                seconds=(_QUICK_DRIVE if quick else 60.0) / integrated,
                progress=lambda share: progress(0.1 + 0.4 * share),
            )
            left_out += missing
        else:
            measured = measure_age_of_command(motion, scene, horizon, quick=quick)
            if measured is None:
                continue
            knob = measured
        of = f' of {motion.scene_linkage.name}' if motion.scene_linkage.name else ''
        knobs.append(knob._replace(name=knob.name + of))
    progress(0.5)
    from linkage_ros.tools.study.solving import (
        measure_solving,  # local import: optional dependencies
        unproved_reason,
    )

    unproved = [*filter(None, (unproved_reason(motion.closure) for motion in motions))]
    left_out += [f'solving: {reason}' for reason in dict.fromkeys(unproved)]
    if not unproved:
        seconds = 1.0 if quick else 8.0
        knobs.append(measure_solving(motions, rate, horizon, quick=quick, seconds=seconds))
    progress(0.7)
    knobs = [_accepted_settings(scene, knob) for knob in knobs]
    seconds, most = (_QUICK_PRICES, _QUICK_PRICES) if quick else (30.0, inf)
    priced = add_prices(
        scene, knobs, seconds, feed, lambda share: progress(0.7 + 0.3 * share), most
    )
    fewer = sum(len(knob.settings) for knob in knobs) - sum(len(knob.settings) for knob in priced)
    if fewer:
        left_out.append(f'for lack of time: {fewer} settings farther from the own one')
    return priced, left_out


def _accepted_settings(scene: Scene, knob: Knob) -> Knob:
    """Return a knob without the settings that the scene refuses."""
    own = knob.own_setting
    kept = [setting for setting in knob.settings if setting is own or _is_accepted(scene, setting)]
    return knob._replace(settings=kept, chosen=kept.index(own))


def _is_accepted(scene: Scene, setting: Setting) -> bool:
    if not any(key.rpartition('.')[0].endswith('torque') for key, _ in setting.changes or ()):
        return True
    try:
        Pipeline(change_scene(scene, setting.changes or ()))
    except FileError:
        return False
    return True
