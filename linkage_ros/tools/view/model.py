# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The model of a linkage: all that the page of `linkage view` needs, as JSON.

The page moves it by the program: JavaScript that `kinematics.compiling` writes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain, combinations
from math import degrees, dist, inf, isfinite, radians
from typing import Any, NamedTuple

from linkage_ros.cli import finite_or_none
from linkage_ros.description import (
    checked_closure,
    find_closures,
    is_planar_file,
    linkage_notes,
    parse_yaml,
    read_any_closure,
    Section,
    Units,
    written_linkage,
)
from linkage_ros.errors import DefinitionError, FileError
from linkage_ros.kinematics import (
    assembly_sides,
    Closure,
    driven_links,
    GROUND,
    InputSweep,
    is_iterated,
    Linkage,
    links_by_point,
    PlanarClosure,
    prepare_view,
    SpaceClosure,
    SpaceDrawing,
    Status,
    usual_inputs,
    written_sides,
)
from linkage_ros.tools.drawing import drawn_in_frames, pose_in_frames, space_page_data
from linkage_ros.tools.models.source_code import JavaScript, STATUSES, Subject, write_source
import numpy as np

_STATUSES = {name: index for index, name in enumerate(STATUSES)}

_SAMPLES = 180
"""Number of inputs at which transmission angle and margin are computed."""

_MOST_GHOSTS = 7
"""Most other assemblies."""

_MOST_PAIRS = 3
"""Points of a link of which every two have a length; of more, those from the first one."""

_POOR = radians(30.0)
"""Transmission angle below which a page warns; textbooks ask for 30 to 45°."""


class ViewState(NamedTuple):
    """How a page shows a linkage: at which inputs, and half the width of its bars, in [m]."""

    inputs: tuple[float, ...]
    size: float


def build_model(
    text: str, name: str, *, whole: bool = True, shown: ViewState | None = None
) -> dict[str, Any]:
    """
    Return the model of a linkage file; the name is for errors and the title.

    With ``whole`` it has what takes longer too: other assemblies, ranges, quality, warnings.
    ``shown`` is how the page shows the linkage during a drag. Where it closes so, a linkage of
    pins is not searched for its ranges, and its ``drawn`` has neither ``frame`` nor ``paths``.

    A FileError is raised if the text is not a linkage that closes.
    """
    content = parse_yaml(text.encode(), name)
    if not is_planar_file(content):
        return model_of(read_any_closure(content, name), name, text, content)
    written, shorthand = written_linkage(content)
    try:
        quick = (
            None if whole or shown is None else _quick_model(written, name, text, content, shown)
        )
    except DefinitionError:  # which the checks tell with its place
        quick = None
    if quick:
        return quick
    closure = checked_closure(content, written, name, shorthand)
    try:
        inputs = usual_inputs(closure)
        drawn = drawn_in_frames(prepare_view(closure, inputs))
        model = _model_json(closure, name, text, content.units, inputs, drawn)
        if whole:
            model['others'] = _other_assemblies(closure, content)
            model |= _analyse_linkage(closure, content)
    except DefinitionError as error:
        raise content.locate_error(error) from None
    return model


def model_of(
    closure: Closure, name: str = '', text: str = '', content: Section | None = None
) -> dict[str, Any]:
    """Return the model of a linkage without its other assemblies."""
    inputs, content = usual_inputs(closure), content or Section('', '', {'units': 'm'})
    name, analysed = name or closure.name, _analyse_linkage(closure, content)
    if isinstance(closure, SpaceClosure):
        model = _space_json(closure, name, text, content.units, inputs)
    else:
        planar: Any = closure
        drawn = drawn_in_frames(prepare_view(planar, inputs))
        model = _model_json(planar, name, text, content.units, inputs, drawn)
    return model | {'others': [], **analysed}


def _space_json(
    closure: SpaceClosure, name: str, text: str, units: Units, inputs: tuple[float, ...]
) -> dict[str, Any]:
    """Return what a page needs of a spatial linkage: frames are places of its drawing."""
    shown, drawing = prepare_view(closure, inputs), SpaceDrawing(closure)
    positions = (shown.position, *shown.ghosts)
    seen = np.array([drawing.places(position) for position in positions])
    return {
        **_motion_json(closure, name, text, units, inputs),
        'links': [],
        'driven': [],
        'drawn': space_page_data(drawing, seen),
        'pins': [
            {'name': point, 'links': [], 'link': row, 'at': [], 'ground': False}
            for point, row in drawing.points.items()
        ],
        'sliders': [], 'lengths': [], 'choices': {}, 'inputs_possible': [],
    }  # fmt: skip


