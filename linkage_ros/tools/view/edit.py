# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
What a hand on the page changes: a pin that is dragged, a length that is typed, another input.

Each edit makes a new linkage of the old one; `view.linkage_rewriting` writes it into the text.
A link whose first point is the origin of its frame, and whose second lies on its x axis, keeps
that form: when one of the two is moved, its frame turns with them, and its centre of mass keeps
its share of the length. A pin in a slot moves along the slot.
"""

from __future__ import annotations

from cmath import phase, rect
from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import islice, product
from math import copysign, floor, log10, tau
from typing import Any, NamedTuple

from linkage_ros.description import FARTHEST, parse_yaml, written_linkage
from linkage_ros.errors import (
    DefinitionError,
    did_you_mean,
    FileError,
    LinkageError,
    list_names,
    quote,
)
from linkage_ros.kinematics import (
    assembly_sides,
    assur_groups,
    GROUND,
    Linkage,
    links_by_point,
    PlanarClosure,
    RevoluteJoint,
    usual_inputs,
    without_drawn_pose,
    written_sides,
)
from linkage_ros.tools.view.linkage_rewriting import rewrite_linkage

_NAME = 'the page'
_ROUNDED = 1e-10
"""Coordinates are written so finely, relative to the linkage's size."""

_SAME = 1e-6
"""Pins are in the same place if they are so near, relative to the linkage's size."""

_MOST_ASSEMBLIES = 64
"""Most assemblies among which the one of the pose is sought."""


class EditResult(NamedTuple):
    """The text after an edit, and the inputs at which the linkage is as it was shown."""

    text: str
    inputs: tuple[float, ...]


class _ShownLinkage(NamedTuple):
    """The linkage before the edit, in the pose that the page shows."""

    closure: PlanarClosure
    inputs: tuple[float, ...]
    frames: dict[str, tuple[complex, float]]
    pins: dict[str, complex]


class _LinkageChange(NamedTuple):
    """A changed linkage, and where its pins and inputs are now; pins as before if None."""

    linkage: Linkage
    pins: dict[str, complex] | None = None
    inputs: tuple[float, ...] | None = None


def edit_text(text: str, edit: Mapping[str, Any], name: str = _NAME) -> EditResult:
    """
    Return the text of a linkage file after an edit; `build_model` then shows whether it closes.

    The edit is one kind with its values, such as ``{'side': {'B': 'right'}}``, and ``inputs``, at
    which the page shows the linkage. Places and lengths are in [m], angles in [rad]; ``name`` is
    for errors.

    A FileError is raised if the text is not a linkage, a LinkageError if there is no such edit or
    it does not fit the linkage.
    """
    kind = next((key for key in edit if key in _KINDS), None)
    if kind is None:
        raise LinkageError(
            'edit', f'{quote(dict(edit))} is not an edit', f'send {list_names(_KINDS)}'
        )
    written, _ = written_linkage(parse_yaml(text.encode(), name))
    closure = PlanarClosure(written)
    shown = _shown_linkage(closure, edit.get('inputs'))
    change = _KINDS[kind](shown, edit)
    pins, inputs = change.pins or shown.pins, change.inputs or shown.inputs
    linkage = change.linkage
    if kind in ('pin', 'input'):
        linkage = _in_pose(linkage, inputs, pins, closure.scale)
    return EditResult(rewrite_linkage(text, name, linkage), inputs)


def pin_of(error: LinkageError, text: str) -> str | None:
    """Return the pin, slider or link that an error concerns; None if it names none."""
    try:
        written, _ = written_linkage(parse_yaml(text.encode('utf-8', 'replace'), _NAME))
    except LinkageError:
        return None
    names = {*links_by_point(written.links), *written.sliders, *written.links}
    where = error.key if isinstance(error, FileError) else error.where
    return next((part for part in reversed(str(where).split('.')) if part in names), None)


def _shown_linkage(closure: PlanarClosure, sent: Any) -> _ShownLinkage:
    count = len(closure.linkage.inputs)
    inputs = _default_inputs(closure) if sent is None else read_numbers('inputs', sent, count)
    position = closure.position(*inputs)
    if not position.status.has_pose:
        inputs = _default_inputs(closure)
        position = closure.position(*inputs)
        if not position.status.has_pose:  # several inputs
            raise _open_error()
    frames: dict[str, tuple[complex, float]] = {GROUND: (0j, 0.0)}
    link_frames = closure.link_frames
    frames |= dict(zip(link_frames.links, link_frames.frames_at(position), strict=True))
    points = closure.points(position)
    return _ShownLinkage(
        closure, inputs, frames, {point: place for (_, point), place in points.items()}
    )


