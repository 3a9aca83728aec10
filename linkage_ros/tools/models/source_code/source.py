# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A linkage as standalone source: the common part of C, JavaScript and Python.

The source is a head that explains it, and one function: it takes the inputs, and their rates and
accelerations if requested, and returns a status and the joints.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations
from math import dist, inf, isfinite, tau
import textwrap
from typing import Any, ClassVar, NamedTuple

from linkage_ros import __version__
from linkage_ros.errors import DefinitionError
from linkage_ros.kinematics import (
    Bound,
    Grid,
    Linkage,
    PlanarClosure,
    RevoluteJoint,
    ROUNDING,
    SHRINK,
    SMALLEST,
    SpaceClosure,
    SpaceDrawing,
    SpaceLinkage,
    StartTable,
    Status,
)
from linkage_ros.kinematics.compiling import (
    compile_program,
    count_uses,
    DecisionBranch,
    Kind,
    Operation,
    Program,
    SolvedLeaf,
    TextWriter,
    TracedMotion,
    Tree,
)
from linkage_ros.names import comment_text

WIDTH = 99
"""Width of the lines of a source."""

FUNCTIONS = ('position', 'velocity', 'motion')
"""Name of the function, by the number of derivatives."""

GIVEN = ('inputs', 'rates', 'accelerations')
RETURNED = ('joints', 'joint_rates', 'joint_accelerations')

_USUAL = (inf, 1e120, 1e240)
"""Larger rates and accelerations are scaled, as `HUGE` says."""

UNDECIDED = 'UNDECIDED'

STATUSES: dict[str, str] = {
    Status.CLOSED.name: 'Every loop closes; the values are valid.',
    Status.CHANGE_POINT.name: 'All links of a loop lie in one line; the values are valid, and '
    'belong to the motion that passes through.',
    Status.LIMITED.name: 'A joint is beyond its limits; the values are valid.',
    Status.TOGGLE.name: 'Two links are stretched or folded, and have no rates. No values. '
    'Loops behind them may be open.',
    Status.OPEN.name: 'Links do not reach each other. No values.',
    Status.INDETERMINATE.name: 'An argument is not finite, or two pins coincide, so that a '
    'direction is undefined. No values.',
    UNDECIDED: 'This code cannot decide; linkage_ros itself can. No values.',
}
"""The statuses of a source, in the order of their numbers, with their meanings."""

_PLAIN = frozenset((0.0, 0.25, 0.5, 1.0, 2.0, 3.0, 4.0, inf))
"""Constants that need no name."""

THRESHOLDS = {SMALLEST: 'smallest', ROUNDING: 'rounding'}
"""Smaller numbers count as 0; rounding error of a sum relative to its terms."""


class Subject(NamedTuple):
    """
    The linkage and the numbers to compile.

    Attributes
    ----------
    closure
        The linkage.
    name
        Name of the linkage; in C an identifier.
    file
        File from which the linkage was read.
    derivatives
        0: positions; 1: velocities too; 2: accelerations too.
    joints
        The requested published joints.
    frames
        Whether the frames of links and their rates are wanted too; for JavaScript of a page, with
        two derivatives.
    jacobian
        Whether the derivatives of the joints by the inputs are wanted, row by row; for C, with no
        derivatives by time.

    """

    closure: Any
    name: str
    file: str
    derivatives: int
    joints: tuple[str, ...]
    frames: bool = False
    jacobian: bool = False


