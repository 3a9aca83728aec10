# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The motion of a linkage in a recorded run, to be animated."""

from __future__ import annotations

from linkage_ros.errors import LinkageError
from linkage_ros.kinematics import check_planar, Curve, prepare_view, unwrap_angles, usual_inputs
from linkage_ros.tools.drawing import AnimatedMotion, count_of
from linkage_ros.tools.view.report.data import link_poses
from linkage_ros.tools.view.report.decimation import Numbers
from linkage_ros.tools.view.report.run import ReportedRun
import numpy as np

_SECONDS = 10.0
"""A longer part of a run is shown faster, in this time, if no other is named."""


def find_run_motion(run: ReportedRun, name: str, seconds: float | None) -> AnimatedMotion:
    """
    Return the motion of the first linkage of a run.

    ``seconds`` is the duration of the picture; None for the duration of the part, at most 10 s. A
    LinkageError is raised if the run has no joint states to show, or the time is too short or too
    long.
    """
    if not run.linkages or run.frames is None:
        raise LinkageError(name, 'has no scene to animate', 'name a bag of a linkage_node')
    linkage, frames = run.linkages[0], run.frames
    check_planar(name, linkage.closure.linkage)
    part = (frames.times >= run.window.since) & (frames.times <= run.window.until)
    if not part.any():
        reason = 'holds no joint states in this part'
        raise LinkageError(name, reason, 'name another part with --since and --until')
    since, until = int(frames.times[part][0]), int(frames.times[part][-1])
    lasts = (until - since) / 1e9
    seconds = min(max(lasts, 1.0), _SECONDS) if seconds is None else seconds
    count = count_of(seconds)
    instants = since + (until - since) * np.arange(count) // count
    # A state is shown until the next one, but not through a gap.
    chosen = np.maximum(np.searchsorted(frames.times, instants, side='right') - 1, 0)
    gaps = [(span.begin, span.end) for span in linkage.silent.in_order]
    unknown = np.zeros(count, bool)
    for begin, end in gaps:
        unknown |= (instants > begin) & (instants < end)
    found = link_poses(linkage.closure, linkage.prefix, frames.values, linkage.inputs)
    moved = np.where(unknown[:, None, None], np.nan, found.frames[chosen])
    speed = lasts / seconds
    title = name if abs(speed - 1.0) < 0.01 else f'{name}, {speed:.2g} times as fast'
    turning = dict(zip(linkage.joints, linkage.closure.turning, strict=True))
    begins = np.array([begin for begin, end in gaps if since < end and begin < until], np.int64)
    breaks = np.searchsorted(frames.times[part], begins, side='right')
    x = np.insert(frames.times[part], breaks, begins) / 1e9
    joints, values = [], []
    for joint, turns in turning.items():
        column = _unwrap_known(frames.values[joint]) if turns else frames.values[joint]
        y = np.insert(column[part], breaks, np.nan)
        joints.append(Curve(joint, turns, tuple(x.tolist()), tuple(y.tolist())))
        values.append(np.where(unknown, np.nan, column[chosen]))
    closure = linkage.closure
    return AnimatedMotion(
        title=title,
        view=prepare_view(closure, usual_inputs(closure)),
        repeats=False,
        links=found.links,
        frames=moved,
        x=instants / 1e9,
        x_name='time in the run',
        x_unit='s',
        joints=joints,
        values=np.column_stack(values),
    )


def _unwrap_known(angles: Numbers) -> Numbers:
    """Return angles without jumps; unknown ones stay unknown."""
    known = np.isfinite(angles)
    result = np.full(len(angles), np.nan)
    result[known] = unwrap_angles(angles[known].tolist())
    return result
