# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Write a linkage as the text of a linkage file, and its default scene.

Reading the text gives the same linkage. Short mappings are on one line, as in the files of the
package. Numbers are the shortest that read as the same floats; names are quoted if a reader of
YAML 1.1 or 1.2 could take them for something else.

Where a scene is expected, a linkage file stands for a default scene that moves the linkage. It
starts at `usual_inputs`. A single input turns at a constant rate, or swings through its range as a
sine; several inputs come from a topic. The default scene is text, read as any other scene file.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
import json
from math import asin, isfinite, isinf
from pathlib import Path
import re
from textwrap import wrap

from linkage_ros.description.file_access import atomic_write
from linkage_ros.description.linkage_file import read_any_closure
from linkage_ros.description.units import Units
from linkage_ros.description.yaml_file import parse_yaml
from linkage_ros.errors import DefinitionError
from linkage_ros.kinematics import (
    AssemblyPose,
    describe_ranges,
    Input,
    InputRange,
    InputSweep,
    Limits,
    Linkage,
    PlanarClosure,
    Ratio,
    RevoluteJoint,
    SlideJoint,
    Slider,
    SpaceLinkage,
    SpatialJoint,
    SpatialMass,
    starts_at_pose,
    usual_inputs,
)

_WIDTH = 99
_WHOLE = 1e15
"""Larger integers are easier to read with an exponent."""

_PLAIN = re.compile(r'[^\W\d][\w.-]*')
_WORDS = {'yes', 'no', 'on', 'off', 'true', 'false', 'null'}
"""Words that YAML does not read as strings; YAML 1.1 has more of them than 1.2."""

Content = float | str | list['Content'] | dict[str, 'Content']

_IN_ROWS = (
    *('links', 'sliders', 'joints', 'ratios', 'masses'),
    *('points', 'hinges', 'slides', 'struts'),
)
"""Keys whose parts have a line each, even if short."""

_PART = 0.96
"""Fraction of its range through which an input swings: many ranges end at a toggle."""

_PERIOD = 4.0
"""Period of the swing, in [s]."""

_SAME = 1e-9
"""Distance beyond the end of a range that still counts as the end, in [rad] or of a length."""


def linkage_text(linkage: Linkage | SpaceLinkage, comment: Sequence[str] = ()) -> str:
    """
    Return the text of a linkage file; ``comment`` has the paragraphs of the comment at the top.

    The numbers must be finite and the names printable.
    """
    lines = list(_comment_lines(comment))
    content = content_of(linkage) if isinstance(linkage, Linkage) else _space_content(linkage)
    for key, value in content.items():
        lines += _entry_lines(key, value, '', in_rows=key in _IN_ROWS)
    return '\n'.join(lines) + '\n'


def write_linkage(
    linkage: Linkage | SpaceLinkage, file: str | Path, comment: Sequence[str] = ()
) -> None:
    """
    Write or replace a linkage file atomically, as `linkage_text`; a symbolic link is followed.

    A LinkageError says that it cannot be written, or that its text would not be a valid linkage.
    """
    data = linkage_text(linkage, comment).encode()
    read_any_closure(parse_yaml(data, str(file)))
    atomic_write(file, data)


def number_text(value: float) -> str:
    """Return the shortest text that every YAML reader reads as the same float."""
    value = float(value)
    if isinf(value):
        return '.inf' if value > 0.0 else '-.inf'
    written = repr(value)
    if value.is_integer() and abs(value) < _WHOLE and written != '-0.0':
        return str(int(value))
    mantissa, e, exponent = written.partition('e')
    # YAML 1.1 requires a decimal point in a number with an exponent.
    return f'{mantissa}.0e{exponent}' if e and '.' not in mantissa else written


def content_of(linkage: Linkage) -> dict[str, Content]:
    """Return the content of the file in its order, without optional entries that are empty."""
    inputs: list[Content] = [_input_content(driven) for driven in linkage.inputs]
    axes = ''.join(linkage.axes)
    content: dict[str, Content] = {
        'axes': '' if axes == 'xy' else axes,
        'links': {
            link: {name: [*point] for name, point in points.items()}
            for link, points in linkage.links.items()
        },
        'sliders': {name: _slider_content(slider) for name, slider in linkage.sliders.items()},
        'input': inputs[0] if len(inputs) == 1 else inputs,
        'assembly': dict(linkage.assembly),
        'pose': _pose_content(linkage.pose),
        'joints': {name: _joint_content(joint) for name, joint in linkage.joints.items()},
        'ratios': {name: _ratio_content(ratio) for name, ratio in linkage.ratios.items()},
        'traced': [*linkage.traced],
        'masses': {
            link: {'mass': mass.mass, 'center': [*mass.center], 'inertia': mass.inertia}
            for link, mass in linkage.masses.items()
        },
    }
    needed = ('links', 'input', 'joints')
    return {key: value for key, value in content.items() if value or key in needed}