def _quick_model(
    written: Linkage, name: str, text: str, content: Section, shown: ViewState
) -> dict[str, Any] | None:
    """Return the model of a linkage as it is shown; None if it does not close, or slides."""
    closure = PlanarClosure(written, name)
    if written.sliders or closure.bounds or len(shown.inputs) != len(written.inputs):
        return None
    position = closure.position(*shown.inputs)
    if not position.joints or is_iterated(closure):
        return None
    drawn = pose_in_frames(closure, position, shown.size)
    return _model_json(closure, name, text, content.units, shown.inputs, drawn)


def _model_json(
    closure: PlanarClosure, name: str, text: str, units: Units, inputs: tuple[float, ...],
    drawn: dict[str, Any],
) -> dict[str, Any]:  # fmt: skip
    linkage = closure.linkage
    carried = links_by_point(linkage.links)
    sides, now = assembly_sides(closure.structure), written_sides(closure)
    return {
        **_motion_json(closure, name, text, units, inputs),
        'links': list(closure.link_frames.links),
        'driven': sorted(driven_links(closure)),
        'drawn': drawn,
        'pins': [
            {
                'name': pin,
                'links': links,
                'link': links[0],
                'at': list(linkage.links[links[0]][pin]),
                'ground': GROUND in links,
            }
            for pin, links in carried.items()
        ],
        'sliders': [
            {
                'name': slider,
                'along': its.along,
                'through': list(linkage.links[its.along][its.through]),
                'direction': list(its.direction),
                'point': its.point,
            }
            for slider, its in linkage.sliders.items()
        ],
        'lengths': list(_point_distances(closure)),
        'choices': {key: {'now': now.get(key), 'sides': list(of)} for key, of in sides.items()},
        'inputs_possible': [
            link
            for link, points in linkage.links.items()
            if link != GROUND and {*points} & {*linkage.links.get(GROUND, {})}
        ],
    }


def _motion_json(
    closure: Closure, name: str, text: str, units: Units, inputs: tuple[float, ...]
) -> dict[str, Any]:
    """Return what a page needs to know of any linkage to move it."""
    program = program_of(closure)
    return {
        'name': name,
        'text': text,
        'inputs': [
            {
                'name': driven.joint,
                'unit': driven.unit,
                'low': finite_or_none(driven.limits.low),
                'high': finite_or_none(driven.limits.high),
                'value': value,
            }
            for driven, value in zip(closure.linkage.inputs, inputs, strict=True)
        ],
        'joints': [
            {'name': joint, 'unit': 'rad' if turning else 'm'}
            for joint, turning in zip(closure.joint_names, closure.turning, strict=True)
        ],
        'program': program,
        'poses': [] if program else _range_poses(closure, inputs),
        'unit': {'length': units.length, 'factor': units.to_si(1.0, 'm')},
    }


def program_of(closure: Any) -> str | None:
    """Return the program of a linkage; None if it is solved by iteration."""
    subject = Subject(closure, closure.name, closure.name, 2, closure.joint_names, frames=True)
    try:
        return write_source(subject, JavaScript(for_page=True))
    except DefinitionError:
        return None


def _range_poses(closure: Closure, inputs: tuple[float, ...]) -> list[dict[str, Any]]:
    """Return poses over the range of the first input, the others held."""
    sweep = InputSweep(closure, inputs)
    values = {inputs[0]}
    for interval in sweep.ranges:
        step = (interval.highest - interval.lowest) / _SAMPLES
        values |= {interval.lowest + step * i for i in range(_SAMPLES + 1)}
    states = [(value, *inputs[1:]) for value in sorted(values)]
    return [{'inputs': list(state), **compute_pose(closure, state)} for state in states]


def _point_distances(closure: PlanarClosure) -> Iterator[dict[str, Any]]:
    """Yield the distances of points of a link, those that a file gives by coordinates."""
    for link, points in closure.linkage.links.items():
        pairs = list(combinations(points, 2))
        if len(points) > _MOST_PAIRS:
            pairs = [(start, end) for start, end in pairs if start == next(iter(points))]
        for start, end in pairs:
            yield {
                'key': f'{link} {start}–{end}',
                'link': link,
                'from': start,
                'to': end,
                'value': dist(points[start], points[end]),
            }


