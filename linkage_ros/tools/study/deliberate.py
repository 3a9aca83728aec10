# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
What a scene makes different on purpose: each effect and each fault, its difference and its price.

The scene runs twice over the same times and crank messages, as it is and without the effect. Both
runs are compared as a listener has them, who holds the newest published state: so an effect that
withholds or delays states shows, too. An effect that only adds fields to the messages has a price
and no difference.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import islice
from math import inf, remainder, sqrt, tau
from typing import NamedTuple

from linkage_ros.description import Scene, SceneLinkage
from linkage_ros.errors import FileError, list_names
from linkage_ros.messages import JOINT_STATE_TYPE, MessageValues, POSITION
from linkage_ros.replay import turning_joints
from linkage_ros.stages.effects import effects_requiring, ForceEffect, in_order
from linkage_ros.tick import Pipeline
from linkage_ros.tools.study.budget import JointError, Knob, Setting
from linkage_ros.tools.study.budget_text import ALL_TOGETHER, share_text
from linkage_ros.tools.study.measuring import Progress
from linkage_ros.tools.study.prices import Feed, price_scenes, turn_crank, USUAL_RATE

_MOST_TICKS, _MOST_TICKS_QUICK, _FEWEST_TICKS = 20_000, 2_000, 200
_QUICK_RUNS, _QUICK_PRICES = 2.0, 2.0
"""Most time of a quick measurement for runs and for prices, in [s]."""

_SECONDS, _SECONDS_QUICK = 0.8, 0.2
"""Time to price one effect, in [s]."""


class Difference(NamedTuple):
    """How far two runs of a scene are apart for a listener."""

    error: JointError
    silent: float  # Share of the ticks at which the first publishes nothing and the second does


def published_states(
    scene: Scene, feed: Feed, ticks: int
) -> Iterator[tuple[bool, dict[str, float]]]:
    """Yield after each tick whether it published, and the newest published positions by joint."""
    pipeline = Pipeline(scene)
    injection = pipeline.injection
    reader = MessageValues(JOINT_STATE_TYPE, scene.dependent_joints)
    newest: dict[str, float] = {}
    last = 0
    for now, sample in islice(feed(scene, pipeline), ticks):
        if injection is not None:
            injection.advance(now)
            now = injection.tick_time(now)  # noqa: PLW2901 (a clock fault changes the tick's time)
            if now < last:  # As in the tick loop, where a clock jumps back
                pipeline = Pipeline(scene, pipeline.closures, injection)
            last = now
        if sample:
            pipeline.offer(sample, now)
        message = pipeline.tick(now).message
        if message:
            values = reader.read(message)
            assert not isinstance(values, str), 'our own messages can be read'
            newest = {
                name: number
                for (name, quantity), number in zip(values.keys, values.numbers, strict=True)
                if quantity == POSITION
            }
        yield bool(message), newest


def compare_runs(
    scene: Scene,
    others: Sequence[Scene],
    feed: Feed,
    ticks: int,
    progress: Progress = lambda _: None,
) -> list[Difference]:
    """Return how far the published joints of a scene are from each of the others."""
    turning = turning_joints(scene)
    sizes = {
        joint: scene_linkage.closure.scale
        for scene_linkage in scene.linkages
        for joint in scene_linkage.joint_names
    }
    compared = [_RunDifference() for _ in others]
    own, *runs = (published_states(variant, feed, ticks) for variant in (scene, *others))
    for tick, ((is_new, state), *others_now) in enumerate(zip(own, *runs, strict=True)):
        for comparison, (other_is_new, other_state) in zip(compared, others_now, strict=True):
            comparison.silent += other_is_new and not is_new
            if state and other_state and state != other_state:
                comparison.add_difference(
                    max(
                        abs(remainder(value - other_state[joint], tau))
                        if turning[joint]
                        else abs(value - other_state[joint]) / sizes[joint]
                        for joint, value in state.items()
                        if joint in other_state
                    )
                )
        if tick % 100 == 0:
            progress(tick / ticks)
    return [
        Difference(
            JointError(sqrt(comparison.squares / ticks), comparison.worst),
            comparison.silent / ticks,
        )
        for comparison in compared
    ]


class _RunDifference:
    """What is known so far of the difference of two runs."""

    def __init__(self) -> None:
        self.squares = self.worst = 0.0
        self.silent = 0

    def add_difference(self, difference: float) -> None:
        self.squares += difference * difference
        self.worst = max(self.worst, difference)