def _space_content(linkage: SpaceLinkage) -> dict[str, Content]:
    """Return the content of a spatial file, without optional entries that are empty."""
    driven = linkage.driven
    content: dict[str, Content] = {
        'points': {name: [*place] for name, place in linkage.points.items()},
        'links': {link: [*points] for link, points in linkage.links.items()},
        'hinges': {
            name: _pair_content(joint, {'at': [*joint.at]})
            for name, joint in linkage.hinges.items()
        },
        'slides': {name: _pair_content(joint, {}) for name, joint in linkage.slides.items()},
        'struts': {name: [*pair] for name, pair in linkage.struts.items()},
        'input': driven[0] if len(driven) == 1 else [*driven],
        'joints': [name for name in linkage.published if name not in driven],
        'ratios': {name: _ratio_content(ratio) for name, ratio in linkage.ratios.items()},
        'traced': [*linkage.traced],
        'masses': {link: _body_content(body) for link, body in linkage.masses.items()},
    }
    return {key: value for key, value in content.items() if value or key == 'points'}


def _pair_content(joint: SpatialJoint, place: dict[str, Content]) -> dict[str, Content]:
    value: dict[str, Content] = {'value': joint.value} if joint.value else {}
    ends: dict[str, Content] = {'parent': joint.parent, 'child': joint.child}
    return {**ends, **place, 'axis': [*joint.axis], **value, **_limits_content(joint.limits)}


def _body_content(body: SpatialMass) -> dict[str, Content]:
    place: dict[str, Content] = {'center': [*body.center], 'inertia': [*body.inertia]}
    return {'mass': body.mass, **(place if body.mass else {})}


def _slider_content(slider: Slider) -> dict[str, Content]:
    block: dict[str, Content] = (
        {'block': slider.block, 'angle': slider.angle} if slider.block else {}
    )
    return {
        'point': slider.point,
        **block,
        'along': slider.along,
        'through': slider.through,
        'direction': [*slider.direction],
    }


def _input_content(driven: Input) -> dict[str, Content]:
    limits = _limits_content(driven.limits)
    if driven.slider:
        return {'joint': driven.joint, 'slider': driven.slider, **limits}
    return {'joint': driven.joint, 'parent': driven.parent, 'child': driven.child, **limits}


def _joint_content(joint: RevoluteJoint | SlideJoint) -> dict[str, Content]:
    limits = _limits_content(joint.limits)
    if isinstance(joint, SlideJoint):
        return {'slider': joint.slider, **limits}
    turns: dict[str, Content] = {'turns': joint.turns} if joint.turns else {}
    return {'parent': joint.parent, 'child': joint.child, **turns, **limits}


def _ratio_content(ratio: Ratio) -> dict[str, Content]:
    offset: dict[str, Content] = {'offset': ratio.offset} if ratio.offset else {}
    also: dict[str, Content] = {'also': {**ratio.also}} if ratio.also else {}
    return {'of': ratio.of, 'ratio': ratio.ratio, **also, **offset}


def _limits_content(limits: Limits) -> dict[str, Content]:
    bounds: dict[str, Content] = {'limits': [limits.low, limits.high]} if limits.is_bounded else {}
    for key in ('velocity', 'effort'):
        if isfinite(value := getattr(limits, key)):
            bounds[key] = value
    return bounds


def _pose_content(pose: AssemblyPose | None) -> dict[str, Content]:
    if pose is None:
        return {}
    content: dict[str, Content] = {'inputs': [*pose.inputs]}
    if pose.points:
        content['points'] = {name: [*point] for name, point in pose.points.items()}
    if pose.angles:
        content['angles'] = dict(pose.angles)
    return content


def pose_text(linkage: Linkage, pose: AssemblyPose, units: Units) -> str:
    """Return the line of a pose for a linkage file in some units, with seven digits."""

    def in_file_unit(value: float, unit: str) -> float:
        return float(f'{units.to_file_unit(value, unit):.7g}') + 0.0

    driven = zip(pose.inputs, linkage.inputs, strict=True)
    rounded = AssemblyPose(
        tuple(in_file_unit(value, driven_joint.unit) for value, driven_joint in driven),
        {
            name: (in_file_unit(x, 'm'), in_file_unit(y, 'm'))
            for name, (x, y) in pose.points.items()
        },
        {link: in_file_unit(angle, 'rad') for link, angle in pose.angles.items()},
    )
    return f'pose: {_flow_text(_pose_content(rounded))}'


