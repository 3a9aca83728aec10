# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The chapter of docs/synthesis.md on kinds of tasks, with results of `linkage synthesize`."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from math import degrees, hypot
from pathlib import Path
from shlex import split
from typing import NamedTuple

from linkage_ros.tools.design import add_arguments, DesignAnswer, find_solutions

from .markdown import prose

_LINKS = ('crank', 'coupler', 'rocker', 'ground')
_ROUNDING = 1e-9


class Kind(NamedTuple):
    """A kind of task: its heading, picture, description, and arguments of `linkage synthesize`."""

    name: str
    picture: str
    description: str
    command: str


_LOGARITHM = (
    '--function "log10(x)" --range 1 2 --crank-range 45 105 --rocker-range 135 225 --ground 0.1'
)

KINDS = (
    Kind(
        'Three pairs',
        'three_pairs',
        'Crank and rocker pass three pairs of angles. There is one four-bar for them, or none.',
        '--pair 50 100 --pair 80 110 --pair 110 125 --ground 0.1',
    ),
    Kind(
        'A function',
        'function',
        'The rocker shows the logarithm of the value to which the crank is set. It is exact at '
        'three points in Chebyshev spacing, which keeps the error between them small.',
        _LOGARITHM,
    ),
    Kind(
        'Five pairs, zeros free',
        'five_pairs',
        'The same function. If only differences of angles matter, the zeros of crank and rocker '
        'are two more unknowns, and the function is exact at five points.',
        f'{_LOGARITHM} --points 5 --free-zeros',
    ),
    Kind(
        'A path',
        'path',
        'A point of the coupler passes seven positions in their order, on a closed curve, with a '
        'crank that turns in one direction.',
        '--closed --usable --candidates 200000 --point 0.100 0.100 --point 0.130 0.120 '
        '--point 0.170 0.125 --point 0.200 0.110 --point 0.190 0.090 --point 0.150 0.080 '
        '--point 0.115 0.085',
    ),
    Kind(
        'Three poses',
        'poses',
        'The coupler passes three poses (position and angle), with two given fixed pivots.',
        '--pose 0.00 0.10 50 --pose 0.02 0.13 35 --pose 0.10 0.12 15 '
        '--fixed-pivot 0.00 0.00 --fixed-pivot 0.10 0.00',
    ),
)


def answer_to(kind: Kind) -> DesignAnswer:
    """Return the first solution that the command line shows."""
    parser = argparse.ArgumentParser()
    add_arguments(parser)
    found, _ = find_solutions(parser.parse_args(split(kind.command)), _ignore_progress)
    return found[0]


def chapter(folder: Path) -> Iterator[str]:
    """Draw every kind of task, and yield the lines on them."""
    from linkage_ros.tools.design import draw_design

    yield from prose("""
        ## Four-bars by kind of task

        Each kind of task with the first answer of `linkage synthesize`, drawn by its `--draw`. The
        wanted positions are blue.
    """)
    for kind in KINDS:
        answer = answer_to(kind)
        file = folder / f'{kind.picture}.svg'
        draw_design(answer.design, answer.title, file, error=answer.curve)
        yield from section(kind, answer)


def section(kind: Kind, answer: DesignAnswer) -> Iterator[str]:
    """Yield the lines on a kind of task."""
    yield f'### {kind.name}'
    yield ''
    yield from prose(kind.description)
    yield '```sh'
    yield from _command(kind)
    yield '```'
    yield ''
    yield f'![{kind.name}: {answer.title}](synthesis/{kind.picture}.svg)'
    yield ''
    yield from (f'- {fact}' for fact in _facts(answer))
    yield ''


def _facts(answer: DesignAnswer) -> Iterator[str]:
    design, assessment = answer.design, answer.assessment
    lengths = zip(_LINKS, design.four_bar.lengths, strict=True)
    text = ', '.join(f'{link} {length:.4g} m' for link, length in lengths)
    yield f'{text[0].upper()}{text[1:]}; {assessment.kind.name}'
    if answer.curve is not None:
        worst = max(abs(error) for error in answer.curve[1])
        yield f'Rocker off by {degrees(worst):.2g}° at most, over the whole range'
    elif any(wanted.place is not None for wanted in design.wanted):
        off = [met.distance for met in assessment.met]
        size = max(design.four_bar.lengths)
        rms = hypot(*off) / len(off) ** 0.5
        exact = max(off) < _ROUNDING * size
        yield 'Positions exact' if exact else f'Position error {1e3 * rms:.2g} mm rms'
    yield f'Transmission angle {degrees(assessment.transmission):.1f}° at least, on the way'
    for defect in assessment.defects:
        yield f'**{defect.name}**: {defect.text}'


def _command(kind: Kind) -> Iterator[str]:
    """Yield the command in lines of a page's width."""
    line = 'linkage synthesize'
    for option in kind.command.split(' --'):
        part = f' --{option.removeprefix("--")}'
        if len(line) + len(part) > 96:
            yield f'{line} \\'
            line = ' ' * 3
        line += part
    yield line


def _ignore_progress(_done: int, _of: int) -> None:
    """Ignore the progress of the search."""