class Language(ABC):
    """A language: how the parts of a source are written."""

    functions: ClassVar[dict[str, str]] = {}
    """Functions that have a different name on the tape."""
    infinity: ClassVar[str]
    finite: ClassVar[str]
    """Function that tells whether a number is finite."""
    nearest: ClassVar[str]
    """Function that rounds to the nearest integer."""
    conjunction: ClassVar[str] = '&&'
    disjunction: ClassVar[str] = '||'
    comment: ClassVar[str] = '// {}'
    status: str = '{}'
    """Forms of a comment and of the name of a status."""

    def write_constant(self, value: Any) -> str:
        """Write a number."""
        if not isfinite(value):
            return self.infinity if value > 0.0 else f'-{self.infinity}'
        return repr(float(value))

    def write_call(self, operation: Operation, parts: list[str]) -> str:
        """Write the call of a function."""
        if operation.name == 'item':
            return f'{parts[0]}[{parts[1]}]'
        if operation.name == 'call':
            return f'{parts[0]}({", ".join(parts[1:])})'
        if operation.name == 'round':
            return f'{self.nearest}({parts[0]})'
        return f'{self.functions.get(operation.name, operation.name)}({", ".join(parts)})'

    def write_choice(self, condition: str, value: str, otherwise: str) -> str:
        """Write a choice between two expressions."""
        return f'{condition} ? {value} : {otherwise}'

    def negate(self, condition: str) -> str:
        """Write that a condition does not hold; this is true for NaN too."""
        return f'!{condition}' if condition.isidentifier() else f'!({condition})'

    def write_below(self, number: str, most: str) -> str:
        """Write that the size of a number is below a bound."""
        return f'{self.functions["abs"]}({number}) < {most}'

    def write_outside(self, number: str, low: str, high: str) -> str:
        """Write that a number is below or above two bounds, in brackets."""
        return f'({number} < {low} {self.disjunction} {number} > {high})'

    def write_threshold(self, name: str, value: float) -> str:
        """Write one of the numbers that are small for a double."""
        return self.write_constant(value)

    def write_block(self, condition: str, lines: Sequence[str]) -> list[str]:
        """Write lines that run if a condition holds."""
        return [f'if ({condition}) {{', *(f'    {line}' for line in lines), '}']

    def wrap_line(self, line: str) -> list[str]:
        """Break a line of code that is too long."""
        code = line.lstrip()
        indent = ' ' * (len(line) - len(code))
        return textwrap.wrap(
            code, WIDTH, initial_indent=indent, subsequent_indent=f'{indent}    ',
            break_long_words=False, break_on_hyphens=False,
        )  # fmt: skip

    def function_name(self, derivatives: int) -> str:
        """Return the name of the function with this number of derivatives."""
        return FUNCTIONS[derivatives]

    @abstractmethod
    def assign(self, name: str, text: str, kind: Kind = 'real') -> str:
        """Write a line that assigns a number, a truth value, or the row of a table to a name."""

    @abstractmethod
    def return_status(self, status: str) -> str:
        """Write a line that returns a status without values."""

    @abstractmethod
    def return_solution(self, status: str, groups: Sequence[Sequence[str]]) -> list[str]:
        """Write lines that return a status and values."""

    @abstractmethod
    def scale_rates(self, subject: Subject, groups: Sequence[Sequence[str]]) -> list[str]:
        """Write lines that call the function with scaled rates, and scale its results back."""

    @abstractmethod
    def write_table(self, name: str, ends: Sequence[str], rows: Sequence[str]) -> list[str]:
        """
        Write a function that returns the row of an input in a table.

        Each but the last of the rows ends at one of ``ends``, which belongs to it.
        """

    @abstractmethod
    def write_grid(self, name: str, grid: Grid) -> list[str]:
        """Write a function that returns the numbers of the cell at several inputs, or nothing."""

    def list_cells(self, grid: Grid) -> list[tuple[tuple[int, ...], tuple[float, ...]]]:
        """Return level and place of each cell, in order, and its numbers."""
        cells = grid.fill()
        if cells is None:
            raise DefinitionError(
                'input',
                f'{len(grid.home)} inputs move links that close only together, and within their '
                'limits are too many cells',
                'give the inputs of the file limits, or narrower ones',
            )
        return sorted(cells.items())

    def write_list(self, numbers: Sequence[float]) -> str:
        """Write numbers, separated by commas."""
        return ', '.join(map(self.write_constant, numbers))

    @abstractmethod
    def whole_source(
        self, subject: Subject, head: Sequence[str], tables: Sequence[str], body: Sequence[str]
    ) -> str:
        """
        Write the source.

        It has the lines of its head, a comment, of its tables, and of the function's body.
        """


def write_source(subject: Subject, language: Language) -> str:
    """
    Return a linkage as the source of a program.

    Parameters
    ----------
    subject
        The linkage and the numbers to compile.
    language
        The language.

    Raises
    ------
    DefinitionError
        If the linkage cannot be compiled.

    """
    body = SourceBody(subject, language, compile_subject(subject))
    head = head_lines(subject, language.function_name(subject.derivatives))
    lines = body.write_lines()
    return language.whole_source(subject, list(head), body.table_lines(), lines)


