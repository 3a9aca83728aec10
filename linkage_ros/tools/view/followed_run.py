# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
What a page knows of a running node's scene, and of its messages.

In the plane the poses come from the published joints, as in the report, and not from the inputs by
the program of `linkage compile`: the page shows what the node has published, with its noise, play
and faults. In space they come from the inputs, as in the report.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import dist, isfinite, nan
from typing import Any, NamedTuple

from diagnostic_msgs.msg import DiagnosticStatus
from linkage_ros.bag import read_run_metadata, RunMetadata
from linkage_ros.cli import finite_or_none
from linkage_ros.description import Scene, SceneLinkage
from linkage_ros.errors import LinkageError, quote
from linkage_ros.kinematics import Closure, GROUND, PlanarClosure, SpaceClosure, SpaceDrawing
from linkage_ros.messages import CrankSample, MalformedError
from linkage_ros.replay import read_announced, recorded_scene
from linkage_ros.tools.view.model import model_of
from linkage_ros.tools.view.report import link_poses, spatial_places
import numpy as np

_LONGEST_LEAD = 0.25
"""Most time by which a crank sample is carried to the time of the joints, in [s]."""

_USUAL_EFFORT = 1.0
"""Range of the slider for an effort that has no limit, in [N·m] or [N]; more can be typed."""

_BY_TOPIC = ('topic', 'torque')
"""Drives that listen to a topic."""


class FollowedRun(NamedTuple):
    """The scene of a running node."""

    scene: Scene  # The scene
    metadata: RunMetadata  # The run's account of itself: its topics
    drawn_linkage: SceneLinkage  # The first linkage, which is drawn
    closure: Closure  # The closure of that one
    drawing: SpaceDrawing | None  # What is drawn of it in space; None in the plane
    # The linkage whose crank or effort comes from a topic; None if there is none.
    topic_driven: SceneLinkage | None
    model: dict[str, Any]  # What a page gets

    @property
    def crank_topic(self) -> str:
        """Return the topic of crank or effort; '' for none."""
        return self.metadata.crank_topic

    @property
    def drive_name(self) -> str:
        """Return the drive of the linkage that can be turned, else of the first one."""
        return (self.topic_driven or self.drawn_linkage).drive[0]

    def state_content(
        self, joints: CrankSample, crank: CrankSample | None, now: int
    ) -> dict[str, Any]:
        """
        Return the state of the joints, as a page gets it.

        ``crank`` has the newest inputs of the first linkage; None if they are unknown. ``now`` is
        in [ns].
        """
        names = self.scene.joint_names
        inputs = self._inputs_at(joints.stamp, crank)
        known = dict.fromkeys(self.drawn_linkage.joint_names, nan)
        known |= dict(zip(names, joints.angles, strict=True))
        known |= dict(zip(self.drawn_linkage.input_names, inputs, strict=True))
        rates = joints.rates or (nan,) * len(names)
        return {
            't': joints.stamp * 1e-9,
            'age': (now - joints.stamp) * 1e-9,
            'inputs': [finite_or_none(value) for value in inputs],
            'joints': {
                name: [finite_or_none(value), finite_or_none(rate)]
                for name, value, rate in zip(names, joints.angles, rates, strict=True)
            },
            'frames': self._link_frames(known),
        }

    def _inputs_at(self, stamp: int, crank: CrankSample | None) -> list[float]:
        """Return the inputs at the time of the joints; NaN where they are unknown."""
        if crank is None:
            return [nan] * len(self.drawn_linkage.input_names)
        lead = (stamp - crank.stamp) * 1e-9
        if crank.rates is None or abs(lead) > _LONGEST_LEAD:
            return list(crank.angles)
        return [angle + rate * lead for angle, rate in zip(crank.angles, crank.rates, strict=True)]

    def _link_frames(self, known: Mapping[str, float]) -> list[float] | None:
        """
        Return place and angle of the frame of each link; in space the places that are drawn.

        None if they are unknown.
        """
        input_names = self.drawn_linkage.input_names
        values = {name: np.array([value]) for name, value in known.items()}
        if self.drawing is not None:
            inputs = [values[name] for name in input_names]
            places = spatial_places(self.drawing, inputs)[0]
            return places.ravel().tolist() if np.isfinite(places).all() else None
        assert isinstance(self.closure, PlanarClosure)
        poses = link_poses(self.closure, self.drawn_linkage.prefix, values, input_names)
        if not set(self.model['links']) <= set(poses.links):
            return None
        order = [poses.links.index(link) for link in self.model['links']]
        frames = poses.frames[0][order]
        return frames.ravel().tolist() if np.isfinite(frames).all() else None


