# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A budget as a page for the browser: answer, picture, the field for a need, and the table."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from html import escape

from linkage_ros.tools.study.budget import Budget, NeedAnswer
from linkage_ros.tools.study.budget_text import budget_table, closing_lines, lead_lines
from linkage_ros.tools.study.picture import budget_svg
from linkage_ros.tools.view.pages import facts_html, html_document, table_html

_HERE = 'linkage_ros.tools.study'


def budget_html(budget: Budget, answers: Sequence[NeedAnswer]) -> str:
    """
    Return the page.

    The answers are those to all needs that differ, from the greatest error to the least; the last
    one is to a need that nothing meets. Its field shows the first that reaches what is typed.
    """
    data = {'answers': [{'error': each.error, 'text': each.text} for each in answers]}
    body = _page_body(budget, has_field=bool(answers))
    title = f'Accuracy of {budget.scene}'
    return html_document(title, body, data, _HERE, ('page.css', 'page.js'), has_plots=False)


def _page_body(budget: Budget, *, has_field: bool) -> Iterator[str]:
    yield f'<header><h1>Accuracy of {escape(budget.scene)}</h1>'
    yield from (f'<p class="lead">{escape(line)}</p>' for line in lead_lines(budget))
    yield '</header><main>'
    if has_field:
        yield '<p class="field" hidden><label>I need <input id="need" value="0.001" size="8" '
        yield 'inputmode="decimal"> rad</label> <output id="answer" for="need"></output></p>'
    picture = budget_svg(budget)
    if picture:
        yield f'<figure><figcaption>Error against cost</figcaption>{picture}</figure>'
    title = 'Where the error comes from, and what each setting costs'
    yield from table_html(budget_table(budget)._replace(title=title))
    yield from (f'<p class="note">{escape(line)}</p>' for line in closing_lines(budget))
    yield '</main><footer>'
    yield from facts_html(budget.machine)
    yield '</footer>'