def leave_out(scene: Scene, names: frozenset[str]) -> Scene:
    """Return a scene without these effects, and without loads where no force is left."""
    return replace(
        scene,
        linkages=tuple(_without_effects(scene_linkage, names) for scene_linkage in scene.linkages),
        record=None,
    )


def _without_effects(scene_linkage: SceneLinkage, names: frozenset[str]) -> SceneLinkage:
    effects = {name: own for name, own in scene_linkage.effects.items() if name not in names}
    has_forces = scene_linkage.drive[1].gives_torque or any(
        effect.computes_forces for effect in effects.values()
    )
    return replace(
        scene_linkage, effects=effects, loads=scene_linkage.loads if has_forces else None
    )


class _Variant(NamedTuple):
    """A scene without one of its effects or faults."""

    name: str
    scene: Scene
    note: str


def _list_variants(scene: Scene) -> Iterator[_Variant]:
    """Yield the scene without each effect, without each fault, and without all."""
    effects = {name: use for linkage in scene.linkages for name, use in linkage.effects.items()}
    named = effects.keys()
    forces = tuple(name for name, use in effects.items() if isinstance(use, ForceEffect))
    for name in in_order(named):
        needed_by = effects_requiring(name, named)
        note = f'computed for {list_names(needed_by)} without it, too' if needed_by else ''
        # Friction without an effect that needs forces acts on nothing, and is refused.
        for others in ((), forces):
            less = leave_out(scene, frozenset({name, *others}))
            if _is_accepted(less):
                note = f'together with {others[0]}' if others else note
                yield _Variant(name, less, note)
                break
    for name, fault in scene.faults.items():
        faults = {key: fault for key, fault in scene.faults.items() if key != name}
        note = '' if fault.at else 'not injected by the scene itself: only when it is called for'
        yield _Variant(f'fault {name}', replace(scene, faults=faults, record=None), note)
    if len(named) + len(scene.faults) > 1:
        bare = leave_out(scene, frozenset(named))
        yield _Variant(ALL_TOGETHER, replace(bare, faults={}), '')


def _is_accepted(scene: Scene) -> bool:
    try:
        Pipeline(scene)
    except FileError:
        return False
    return True


def measure_deliberate(
    scene: Scene,
    *,
    quick: bool = False,
    horizon: float = 10.0,
    feed: Feed = turn_crank,
    tick: float = 0.0,
    progress: Progress = lambda _: None,
) -> list[Knob]:
    """
    Return a knob for each effect and fault of a scene, by size, and one for all of them together.

    The compared runs are as long as the horizon, in [s], or shorter if quick: then ``tick`` says
    what a tick takes, in [s].
    """
    variants = list(_list_variants(scene))
    if not variants:
        return []
    # Faults begin at set times: a shorter run would miss them.
    most = _MOST_TICKS if scene.faults or not quick else _MOST_TICKS_QUICK
    if quick and tick and not scene.faults:
        most = min(most, max(_FEWEST_TICKS, int(_QUICK_RUNS / ((1 + len(variants)) * tick))))
    ticks = max(1, min(most, round(horizon * (scene.rate or USUAL_RATE))))
    own = replace(scene, record=None)
    others = [variant.scene for variant in variants]
    differences = compare_runs(own, others, feed, ticks, lambda share: progress(0.5 * share))
    prices = price_scenes(
        own,
        others,
        (_SECONDS_QUICK if quick else _SECONDS) * (len(variants) + 1),
        feed,
        lambda share: progress(0.5 + 0.5 * share),
        _QUICK_PRICES if quick else inf,
    )
    drifts = any(scene_linkage.drive[1].gives_torque for scene_linkage in scene.linkages)
    after = ticks / (scene.rate or USUAL_RATE) if drifts else None
    knobs = [
        Knob(
            variant.name,
            # What the scene has more than the one without.
            (Setting('as the scene has it', difference.error, price.negate()),),
            0,
            after if difference.error.worst else None,
            is_deliberate=True,
            note=_variant_note(variant, difference),
        )
        for variant, difference, price in zip(variants, differences, prices, strict=True)
    ]
    return sorted(
        knobs,
        key=lambda knob: (
            knob.name != ALL_TOGETHER,
            knob.own_setting.error.worst,
            knob.own_setting.error.rms,
        ),
        reverse=True,
    )


def _variant_note(variant: _Variant, difference: Difference) -> str:
    parts = [
        variant.note,
        f'nothing is published at {share_text(difference.silent)} of the ticks'
        if difference.silent
        else '',
    ]
    return '; '.join(filter(None, parts))