def compile_subject(subject: Subject) -> Program:
    """Return the tree of a linkage with the requested numbers, and then those that have limits."""
    closure = subject.closure
    names = list(closure.linkage.joints)
    asked = [names.index(name) for name in subject.joints]
    bounded = [bound.number for bound in closure.bounds.joints]

    def wanted_numbers(motion: TracedMotion) -> list[list[float]]:
        groups = [[part.joints[i] for i in asked] for part in motion if part is not None]
        if subject.frames:
            groups += frame_values(closure, motion)
        if subject.jacobian:
            count = len(closure.input_names)
            units = [[float(i == k) for i in range(count)] for k in range(count)]
            columns = [closure.velocity(motion.position, *unit).joints for unit in units]
            groups.append([column[i] for i in asked for column in columns])
        return [*groups, [motion.position.joints[i] for i in bounded]]

    return compile_program(closure, subject.derivatives, wanted_numbers)


def frame_values(closure: Any, motion: TracedMotion) -> list[list[Any]]:
    """
    Return x, y and angle of the frame of each link that moves, and their rates if known.

    In space they are x, y and z of the places of its drawing, without rates.
    """
    if isinstance(closure, SpaceClosure):
        places = SpaceDrawing(closure).tracker().places(motion.position)
        return [[number for place in places for number in place], []]
    of = closure.link_frames
    groups = [of.frames_at(motion.position)]
    if motion.velocity is not None:
        groups.append(of.frame_rates(motion.position, motion.velocity))
    return [
        [n for place, turn in frames for n in (place.real, place.imag, turn)] for frames in groups
    ]


