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

"""All assemblies of a linkage file, for a reader who looks for the right sides."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from os import PathLike

from linkage_ros.errors import DefinitionError, FileError
from linkage_ros.files.linkage_file import closable, written_linkage
from linkage_ros.files.section import Section
from linkage_ros.files.yaml_file import read_yaml
from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.plan import assembly_sides
from linkage_ros.kinematics.topology import assur_groups
from linkage_ros.resources import named_file

_MOST = 5
"""Most sides to choose: 32 linkages."""


def assemblies(linkage: str | PathLike[str]) -> dict[str, Closure]:
    """
    Return a linkage in each choice of assembly sides in which it closes.

    If the file leaves sides out, those that it writes are kept; else all are chosen.

    Parameters
    ----------
    linkage
        Path of a linkage file, or the name of one that comes with the package.

    Returns
    -------
    closures : dict of str to Closure
        By the text that the file needs for it, such as ``'assembly: {B: left}'``.

    Raises
    ------
    FileError
        As in `load`; or there is no side to choose, or there are too many.

    """
    file = named_file(linkage, 'linkages')
    content, _ = read_yaml(file)
    return closures(content, file.stem)


def closures(content: Section, name: str) -> dict[str, Closure]:
    """Return the closures of a linkage file by name, as `assemblies` does."""
    written, shorthand = written_linkage(content)
    try:
        sides = assembly_sides(assur_groups(written))
    except DefinitionError as error:
        raise content.error(shorthand or error.where, error.reason, error.remedy) from None
    free = [name for name in sides if name not in written.assembly] or list(sides)
    if not free:
        reason = 'no dyad of this linkage has two assemblies'
        raise content.error('', reason, 'draw it without --assemblies')
    if len(free) > _MOST:
        reason, remedy = f'{len(free)} sides are to be chosen', f'leave out only {_MOST} of them'
        raise content.error('assembly', reason, remedy)
    found = {}
    errors = []
    for chosen in product(*(sides[name] for name in free)):
        assembly = dict(written.assembly) | dict(zip(free, chosen, strict=True))
        one = replace(written, assembly=assembly)  # type: ignore[arg-type]  # sides, as above
        # A shorthand has one side, without the name of its pin or slider.
        text = ', '.join(chosen if shorthand else (f'{k}: {v}' for k, v in assembly.items()))
        text = f'assembly: {text if shorthand else f"{{{text}}}"}'
        try:
            found[text] = closable(content, one, name, shorthand)
        except FileError as error:
            errors.append(error)
    if not found:
        raise errors[0]
    return found