def _default_inputs(closure: PlanarClosure) -> tuple[float, ...]:
    if len(closure.linkage.inputs) == 1 and not closure.closing_ranges:
        raise _open_error()
    return usual_inputs(closure)


def _open_error() -> LinkageError:
    return LinkageError('links', 'close nowhere, so no pose can be changed', 'undo')


def _move_pin(shown: _ShownLinkage, edit: Mapping[str, Any]) -> _LinkageChange:
    """Move a pin in the world; all others stay where they are."""
    linkage = shown.closure.linkage
    pin = _checked_name('pin', edit['pin'], shown.pins)
    to = complex(*read_numbers('to', edit.get('to'), 2))
    snap = edit.get('snap') or 0.0
    if snap:
        (snap,) = read_numbers('snap', [snap], 1)
        to = complex(*(snap * round(part / snap) for part in (to.real, to.imag)))
    for name, slider in linkage.sliders.items():
        if slider.point == pin and _is_line_fixed(linkage, name):
            to = _on_line(shown, name, to)
    pins = {**shown.pins, pin: to}
    links, masses = dict(linkage.links), dict(linkage.masses)
    moved_blocks = {slider.block for slider in linkage.sliders.values() if slider.point == pin}
    turned: dict[str, float] = {}
    for link, points in linkage.links.items():
        if pin not in points or link in moved_blocks:
            continue
        place, angle = shown.frames[link]
        frame = _own_frame(linkage, link, pin)
        if frame:
            start, end = (pins[name] for name in frame)
            if start == end:
                reason = f'{frame[0]} and {frame[1]} of {link} would be in one place'
                raise LinkageError(pin, reason, 'move it elsewhere')
            # The turn nearest to the old one: an input keeps its whole turns.
            new = angle + (phase(end - start) - angle + tau / 2) % tau - tau / 2
            turned[link] = new - angle
            if link in masses:
                longer = abs(end - start) / points[frame[1]][0]
                x, y = masses[link].center
                centre = (_rounded_value(shown, x * longer), y)
                masses[link] = replace(masses[link], center=centre)
            place, angle = start, new
        links[link] = {
            name: at
            if not frame and name != pin
            else _on_axis(_local_point(shown, pins[name], place, angle), name, frame)
            for name, at in points.items()
        }
    inputs = [
        _updated_slide(shown, driven.slider, pins, value)
        if driven.slider
        else value + turned.get(driven.child, 0.0) - turned.get(driven.parent, 0.0)
        for driven, value in zip(linkage.inputs, shown.inputs, strict=True)
    ]
    changed = replace(linkage, links=links, masses=masses)
    if linkage.pose is not None:
        changed = replace(changed, pose=replace(linkage.pose, inputs=tuple(inputs), points={
            name: (pins[name].real, pins[name].imag) for name in linkage.pose.points
        }))  # fmt: skip
    return _LinkageChange(changed, pins, tuple(inputs))


def _own_frame(linkage: Linkage, link: str, pin: str) -> tuple[str, str] | None:
    """Return the two points that make the frame of a link, if the pin is one of them."""
    points = list(linkage.links[link])
    if link == GROUND or len(points) < 2:
        return None
    if any(link in (slider.along, slider.block) for slider in linkage.sliders.values()):
        return None  # its frame also has the line of a slider
    origin, on_axis = points[:2]
    (x, y), (u, v) = linkage.links[link][origin], linkage.links[link][on_axis]
    return (origin, on_axis) if x == y == v == 0.0 < u and pin in (origin, on_axis) else None


def _on_axis(
    at: tuple[float, float], name: str, frame: tuple[str, str] | None
) -> tuple[float, float]:
    """Return a place without rounding errors: the points that make the frame lie on its axis."""
    if frame is None or name not in frame:
        return at
    return (0.0, 0.0) if name == frame[0] else (at[0], 0.0)


def _local_point(
    shown: _ShownLinkage, to: complex, place: complex, angle: float
) -> tuple[float, float]:
    """Return a place in the frame of a link, rounded."""
    at = (to - place) * rect(1.0, -angle)
    return _rounded_value(shown, at.real), _rounded_value(shown, at.imag)


def _rounded_value(shown: _ShownLinkage, value: float) -> float:
    return round(value, -floor(log10(shown.closure.scale * _ROUNDED)))


def _is_line_fixed(linkage: Linkage, name: str) -> bool:
    """Return whether the line of a slider stands where it is, whatever its point does."""
    along = linkage.sliders[name].along
    pins = links_by_point(linkage.links)
    return along == GROUND or sum(len(pins[point]) > 1 for point in linkage.links[along]) > 1