def _other_assemblies(closure: PlanarClosure, content: Section) -> list[dict[str, Any]]:
    """Return the other assemblies in which the linkage closes."""
    try:
        closures = find_closures(content, closure.name)
    except FileError:  # it has none, or too many to choose from
        return []
    own = written_sides(closure)
    others = [
        (text, assembly) for text, assembly in closures.items() if assembly.linkage.assembly != own
    ]
    return [
        {'text': text, 'program': program_of(assembly)} for text, assembly in others[:_MOST_GHOSTS]
    ]


def _analyse_linkage(closure: Closure, content: Section) -> dict[str, Any]:
    """Return ranges, toggles, quality over the first input, and warnings."""
    sweep = InputSweep(closure, usual_inputs(closure))
    values: list[float] = []
    for interval in sweep.ranges:
        # Its ends are toggles as a rule, where a curve is steepest.
        count = max(2, _SAMPLES // len(sweep.ranges))
        step = (interval.highest - interval.lowest) / (count - 1)
        values += [interval.lowest + step * i for i in range(count - 1)] + [interval.highest]
    margins = [_quality_at(closure, sweep, value) for value in values]
    angles, conditioning = ([finite_or_none(margin[i]) for margin in margins] for i in (0, 1))
    return {
        'ranges': [[interval.lowest, interval.highest] for interval in sweep.ranges],
        'toggles': [
            place.value for place in closure.singular_inputs if place.status is Status.TOGGLE
        ],
        'quality': {'input': values, 'transmission_angle': angles, 'margin': conditioning},
        'warnings': list(
            _linkage_warnings(closure, content, [angle for angle in angles if angle is not None])
        ),
    }


def _quality_at(closure: Closure, sweep: InputSweep, value: float) -> tuple[float, float]:
    """Return transmission angle and conditioning at an input; infinite if they are unknown."""
    position = sweep.position_at(value)
    if not position.joints:
        return inf, inf
    margin = closure.singularity_margin(position)
    if margin.group < 0:
        return inf, inf
    return margin.transmission_angle, margin.conditioning


def _linkage_warnings(closure: Closure, content: Section, angles: list[float]) -> Iterator[str]:
    for note in linkage_notes(closure.linkage, content):
        yield str(note)
    if angles and min(angles) < _POOR:
        yield f'transmission angle down to {round(degrees(min(angles)), 2):g}°'
    passed = [place for place in closure.singular_inputs if place.status is not Status.TOGGLE]
    if passed:
        kinds = ' and '.join(dict.fromkeys(place.status.value for place in passed))
        yield f'{kinds} at {len(passed)} input{"s" if len(passed) > 1 else ""}'


def compute_pose(closure: Any, inputs: Sequence[float]) -> dict[str, Any]:
    """Return a pose as the program would, if a linkage has none; rates at a first input of 1."""
    position = closure.position(*inputs)
    pose: dict[str, Any] = {
        'status': _STATUSES[position.status.name],
        'joints': list(position.joints),
        'rates': [],
        'accelerations': [],
        'frames': [],
        'frameRates': [],
    }
    if not position.joints:
        return pose
    in_space = isinstance(closure, SpaceClosure)
    if in_space:
        pose['frames'] = SpaceDrawing(closure).places(position).ravel().tolist()
    else:
        pose['frames'] = _flatten_frames(closure.link_frames.frames_at(position))
    if position.status.has_rates:
        rest = [0.0] * (len(inputs) - 1)
        velocity = closure.velocity(position, 1.0, *rest)
        acceleration = closure.acceleration(position, velocity, 0.0, *rest)
        motion = {
            'rates': list(velocity.joints),
            'accelerations': list(acceleration.joints),
            'frameRates': []
            if in_space
            else _flatten_frames(closure.link_frames.frame_rates(position, velocity)),
        }
        # Next to a toggle they may be larger than a number can be.
        if all(map(isfinite, chain(*motion.values()))):
            pose |= motion
    return pose


def _flatten_frames(frames: Sequence[tuple[complex, float]]) -> list[float]:
    return [value for place, angle in frames for value in (place.real, place.imag, angle)]
