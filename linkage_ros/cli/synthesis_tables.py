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


"""A designed four-bar as tables: its links, the proof, what it is worth."""

from __future__ import annotations

from collections.abc import Iterator
from math import degrees

from linkage_ros.cli.arguments import angle_text
from linkage_ros.cli.synthesis_tasks import Answer
from linkage_ros.cli.terminal import Table
from linkage_ros.synthesis.defects import Assessment, misses, Needs
from linkage_ros.synthesis.design import FourBar


def tables(answer: Answer, title: str, needs: Needs) -> Iterator[Table]:
    """Yield what there is to say of a solution."""
    yield Table(title, ('link', '>length [m]', ''), list(_links(answer.design.four_bar)))
    if answer.facts:
        yield Table('', ('', ''), answer.facts)
    yield _proof(answer)
    yield Table('', ('', ''), list(_worth(answer.assessment, needs)))


def _links(four_bar: FourBar) -> Iterator[tuple[str, str, str]]:
    names = ('crank', 'coupler', 'rocker', 'ground')
    pins = (four_bar.crank, None, four_bar.rocker, None)
    for name, length, pin in zip(names, four_bar.lengths, pins, strict=True):
        note = ''
        if pin is not None and pin.imag == 0.0 and pin.real < 0.0:
            note = f'{pin.real:.10g}, reversed: it points away from its angle'
        yield name, f'{length:.10g}', note


def _proof(answer: Answer) -> Table:
    """Return how each position is met; a column is there where one asks for it."""
    wanted = answer.design.wanted
    columns = ['>', '>crank']
    rocker, coupler, place = (
        any(getattr(one, what) is not None for one in wanted)
        for what in ('rocker', 'coupler', 'place')
    )
    columns += ['>x [m]', '>y [m]'] if place else []
    columns += ['>rocker'] if rocker else []
    columns += ['>coupler'] if coupler else []
    columns += ['assembly']
    columns += ['>off [m]'] if place else []
    columns += ['>off [°]'] if rocker or coupler else []
    rows = []
    for number, (one, met) in enumerate(zip(wanted, answer.assessment.met, strict=True), 1):
        row = [str(number), angle_text(one.crank)]
        if place:
            at = one.place
            row += ['', ''] if at is None else [f'{at.real:.6g}', f'{at.imag:.6g}']
        for asked, angle in ((rocker, one.rocker), (coupler, one.coupler)):
            if asked:
                row.append('' if angle is None else angle_text(angle))
        row.append(met.side if met.closed else f'open by {met.gap:.3g} m')
        if place:
            row.append(f'{met.distance:.2e}' if met.closed else '')
        if rocker or coupler:
            row.append(f'{degrees(met.angle):+.2e}' if met.closed else '')
        rows.append(row)
    return Table('Proof: each position, analysed again', columns, rows)


def _worth(assessment: Assessment, needs: Needs) -> Iterator[tuple[str, str]]:
    kind = assessment.kind
    turns = 'the crank turns fully' if assessment.turns else 'the crank does not turn fully'
    yield 'kind', f'{kind.name} ({kind.code}), {turns}'
    if assessment.travel is not None:
        start, end = map(angle_text, assessment.travel)
        yield 'crank goes', f'{start} to {end}, through all positions'
    where = 'on the way' if assessment.travel is not None else 'of the positions'
    least = angle_text(assessment.transmission, 2)
    yield (
        'transmission',
        f'{least} at least {where}, with the crank at {angle_text(assessment.at)}',
    )
    if assessment.full_transmission is not None:
        yield '', f'{angle_text(assessment.full_transmission, 2)} over the full turn'
    yield 'link ratio', f'{assessment.link_ratio:.4g}, longest to shortest'
    for defect in assessment.defects:
        yield f'{defect.name} defect', defect.text
    if not assessment.defects:
        yield 'defects', 'none: order, branch and circuit are right'
    for missed in misses(assessment, needs):
        yield 'lacks what is needed', missed