def _on_line(shown: _ShownLinkage, name: str, to: complex) -> complex:
    """Return the nearest place on the line of a slider."""
    slider = shown.closure.linkage.sliders[name]
    line_direction = slider.unit * rect(1.0, shown.frames[slider.along][1])
    through = shown.pins[slider.through]
    return through + line_direction * ((to - through) * line_direction.conjugate()).real


def _updated_slide(
    shown: _ShownLinkage, name: str, pins: Mapping[str, complex], before: float
) -> float:
    """Return the slide of a driven slider, of which an end may have moved."""
    slider = shown.closure.linkage.sliders[name]
    between = pins[slider.point] - pins[slider.through]
    if not _is_line_fixed(shown.closure.linkage, name):
        return copysign(abs(between), before)  # the line follows its point
    line_direction = slider.unit * rect(1.0, shown.frames[slider.along][1])
    return (between * line_direction.conjugate()).real


def _set_length(shown: _ShownLinkage, edit: Mapping[str, Any]) -> _LinkageChange:
    """Move a point of a link along the line to another one, so that they are so far apart."""
    content = _read_mapping('length', edit)
    linkage = shown.closure.linkage
    link, points = _read_link(linkage, content)
    first, second = (_checked_name(key, content.get(key), points) for key in ('from', 'to'))
    (length,) = read_numbers('value', [content.get('value')], 1)
    start, end = complex(*points[first]), complex(*points[second])
    if length <= 0.0 or start == end:
        raise LinkageError(
            f'links.{link}.{second}', f'{length:g} m is not a length', 'type one above 0'
        )
    to = start + (end - start) * (length / abs(end - start))
    return _place_point(shown, link, second, (to.real, to.imag))


def _edit_place(shown: _ShownLinkage, edit: Mapping[str, Any]) -> _LinkageChange:
    content = _read_mapping('place', edit)
    link, points = _read_link(shown.closure.linkage, content)
    point = _checked_name('point', content.get('point'), points)
    x, y = read_numbers('at', content.get('at'), 2)
    return _place_point(shown, link, point, (x, y))


def _place_point(
    shown: _ShownLinkage, link: str, point: str, at: tuple[float, float]
) -> _LinkageChange:
    linkage = shown.closure.linkage
    links = {**linkage.links, link: {**linkage.links[link], point: at}}
    return _LinkageChange(replace(linkage, links=links))


def _trace_point(shown: _ShownLinkage, edit: Mapping[str, Any]) -> _LinkageChange:
    content = _read_mapping('trace', edit)
    linkage = shown.closure.linkage
    link, points = _read_link(linkage, content)
    x, y = read_numbers('at', content.get('at'), 2)
    taken = {*links_by_point(linkage.links), *linkage.sliders, *linkage.links}
    free = (f'P{index or ""}' for index in range(len(taken) + 1))
    name = content.get('name', next(name for name in free if name not in taken))
    if not isinstance(name, str) or name in taken:
        raise LinkageError(
            'name', f'{quote(name)} is taken, or is not a name', 'send another name'
        )
    points = {**points, name: (_rounded_value(shown, x), _rounded_value(shown, y))}
    links = {**linkage.links, link: points}
    return _LinkageChange(replace(linkage, links=links, traced=(*linkage.traced, name)))


def _untrace_point(shown: _ShownLinkage, edit: Mapping[str, Any]) -> _LinkageChange:
    """Trace a point no more; one that nothing else needs goes."""
    linkage = shown.closure.linkage
    name = _checked_name('untrace', edit['untrace'], linkage.traced)
    carried = links_by_point(linkage.links)[name]
    links = dict(linkage.links)
    needed = {end for s in linkage.sliders.values() for end in (s.point, s.through)}
    if len(carried) == 1 and name not in needed and len(links[carried[0]]) > 2:
        (link,) = carried
        links[link] = {point: at for point, at in links[link].items() if point != name}
    traced = tuple(point for point in linkage.traced if point != name)
    return _LinkageChange(replace(linkage, links=links, traced=traced))


