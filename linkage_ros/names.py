# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

r"""
Names in generated text, where they are data whatever they hold: one function for each target.

Links, points, joints, files and scenes are named by whoever wrote them. A library that writes a
whole format (XML, HTML, JSON, Parquet) needs no help from here, and `errors.escape_unprintable`
writes a name for a terminal.
"""

from __future__ import annotations

from collections.abc import Collection
import json
import re

from linkage_ros.errors import escape_unprintable, shorten

_IN_COMMENT = re.compile(r'\\|(?<=\*)/|(?<=/)\*|(?<=\?)\?')
"""A backslash, and what ends a comment or begins one or a trigraph together with what precedes."""

_TRIGRAPH = re.compile(r'(?<=\?)\?')

_FORMULA = re.compile("'*[-+=@\uff0b\uff0d\uff1d\uff20]")
"""Beginning of a cell that a spreadsheet computes, here behind our own mark."""

_DXF_CODES = re.compile(r'(?<=%)(?=%)|(?<=\\)(?=[UM]\+)|(?<=\^)')
r"""Within the codes of a DXF: ``%%d`` is a degree sign, ``\U+0041`` an A, ``^J`` a new line."""

_LONGEST_IN_DXF = 250


def comment_text(name: str) -> str:
    r"""
    Return a name for a comment of C, JavaScript or Python, on a line that does not begin with it.

    A backslash escapes itself and the second of two characters that would end a comment, begin
    one, or be a trigraph: ``*\/``. A character that is not printable is written as ``\x1b``.
    """
    return escape_unprintable(_IN_COMMENT.sub(r'\\\g<0>', name))


def c_string(text: str) -> str:
    r"""Return a literal of C; a backslash keeps two question marks from being a trigraph."""
    return _TRIGRAPH.sub(r'\\?', json.dumps(text, ensure_ascii=False))


def csv_text(text: str) -> str:
    """
    Return a text for a cell of a CSV file, in which a spreadsheet finds no formula.

    One that would be a formula begins with an apostrophe, as a person would type it there.
    """
    return f"'{text}" if _FORMULA.match(text) else text


def dxf_text(name: str) -> str:
    """Return a name for a TEXT of a DXF file; blanks break what would be a code."""
    return shorten(_DXF_CODES.sub(' ', escape_unprintable(name)), _LONGEST_IN_DXF)


def free_name(name: str, taken: Collection[str]) -> str:
    """Return a name that is not taken: this one, or one with a number appended."""
    free, number = name, 1
    while free in taken:
        number += 1
        free = f'{name}_{number}'
    return free


def picture_text(name: str, most: int = 60) -> str:
    """Return a name for a picture by matplotlib within `painting.settings`, on one short line."""
    return shorten(escape_unprintable(name), most)
