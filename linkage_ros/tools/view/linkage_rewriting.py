# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A changed linkage, written into the text of its file.

Comments, order, units and the numbers that did not change stay as their author wrote them. A file
in shorthand stays one as long as only its lengths or its side change; else it is written out.
"""

from __future__ import annotations

from collections.abc import Mapping
from io import StringIO
from itertools import takewhile
from math import dist
from typing import Any

from linkage_ros.description import content_of, linkage_text, parse_yaml, Units, written_linkage
from linkage_ros.errors import check_installed
from linkage_ros.kinematics import Linkage

_DIGITS = 13
"""Significant digits of a converted number: the last ones come from the conversion."""

_WIDE = 1_000_000
"""Columns of a line, which are never reached: no line is broken that was whole."""

_UNITS = {
    'links': 'm',
    'points': 'm',
    'center': 'm',
    'angle': 'rad',
    'limits': 'rad',
    'velocity': 'rad/s',
    'ratio': '',
    'offset': 'rad',
}
"""Units of the numbers below a key; edits do not change the units of slides."""

_SIDES_OF_FOUR_BAR = {'d': ('ground', 'O2', 'O4'), 'a': ('crank', 'O2', 'A'),
                      'b': ('coupler', 'A', 'B'), 'c': ('rocker', 'O4', 'B')}  # fmt: skip
_SIDES_OF_INVERTED = {'a': ('crank', 'O', 'B')}
_SHORT_LENGTHS = {
    'four_bar': _SIDES_OF_FOUR_BAR, 'inverted_slider_crank': _SIDES_OF_INVERTED,
}  # fmt: skip
"""The lengths of a shorthand: link and two points by key."""


def rewrite_linkage(text: str, name: str, linkage: Linkage) -> str:
    """
    Return the text of a linkage file, which is bounded, with another linkage in it.

    A FileError says that it is not a linkage, a LinkageError that ruamel.yaml is missing.
    """
    check_installed('ruamel.yaml', "pip install 'linkage_ros[view]'")
    from ruamel.yaml import YAML  # local import: an extra
    from ruamel.yaml.util import load_yaml_guess_indent

    content = parse_yaml(text.encode(), name)
    before, shorthand = written_linkage(content)
    if before == linkage:
        return text
    yaml = YAML()
    document, indent, offset = load_yaml_guess_indent(text)
    yaml.indent(mapping=2, sequence=indent or 2, offset=offset or 0)
    yaml.width = _WIDE
    if shorthand:
        changed = _rewrite_shorthand(
            document[shorthand], shorthand, before, linkage, content.units
        )
        if not changed:
            return linkage_text(linkage, _top_comment(text))
    else:
        _merge_mapping(document, content_of(before), content_of(linkage), content.units, 'm')
    written = StringIO()
    yaml.dump(document, written)
    return written.getvalue()


def _merge_mapping(
    node: Any, before: Mapping[str, Any], after: Mapping[str, Any], units: Units, unit: str
) -> None:
    """Write into a mapping of the file what differs between two contents."""
    for key in [key for key in before if key not in after]:
        del node[key]
    for place, (key, value) in enumerate(after.items()):
        own = _UNITS.get(key, unit)
        if key == 'direction':
            own = ''
        if key not in before:
            if key in node:  # an empty part, as `traced: []`
                node[key] = _make_value(value, units, own)
            else:
                node.insert(min(place, len(node)), key, _make_value(value, units, own))
        elif value != before[key]:
            _replace_value(node, key, before[key], value, units, own)


def _replace_value(node: Any, key: Any, before: Any, after: Any, units: Units, unit: str) -> None:
    """Write a value where another one stands, in its style."""
    held = node[key]
    if isinstance(held, list) and isinstance(after, dict):
        _merge_mapping(held[0], before, after, units, unit)  # a list of one input
    elif isinstance(after, dict):
        _merge_mapping(held, before, after, units, unit)
    elif isinstance(after, list) and len(after) == len(held) == len(before):
        for place, (old, new) in enumerate(zip(before, after, strict=True)):
            if old != new:
                _replace_value(held, place, old, new, units, unit)
    else:
        node[key] = _make_value(after, units, unit)


def _make_value(value: Any, units: Units, unit: str) -> Any:
    """Return a new value in the file's units; mappings and lists on one line."""
    from ruamel.yaml.comments import CommentedMap, CommentedSeq

    if isinstance(value, dict):
        made = CommentedMap(
            {key: _make_value(item, units, _UNITS.get(key, unit)) for key, item in value.items()}
        )
        made.fa.set_flow_style()
        return made
    if isinstance(value, list):
        listed = CommentedSeq([_make_value(item, units, unit) for item in value])
        listed.fa.set_flow_style()
        return listed
    if isinstance(value, str):
        return value
    number = float(f'{units.to_file_unit(float(value), unit) if unit else value:.{_DIGITS}g}')
    return int(number) if number.is_integer() and abs(number) < 1e6 else number


def _rewrite_shorthand(
    node: Any, kind: str, before: Linkage, after: Linkage, units: Units
) -> bool:
    """Write lengths and side into a shorthand; return whether that is all that changed."""
    lengths = {
        key: dist(after.links[link][start], after.links[link][end])
        for key, (link, start, end) in _SHORT_LENGTHS[kind].items()
        if {start, end} <= {*after.links.get(link, ())}
    }
    if not lengths.keys() >= _SHORT_LENGTHS[kind].keys():
        return False
    old = {
        key: dist(before.links[link][start], before.links[link][end])
        for key, (link, start, end) in _SHORT_LENGTHS[kind].items()
    }
    for key, value in lengths.items():
        if value != old[key]:
            node[key] = _make_value(value, units, 'm')
    if after.assembly != before.assembly:
        node['assembly'] = next(iter(after.assembly.values()))
    if before.pose is not None and before.pose != after.pose:
        return False
    return _is_written(node, kind, after, units)


def _is_written(node: Any, kind: str, linkage: Linkage, units: Units) -> bool:
    """Return whether a shorthand stands for a linkage."""
    from ruamel.yaml import YAML

    written = StringIO()
    YAML().dump({'units': units.length, 'angles': units.angle, kind: node}, written)
    reread, _ = written_linkage(parse_yaml(written.getvalue().encode(), kind))
    return reread.links == linkage.links and reread.inputs == linkage.inputs


def _top_comment(text: str) -> list[str]:
    """Return the comment at the top of a file."""
    lines = takewhile(lambda line: line.startswith('#'), text.splitlines())
    return [' '.join(line.lstrip('# ') for line in lines)] if text.startswith('#') else []