def _choose_input(shown: _ShownLinkage, edit: Mapping[str, Any]) -> _LinkageChange:
    """Drive another link on the ground; the joint that it had is published no more."""
    content = _read_mapping('input', edit)
    linkage = shown.closure.linkage
    link, points = _read_link(linkage, content)
    if len(linkage.inputs) != 1:
        raise LinkageError('input', 'this linkage has several', 'change them in the file')
    (old,) = linkage.inputs
    if link == GROUND or not {*points} & {*linkage.links[GROUND]}:
        raise LinkageError(link, 'has no pin on the ground', 'choose a link that has one')
    if old.slider or old.parent != GROUND:
        raise LinkageError('input', f'{old.joint} is not a crank on the ground', 'change the file')
    if link == old.child:
        return _LinkageChange(linkage)
    joints = {
        name: joint
        for name, joint in linkage.joints.items()
        if not (isinstance(joint, RevoluteJoint) and (joint.parent, joint.child) == (GROUND, link))
    }
    name = next((name for name in linkage.joints if name not in joints), f'{link}_joint')
    joints = {old.joint: RevoluteJoint(GROUND, old.child, old.limits), **joints}
    limits = next((linkage.joints[n].limits for n in linkage.joints if n == name), None)
    driven = replace(old, joint=name, child=link)
    if limits is not None:
        driven = replace(driven, limits=limits)
    inputs = (shown.frames[link][1],)
    changed = replace(linkage, inputs=(driven,), joints=joints)
    if linkage.pose is not None:
        changed = replace(changed, pose=replace(linkage.pose, inputs=inputs))
    return _LinkageChange(changed, inputs=inputs)


def _choose_side(shown: _ShownLinkage, edit: Mapping[str, Any]) -> _LinkageChange:
    linkage = shown.closure.linkage
    possible = assembly_sides(shown.closure.structure)
    chosen = _read_mapping('side', edit)
    for key, side in chosen.items():
        _checked_name('side', key, possible)
        if side not in possible[key]:
            remedy = f'choose {" or ".join(possible[key])}'
            raise LinkageError(f'assembly.{key}', f'{quote(side)} is not one of its sides', remedy)
    sides: Any = {**written_sides(shown.closure), **chosen}
    return _LinkageChange(
        replace(without_drawn_pose(linkage, shown.closure.structure), assembly=sides)
    )


_KINDS: dict[str, Callable[[_ShownLinkage, Mapping[str, Any]], _LinkageChange]] = {
    'pin': _move_pin,
    'length': _set_length,
    'place': _edit_place,
    'trace': _trace_point,
    'untrace': _untrace_point,
    'input': _choose_input,
    'side': _choose_side,
}


def _in_pose(
    linkage: Linkage, inputs: tuple[float, ...], pins: Mapping[str, complex], scale: float
) -> Linkage:
    """Return a linkage in the assembly in which its pins are where they are shown."""
    try:
        structure = assur_groups(linkage)
    except DefinitionError:  # the check of the text tells it with its place
        return linkage
    sides = assembly_sides(structure)
    linkage = without_drawn_pose(linkage, structure)
    written = {name: side for name, side in linkage.assembly.items() if name in sides}
    # First the assembly that is written.
    own = [
        sorted(possible, key=[written.get(name), *possible].index)
        for name, possible in sides.items()
    ]
    best, nearest = replace(linkage, assembly=written), float('inf')
    for chosen in islice(product(*own), _MOST_ASSEMBLIES):
        assembly: dict[str, Any] = dict(zip(sides, chosen, strict=True))
        candidate = replace(linkage, assembly=assembly)
        try:
            closure = PlanarClosure(candidate)
            position = closure.position(*inputs)
            points = closure.points(position) if position.status.has_pose else {}
        except DefinitionError:
            continue
        if not points:
            continue
        far = max(abs(place - pins[point]) for (_, point), place in points.items())
        if far < nearest:
            best, nearest = candidate, far
        if far < _SAME * scale:
            break
    return best


def _read_mapping(key: str, edit: Mapping[str, Any]) -> Mapping[str, Any]:
    content = edit[key]
    if not isinstance(content, dict):
        raise LinkageError(key, f'{quote(content)} is not an object', 'send an object')
    return content


def _read_link(
    linkage: Linkage, content: Mapping[str, Any]
) -> tuple[str, Mapping[str, tuple[float, float]]]:
    link = _checked_name('link', content.get('link'), linkage.links)
    return link, linkage.links[link]


def _checked_name(key: str, name: Any, names: Any) -> str:
    if not isinstance(name, str) or name not in names:
        raise LinkageError(
            key,
            f'{quote(name)} is not there',
            did_you_mean(str(name), list(names), f'send one of {list_names(names)}'),
        )
    return name


def read_numbers(key: str, values: Any, count: int) -> tuple[float, ...]:
    """Return ``count`` numbers that a page has sent."""
    if (
        not isinstance(values, list | tuple)
        or len(values) != count
        or not all(type(value) in (int, float) and abs(value) <= FARTHEST for value in values)
    ):
        expected = 'a number' if count == 1 else f'{count} numbers'
        raise LinkageError(key, f'{quote(values)} is not {expected}', 'send finite ones')
    return tuple(map(float, values))
