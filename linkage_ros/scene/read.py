# Copyright 2026 The linkage_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.


"""A section of a file, read into the parameters that a drive, an effect or a fault declares."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import MISSING
from os.path import join
from typing import Any

from linkage_ros.errors import did_you_mean, listed, quoted
from linkage_ros.kinematics.linkage import GROUND, Linkage
from linkage_ros.parameters import (
    Choice,
    declared,
    Each,
    File,
    Flag,
    Group,
    Kind,
    Name,
    Names,
    Number,
    Numbers,
    Point,
    Rows,
    Text,
)
from linkage_ros.scene.section import Section

Parts = Mapping[str, Sequence[str]]
"""For each kind of part the names that there are."""


def parts_of(linkage: Linkage) -> Parts:
    """Return the parts of a linkage that parameters can name, by their kind."""
    points = [point for carried in linkage.links.values() for point in carried]
    # A point in a slot is a pin of its link and the block that the slot stands for.
    points += [slider.point for slider in linkage.sliders.values() if not slider.block]
    pins = {point: None for point in points if points.count(point) > 1}
    return {
        'joint': tuple(linkage.joints),
        'input': tuple(given.joint for given in linkage.inputs),
        'pin': (*pins, *linkage.sliders),
        'link': tuple(link for link in linkage.links if link != GROUND),
        'body': tuple(linkage.links),
        'point': tuple(f'{link}.{p}' for link, carried in linkage.links.items() for p in carried),
    }


def read_parameters(content: Section, of: Any, parts: Parts, folder: str = '') -> Any:
    """
    Read parameters.

    Parameters
    ----------
    content
        The section.
    of
        Their type.
    parts
        What they may name.
    folder
        To which the paths of files are relative.

    Raises
    ------
    FileError
        With line and key of what is wrong, what was expected, and the nearest name.

    """
    values = {}
    for each, kind in declared(of):
        if each.name in content or (each.default is MISSING and each.default_factory is MISSING):
            values[each.name] = _value(content, each.name, kind, parts, folder)
    content.finish([each.name for each, _ in declared(of)])
    return of(**values)


def _value(content: Section, key: str, kind: Kind, parts: Parts, folder: str) -> Any:
    match kind:
        case Number():
            return _number(content, key, kind)
        case Numbers():
            return tuple(content.numbers(key, most=kind.most))
        case Rows():
            return content.rows(key, kind.columns, most=kind.most)
        case Flag():
            return content.flag(key)
        case Choice():
            return content.choice(key, kind.words)
        case Text():
            return content.text(key)
        case File():
            return join(folder, content.text(key))  # noqa: PTH118 (Path's raises on a NUL)
        case Point():
            return content.point(key, most=kind.most)
        case Name():
            return _known(content, key, content.text(key), kind.kind, parts)
        case Names():
            found = content.texts(key)
            return tuple(_known(content, key, one, kind.kind, parts) for one in found)
        case Group():
            return read_parameters(content.section(key), kind.of, parts, folder)
        case Each():
            inner = content.section(key)
            return {_known(inner, one, one, kind.kind, parts): _of(inner, one, kind, parts, folder)
                    for one in inner}  # fmt: skip


def _of(inner: Section, key: str, kind: Each, parts: Parts, folder: str) -> Any:
    if isinstance(kind.of, Number):
        return _number(inner, key, kind.of)
    if isinstance(kind.of, Point):
        return inner.point(key, most=kind.of.most)
    return read_parameters(inner.section(key), kind.of, parts, folder)


def _number(content: Section, key: str, kind: Number) -> float | int:
    if kind.whole:
        return content.whole(key, least=kind.least, most=kind.most, unit=kind.unit)
    return content.number(key, least=kind.least, most=kind.most, above=kind.above, unit=kind.unit)


def _known(content: Section, key: str, name: str, kind: str, parts: Parts) -> str:
    """Return a name, if there is such a part."""
    if name in parts[kind]:
        return name
    known = listed(parts[kind]) or 'none'
    raise content.error(
        key,
        f'there is no {kind} {quoted(name)}',
        did_you_mean(name, parts[kind], f'there are: {known}'),
    )