def _comment_lines(paragraphs: Sequence[str]) -> Iterator[str]:
    for paragraph in paragraphs:
        for line in paragraph.splitlines() or ['']:
            printing = ''.join(c if c.isprintable() else ' ' for c in line)
            # A long word stays whole: it may be a command or a path.
            wrapped = wrap(printing, _WIDTH - 2, break_long_words=False, break_on_hyphens=False)
            yield from (f'# {part}' for part in wrapped) if wrapped else ['#']


def _entry_lines(
    name: str, value: Content, indent: str, *, in_rows: bool = False
) -> Iterator[str]:
    """Yield the lines of a key: one line if it fits and need not be in rows, else one per part."""
    key = f'{indent}{_name_text(name)}:'
    line = f'{key} {_flow_text(value)}'
    inner = indent + '  '
    if not isinstance(value, dict | list) or not value or not (in_rows or len(line) > _WIDTH):
        yield line
        return
    yield key
    if isinstance(value, dict):
        for part, of in value.items():
            yield from _entry_lines(part, of, inner)
    else:
        yield from (f'{inner}- {_flow_text(part)}' for part in value)


def _flow_text(value: Content) -> str:
    if isinstance(value, dict):
        entries = (f'{_name_text(key)}: {_flow_text(part)}' for key, part in value.items())
        return f'{{{", ".join(entries)}}}'
    if isinstance(value, list):
        return f'[{", ".join(map(_flow_text, value))}]'
    return _name_text(value) if isinstance(value, str) else number_text(value)


def _name_text(name: str) -> str:
    if _PLAIN.fullmatch(name) and name.lower() not in _WORDS:
        return name
    return json.dumps(name, ensure_ascii=False)  # its escapes are valid in YAML


def scene_text_for(closure: PlanarClosure, file: str) -> str:
    """
    Return the text of a linkage's default scene, which names its file.

    A DefinitionError says that the pose starts where no loop closes.
    """
    return (
        '# What a linkage file alone stands for where a scene is expected.\n'
        f'linkage: {file}\n'
        'rate: 1000\n'
        f'drive: {_drive_text(closure)}\n'
        'effects: {velocity: {}}\n'
    )


def _drive_text(closure: PlanarClosure) -> str:
    if len(closure.linkage.inputs) > 1:
        return '{topic: {}}'
    start, interval = _find_start(closure)
    if interval.is_whole:
        return f'{{constant_rate: {{rate: 1, start: {number_text(start)}}}}}'
    left_out = 0.5 * (1.0 - _PART) * (interval.highest - interval.lowest)
    low, high = (
        end if by else end + inwards
        for end, inwards, by in zip(interval[:2], (left_out, -left_out), interval.by, strict=True)
    )
    # If the start lies in the margin at an end of the range, the swing reverses there.
    low, high = min(low, start), max(high, start)
    mean, amplitude = 0.5 * (low + high), 0.5 * (high - low)
    sine = min(max((start - mean) / amplitude, -1.0), 1.0) if amplitude else 0.0
    entries = {
        'amplitude': amplitude,
        'frequency': 1.0 / _PERIOD,
        'mean': mean,
        'phase': asin(sine),
    }
    return f'{{sine: {{{", ".join(f"{key}: {number_text(of)}" for key, of in entries.items())}}}}}'


def _find_start(closure: PlanarClosure) -> tuple[float, InputRange]:
    """Return the start of the single input, and the range that contains it."""
    way, pose = InputSweep(closure), closure.linkage.pose
    if pose is None or not starts_at_pose(closure):
        (start,) = usual_inputs(closure)
        # The usual input may lie next to a range that is as narrow as its rounding.
        interval = way.range_about(start) or way.widest_range
        assert interval is not None, 'reading the file has proved that it closes somewhere'
        return start, interval
    (start,) = pose.inputs
    near = _SAME * (1.0 if way.turning else closure.scale)
    for value in (start, start - near, start + near):
        interval = way.range_about(value)
        if interval is not None:
            if not interval.is_whole:
                start = min(max(start, interval.lowest), interval.highest)
            return start, interval
    raise DefinitionError(
        'pose.inputs',
        f'no loop closes at {start:g} {"rad" if way.turning else "m"}',
        f'start within {describe_ranges(way.ranges)}',
    )
