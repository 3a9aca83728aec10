# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
``python -m campaigns.mutants``: small random mistakes in the core, which tests have to see.

Each mutant is a copy of the checkout with one change in one expression: another comparison, sign,
constant or branch. The tests of its module run on it until one fails. A mutant that lives is
either equivalent to the original, or shows a claim that no test holds: judge the list yourself.

A library was not taken: mutmut replaces each function by a dispatcher, and the compiler of this
package traces functions; cosmic-ray has no random sample of several modules.
"""

from __future__ import annotations

import argparse
import ast
from collections import Counter
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from random import Random
from resource import prlimit, RLIMIT_CPU
import shutil
from signal import SIGKILL, SIGXCPU
import subprocess
import sys
import tempfile
from typing import NamedTuple

from bench.report import say, Table
from campaigns.campaign import Findings, progress_lines, results_of

ROOT = Path(__file__).parents[1]
COPIED = (
    'linkage_ros',
    'test',
    'config',
    'campaigns',
    'bench',
    'docs',
    'examples',
    'launch',
    'resource',
)
LONGEST_TEST = 180.0
"""Time for one test, in [s]: a mutant that loops fails it."""
KINEMATICS = 'kinematics', 'tick/test_pipeline.py', 'stages/drives/test_limits.py'
EFFORTS = 'stages/effects/test_effort.py', 'stages/effects/test_pin_forces.py'
DYNAMICS = ('dynamics', 'stages/drives', *EFFORTS)
TICK = 'tick', 'tick/test_pipeline.py', 'tick/test_many_linkages.py', 'tick/test_compiled_tick.py'
EFFECTS = 'stages/effects', 'stages/test_contracts.py'
BAG = ('bag',)
TESTS: dict[str, Sequence[str]] = {
    'kinematics/closure': KINEMATICS,
    'kinematics/plane/plan': KINEMATICS,
    'kinematics/plane/topology': KINEMATICS,
    'kinematics/plane/diagonals': KINEMATICS,
    'kinematics/plane/rail': KINEMATICS,
    'kinematics/analysis/ranges': ('kinematics/analysis/test_ranges.py', *KINEMATICS),
    'kinematics/iterated/iterated_step': ('kinematics/iterated/test_iteration.py', *KINEMATICS),
    'kinematics/iterated/branch': ('kinematics/iterated/test_branches.py', *KINEMATICS),
    'kinematics/space/plan': ('kinematics/space',),
    'kinematics/space/steps': ('kinematics/space',),
    'dynamics/motion': ('dynamics/test_motion.py', *DYNAMICS),
    'dynamics/equation': DYNAMICS,
    'dynamics/reactions': ('dynamics/test_reactions.py', *DYNAMICS),
    'stages/drives/topic': ('stages/drives', 'tick/test_pipeline.py'),
    'stages/drives/torque': ('stages/drives', 'dynamics'),
    'stages/effects/delay': ('stages/effects/test_delay.py', *EFFECTS),
    'tick/linkage_pipeline': (*TICK, *EFFECTS),
    'tick/tick_loop': (*TICK, 'node'),
    'bag/writer': BAG,
    'bag/recorder': ('bag/test_recorder.py', *BAG),
    'bag/salvage': ('bag/test_salvage.py', *BAG),
    'node/diagnostics': ('node', 'tools/view/report'),
}
"""
Modules, and the tests beside them, the closest first.