class SourceBody:
    """Writes the lines of the function."""

    writer_class: ClassVar[type[TextWriter]] = TextWriter

    def __init__(self, subject: Subject, language: Language, program: Program) -> None:
        self._language = language
        self._subject = subject
        self._program = program
        roots = list(_tree_roots(program.tree))
        self._lengths = _length_names(subject.closure)
        self._often = Counter(_used_constants(roots))
        self._named: dict[float, str] = {}
        self.tables: dict[StartTable | Grid, str] = {}
        self._writer = self.writer_class(
            roots,
            self._constant_text,
            language.write_call,
            language.write_choice,
            lambda name, text, operation: language.assign(name, text, operation.kind),
        )

    def write_lines(self) -> list[str]:
        """Return all lines, indented."""
        language = self._language
        inputs = self._program.inputs
        count = len(self._subject.closure.linkage.inputs)
        assignments = []
        for number, operation in enumerate(inputs):
            array, index = divmod(number, count)
            assignments.append(language.assign(operation.name, f'{GIVEN[array]}[{index}]'))
            self._writer.name_operation(operation, operation.name)
        lines = [language.return_status(language.status.format(Status.INDETERMINATE.name))]
        finite = [f'{language.finite}({symbol.name})' for symbol in inputs]
        usual = finite[:count]
        groups = list(zip(*[iter(symbol.name for symbol in inputs)] * count, strict=True))
        for most, names in zip(_USUAL[1:], groups[1:], strict=False):
            usual += (language.write_below(name, language.write_constant(most)) for name in names)
        if usual != finite:
            scaled = [
                [f'{name}{" * down" * order}' for name in names]
                for order, names in enumerate(groups[1:], 1)
            ]
            lines = [
                *self._write_unless(finite, lines),
                language.comment.format('What overflows is infinite, nothing is NaN.'),
                language.assign('down', language.write_constant(SHRINK)),
                language.assign('up', language.write_constant(1.0 / SHRINK)),
                *language.scale_rates(self._subject, scaled),
            ]
        assignments += self._write_unless(usual, lines)
        self._write_tree(self._program.tree)
        code = (f'    {line}' for line in (*assignments, *self._writer.lines))
        wrapped = (part for line in code for part in language.wrap_line(line))
        return [*(f'    {line}' for line in self._constant_lines()), *wrapped]

    def _constant_lines(self) -> Iterator[str]:
        """Yield the lines of the constants that have names."""
        language = self._language
        for value, name in self._named.items():
            text = (
                language.write_threshold(name, value)
                if value in THRESHOLDS
                else language.write_constant(value)
            )
            line = language.assign(name, text)
            if value in self._lengths:
                length = value * self._subject.closure.scale
                note = language.comment.format(f'{length:.9g} m')
                line = f'{line}  {note}'
            yield line

    def _write_unless(self, conditions: Sequence[str], lines: Sequence[str]) -> list[str]:
        """Write lines that run unless all conditions hold."""
        language = self._language
        all_hold = f' {language.conjunction} '.join(conditions)
        return language.write_block(language.negate(all_hold), lines)

    def _write_tree(self, tree: Tree) -> None:
        """Write a tree: the usual path continues, every other one is a block that returns."""
        language, writer = self._language, self._writer
        while isinstance(tree, DecisionBranch):
            condition = writer.write(tree.condition)
            usual, unusual = tree.held, tree.failed
            if tree.usual:
                condition = language.negate(condition)
            else:
                usual, unusual = unusual, usual
            with writer.open_block() as lines:
                self._write_tree(unusual)
            writer.lines += language.write_block(condition, lines)
            tree = usual
        if isinstance(tree, SolvedLeaf):
            self._write_solution(tree)
        else:
            status = UNDECIDED if tree is None else tree.name
            writer.lines.append(language.return_status(language.status.format(status)))

    def _write_solution(self, leaf: SolvedLeaf) -> None:
        language, writer = self._language, self._writer
        beyond = self._write_limits(leaf)
        texts = [[writer.write(number) for number in group] for group in leaf.outputs[:-1]]
        status = language.status.format(leaf.status.name)
        if beyond:
            status = language.write_choice(
                beyond, language.status.format(Status.LIMITED.name), status
            )
        writer.lines += language.return_solution(status, texts)

    def _write_limits(self, leaf: SolvedLeaf) -> str:
        """Write that a joint is beyond its limits; '' if there are none."""
        language, writer = self._language, self._writer
        bounds = self._subject.closure.bounds
        beyond = [self._write_beyond(bound, f'q{bound.number}') for bound in bounds.inputs]
        for index, (bound, value) in enumerate(zip(bounds.joints, leaf.outputs[-1], strict=True)):
            name = f'limited{index}'
            writer.lines.append(language.assign(name, writer.write(value)))
            if isinstance(value, Operation):
                writer.name_operation(value, name)
            beyond.append(self._write_beyond(bound, name))
        return f' {language.disjunction} '.join(beyond)

    def _write_beyond(self, bound: Bound, name: str) -> str:
        """Write that a value is beyond its limits, as `Bound.is_beyond` does."""
        language = self._language

        def compare_with_bounds(value: str) -> str:
            low, high = language.write_constant(bound.low), language.write_constant(bound.high)
            return language.write_outside(value, low, high)

        if bound.middle is None:
            return compare_with_bounds(name)
        middle, turn = language.write_constant(bound.middle), language.write_constant(tau)
        turns = f'{language.nearest}(({name} - {middle}) / {turn})'
        turned = f'{name}_turned'
        self._writer.lines.append(language.assign(turned, f'{name} - {turn} * {turns}'))
        return (
            f'({compare_with_bounds(name)} {language.conjunction} {compare_with_bounds(turned)})'
        )

    def table_lines(self) -> list[str]:
        """Return the lines of the tables that the function uses."""
        language = self._language
        lines = []
        for table, name in self.tables.items():
            if isinstance(table, Grid):
                lines += language.write_grid(name, table)
                continue
            rows = list(map(language.write_list, table.rows))
            ends = [language.write_constant(end) for end in table.ends]
            lines += language.write_table(name, ends, rows)
        return [part for line in lines for part in _wrap_list(line)]

    def _constant_text(self, value: Any) -> str:
        if isinstance(value, str):
            return value
        if isinstance(value, StartTable | Grid):
            function = self._language.function_name(self._subject.derivatives)
            number = len(self.tables) or ''
            return self.tables.setdefault(value, f'{function}_row{number}')
        text = self._language.write_constant(value)
        name = self._lengths.get(value) or THRESHOLDS.get(value)
        if abs(value) in _PLAIN or (self._often[value] < 2 and not name):
            return text
        if value not in self._named:
            self._named[value] = name or f'k{len(self._named)}'
        return self._named[value]


def _wrap_list(line: str) -> list[str]:
    indent = ' ' * (len(line) - len(line.lstrip()))
    return textwrap.wrap(
        line, WIDTH, subsequent_indent=f'{indent}    ', break_long_words=False,
        break_on_hyphens=False,
    )  # fmt: skip