def read_run(message: bytes, topic: str) -> FollowedRun:
    """
    Read the message with the scene of a node; user-defined effects are not imported.

    A LinkageError is raised if it cannot be read or drawn.
    """
    try:
        announced = read_announced(message, topic)
        scene, account = recorded_scene(announced), read_run_metadata(announced)
        shown = scene.linkages[0]
        closure = shown.closure
        model = model_of(closure, scene.name)
        drawing = SpaceDrawing(closure) if isinstance(closure, SpaceClosure) else None
    except (ValueError, ArithmeticError, MalformedError) as error:
        raise LinkageError(topic, f'is not valid: {quote(str(error))}', 'name another') from None
    turned = next((linkage for linkage in scene.linkages if linkage.drive[0] in _BY_TOPIC), None)
    if not account.crank_topic:
        turned = None
    model |= {'live': _live_model(scene, closure, turned)}
    return FollowedRun(scene, account, shown, closure, drawing, turned, model)


def _live_model(
    scene: Scene, closure: Closure, topic_driven: SceneLinkage | None
) -> dict[str, Any]:
    """Return what a page shows of a scene in addition to the model of its first linkage."""
    shown = scene.linkages[0]
    inputs = closure.linkage.inputs
    return {
        'joints': [
            [name, 'rad' if turning else 'm']
            for scene_linkage in scene.linkages
            for name, turning in zip(
                scene_linkage.joint_names, scene_linkage.closure.turning, strict=True
            )
        ],
        'inputs': list(shown.input_names),
        'cranks': list(_ground_cranks(closure)),
        'turned': topic_driven is shown,
        'drive': (topic_driven or shown).drive[0],
        'efforts': [
            driven.limits.effort if isfinite(driven.limits.effort) else _USUAL_EFFORT
            for driven in inputs
        ],
        'linkages': len(scene.linkages),
    }


def _ground_cranks(closure: Closure) -> Iterator[list[float] | None]:
    """Yield pin and length of each crank on the ground of a plane: there the mouse turns it."""
    links = closure.linkage.links if isinstance(closure, PlanarClosure) else {}
    for driven in closure.linkage.inputs:
        points, ground = links.get(driven.child, {}), links.get(GROUND, {})
        pivots = [name for name in points if name in ground]
        if driven.unit != 'rad' or driven.parent != GROUND or not pivots:
            yield None
            continue
        reach = max(dist(point, points[pivots[0]]) for point in points.values())
        yield [*ground[pivots[0]], reach]


def diagnostics_content(statuses: Sequence[DiagnosticStatus]) -> dict[str, Any]:
    """Return what the newest diagnostics say of a node, as a page gets it."""
    values = {
        _task_name(status): {value.key: value.value for value in status.values}
        for status in statuses
    }
    tick, recording = values.get('tick', {}), values.get('recording', {})
    return {
        'ticks': tick.get('Actual frequency (Hz)', ''),
        'late': tick.get('Late by more than a period', ''),
        'lost': tick.get('Lost ticks', ''),
        'lateness': [
            tick.get(f'Lateness {quantity} (us)', '') for quantity in ('p50', 'p99', 'max')
        ],
        'diagnostics': [
            [status.level[0], f'{_task_name(status)}: {status.message}'] for status in statuses
        ],
        'memory': any(key.startswith('In memory') for key in recording),
        'recording': any(key.startswith('Recorded: ') for key in recording),
    }


def _task_name(status: DiagnosticStatus) -> str:
    return str(status.name.partition(': ')[2])