Tests that are slow or start nodes are left out: what only these see counts as alive.
"""

COMPARED = {
    ast.Lt: '<=', ast.LtE: '<', ast.Gt: '>=', ast.GtE: '>', ast.Eq: '!=', ast.NotEq: '==',
    ast.Is: 'is not', ast.IsNot: 'is', ast.In: 'not in', ast.NotIn: 'in',
}  # fmt: skip
COMPUTED = {ast.Add: '-', ast.Sub: '+', ast.Mult: '/', ast.Div: '*', ast.FloorDiv: '/'}
RENAMED = {'min': 'max', 'max': 'min', 'any': 'all', 'all': 'any'}


class Mutant(NamedTuple):
    """One changed expression."""

    module: str  # As in `TESTS`
    line: int
    begin: int  # Position of the expression in the bytes of the file
    end: int
    changed: str

    def cut(self, source: bytes) -> tuple[bytes, bytes, bytes]:
        """Return the file before the expression, the expression, and the file after it."""
        begin, end = self.begin, self.end
        return source[:begin], source[begin:end], source[end:]

    def change(self, source: bytes) -> bytes:
        """Return the file with the changed expression."""
        before, _, after = self.cut(source)
        return before + self.changed.encode() + after


class Fate(NamedTuple):
    """What became of a mutant."""

    mutant: Mutant
    killer: str  # The test that failed first; '' if the mutant lives


def file_of(module: str, root: Path = ROOT) -> Path:
    """Return the file of a module."""
    return root / 'linkage_ros' / f'{module}.py'


def changed_expression(node: ast.AST) -> ast.expr | None:
    """Return an expression with one mistake, or None where none is known."""
    match node:
        case ast.Compare(ops=[operator]) if type(operator) in COMPARED:
            right = ast.unparse(node.comparators[0])
            return parsed(f'({ast.unparse(node.left)}) {COMPARED[type(operator)]} ({right})')
        case ast.BinOp(op=operator) if type(operator) in COMPUTED:
            left, right = ast.unparse(node.left), ast.unparse(node.right)
            return parsed(f'({left}) {COMPUTED[type(operator)]} ({right})')
        case ast.BoolOp():
            other = ast.Or() if isinstance(node.op, ast.And) else ast.And()
            return ast.BoolOp(other, node.values)
        case ast.UnaryOp(op=ast.Not() | ast.USub()):
            return node.operand
        case ast.Constant(value=bool()):
            return ast.Constant(not node.value)
        case ast.Constant(value=int() | float() as number):
            return ast.Constant(number + 1)
        case ast.Call(func=ast.Name(id=name)) if name in RENAMED:
            return ast.Call(ast.Name(RENAMED[name]), node.args, node.keywords)
        case ast.IfExp():
            return ast.IfExp(node.test, node.orelse, node.body)
    return None


def parsed(text: str) -> ast.expr:
    """Return the expression of a text."""
    return ast.parse(text, mode='eval').body


def executed_nodes(tree: ast.AST) -> Iterator[ast.AST]:
    """Yield nodes that run: no annotations, and no words of errors."""
    for name, field in ast.iter_fields(tree):
        if name in ('annotation', 'returns') or isinstance(tree, ast.Raise | ast.JoinedStr):
            continue
        for node in field if isinstance(field, list) else [field]:
            if isinstance(node, ast.AST):
                yield node
                yield from executed_nodes(node)


def mutants_of(module: str) -> Iterator[Mutant]:
    """Yield all mutants of a module."""
    source = file_of(module).read_bytes()
    starts = [0]
    for line in source.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    for node in executed_nodes(ast.parse(source)):
        changed = changed_expression(node)
        if changed is not None and isinstance(node, ast.expr):
            assert node.end_lineno is not None
            assert node.end_col_offset is not None
            begin = starts[node.lineno - 1] + node.col_offset
            end = starts[node.end_lineno - 1] + node.end_col_offset
            yield Mutant(module, node.lineno, begin, end, f'({ast.unparse(changed)})')


def try_mutant(mutant: Mutant, longest: int) -> Fate:
    """Run the tests of a mutant in a copy of the checkout, for so many seconds of a processor."""
    with tempfile.TemporaryDirectory(prefix='mutant_') as folder:
        root = Path(folder)
        for name in COPIED:
            # With the times of the files, so that what Python has compiled stays valid.
            shutil.copytree(ROOT / name, root / name)
        for file in (*ROOT.glob('*.toml'), *ROOT.glob('*.xml'), *ROOT.glob('setup.*')):
            shutil.copy(file, root)
        file = file_of(mutant.module, root)
        source = file.read_bytes()
        file.write_bytes(mutant.change(source))
        tests = [f'test/{name}' for name in dict.fromkeys(TESTS[mutant.module])]
        return Fate(mutant, first_failure(root, tests, longest))


def first_failure(root: Path, tests: Sequence[str], longest: int) -> str:
    """Return the test that fails first; '' if all pass, or do not end in time."""
    marks = 'not ros and not alone and not slow'
    command = [sys.executable, '-m', 'pytest', '-q', '-x', '-m', marks]
    command += ['-o', f'timeout={LONGEST_TEST:g}']
    with subprocess.Popen(
        [*command, '-p', 'no:cacheprovider', *tests],
        cwd=root,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    ) as process:
        # Time of the processor, so that other load on the machine decides nothing.
        prlimit(process.pid, RLIMIT_CPU, (longest, longest + 1))
        output, _ = process.communicate()
    if process.returncode in (0, -SIGXCPU, -SIGKILL):
        return ''
    failed = [line for line in output.splitlines() if line.startswith(('FAILED', 'ERROR'))]
    return failed[0].split(' - ')[0] if failed else f'exit code {process.returncode}'


def table_of(fates: Sequence[Fate]) -> Table:
    """Return how many mutants of each module live."""
    tried = Counter(fate.mutant.module for fate in fates)
    alive = Counter(fate.mutant.module for fate in fates if not fate.killer)
    rows: list[Sequence[str]] = [
        (module, str(count), str(count - alive[module])) for module, count in tried.items()
    ]
    killed = sum(tried.values()) - sum(alive.values())
    rows.append(('all', str(sum(tried.values())), f'{killed} ({100 * killed / len(fates):.0f} %)'))
    return Table('Mutants', ('module', 'mutants', 'killed'), rows)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of this campaign."""
    parser.add_argument('--count', type=int, default=100, help='number of mutants')
    parser.add_argument(
        '--longest',
        type=int,
        default=600,
        help='time of the processor for the tests of a mutant, in seconds: one that they do not '
        'end in counts as alive',
    )
    parser.add_argument('--only', nargs='+', choices=TESTS, help='only these modules')


def run(arguments: argparse.Namespace) -> Findings:
    """Try random mutants, and list those that live."""
    known = [mutant for module in arguments.only or TESTS for mutant in mutants_of(module)]
    chosen = Random(arguments.seed).sample(known, min(arguments.count, len(known)))
    advance = progress_lines(len(chosen), 'mutants')
    fates: list[Fate] = []
    attempt = partial(try_mutant, longest=arguments.longest)
    for fate in results_of(attempt, chosen, arguments.jobs):
        fates.append(fate)
        mutant = fate.mutant
        text = mutant.cut(file_of(mutant.module).read_bytes())[1].decode()
        end = f'killed by {fate.killer}' if fate.killer else 'LIVES'
        say(f'{mutant.module}.py:{mutant.line}: {text} -> {mutant.changed}: {end}')
        advance(1)
    return Findings([table_of(fates)], [], [('mutants', f'{len(chosen):,}')])