def _tree_roots(tree: Tree) -> Iterator[Any]:
    """Yield all conditions and outputs of a tree."""
    if isinstance(tree, DecisionBranch):
        yield tree.condition
        yield from _tree_roots(tree.held)
        yield from _tree_roots(tree.failed)
    elif isinstance(tree, SolvedLeaf):
        for group in tree.outputs:
            yield from group


def _used_constants(roots: Sequence[Any]) -> Iterator[float]:
    """Yield the constants that the roots need, once for each use."""
    for operation in count_uses(roots):
        for argument in operation.arguments:
            if not isinstance(argument, Operation):
                yield argument


def _length_names(closure: PlanarClosure) -> dict[float, str]:
    """Return names of the lengths of links, by their values in the unit of the steps."""
    named: dict[float, set[str]] = defaultdict(set)
    for link, points in _places_of(closure.linkage).items():
        for (first, start), (second, end) in combinations(points.items(), 2):
            named[dist(start, end) / closure.scale].add(f'{link}_{first}_{second}')
        for point, place in points.items():
            for axis, value in zip('xyz', place, strict=False):
                named[value / closure.scale].add(f'{link}_{point}_{axis}')
    # A value that several lengths share gets the name of none.
    names = {value: names.pop() for value, names in named.items() if len(names) == 1}
    often = Counter(names.values())
    return {
        value: f'length_{name}'
        for value, name in names.items()
        if name.isascii() and name.isidentifier() and often[name] == 1
    }


def _places_of(linkage: Linkage | SpaceLinkage) -> Mapping[str, Mapping[str, tuple[float, ...]]]:
    """Return the points of each link, in its frame; of a spatial linkage in the pose."""
    if isinstance(linkage, SpaceLinkage):
        places = linkage.points
        return {link: {name: places[name] for name in of} for link, of in linkage.links.items()}
    return linkage.links


def head_lines(subject: Subject, function: str) -> Iterator[str]:
    """Yield the lines of the head."""
    closure = subject.closure
    linkage: Any = closure.linkage
    kind = 'spatial' if isinstance(linkage, SpaceLinkage) else 'planar'
    yield f'{comment_text(subject.name)}: a {kind} linkage, written by linkage_ros {__version__}'
    yield f'from {comment_text(subject.file)}. Change that file, and compile it again.'
    yield ''
    yield f'The function {function} takes:'
    for index, driven in enumerate(linkage.inputs):
        unit = driven.unit
        yield f'  {GIVEN[0]}[{index}]  {comment_text(driven.joint)} [{unit}]'
    yield from _derived_names(subject, GIVEN)
    yield 'and gives:'
    for index, name in enumerate(subject.joints):
        unit = 'rad' if isinstance(linkage.joints[name], RevoluteJoint) else 'm'
        yield f'  {RETURNED[0]}[{index}]  {comment_text(name)} [{unit}]'
    yield from _derived_names(subject, RETURNED)
    if subject.jacobian:
        yield '  jacobian[]  for each joint its derivative by each input'
    yield ''
    yield 'Angles are not wrapped to one turn. The function returns a status:'
    for index, (name, text) in enumerate(STATUSES.items()):
        yield from textwrap.wrap(
            text, WIDTH - 4, initial_indent=f'  {index} {name}: ', subsequent_indent='      '
        )
    yield ''
    if closure.bounds:
        yield 'Limits that are checked, in [rad] or [m]:'
        for name, limits in linkage.limits.items():
            if limits.is_bounded:
                yield f'  {comment_text(name)} {limits}'
    else:
        yield 'The linkage file names no limits of joints.'
    yield ''
    where = 'in the pose' if kind == 'spatial' else 'in their own frames'
    yield f'The links have these points, {where}, in [m]:'
    for link, points in _places_of(linkage).items():
        text = ', '.join(
            f'{comment_text(p)} ({", ".join(f"{part:.9g}" for part in place)})'
            for p, place in points.items()
        )
        yield from textwrap.wrap(
            f'  {comment_text(link)}: {text}', WIDTH - 4, subsequent_indent='      ',
            break_on_hyphens=False,
        )  # fmt: skip
    yield f'Lengths in the code are in units of {closure.scale:.9g} m. The constants k0, k1 and so'
    yield 'on are computed from them.'


def _derived_names(subject: Subject, names: Sequence[str]) -> Iterator[str]:
    per = ('', 'per second', 'per second squared')
    for order in range(1, 1 + subject.derivatives):
        yield f'  {names[order]}[]  of the same, {per[order]}'
