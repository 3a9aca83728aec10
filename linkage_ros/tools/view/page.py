# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The page of `linkage view`: the linkage under the hand, its curves, its numbers.

`LinkagePage` shows it in a cell of a notebook.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from html import escape
from typing import Any

from linkage_ros.errors import escape_unprintable
from linkage_ros.kinematics import Closure
from linkage_ros.tools.view.model import model_of
from linkage_ros.tools.view.pages import html_document

_PACKAGE = 'linkage_ros.tools.view'
_FILES = (
    'view.css', 'linkage.js', 'board.js', 'hand.js', 'talk.js', 'edits.js', 'over_input.js',
    'view.js',
)  # fmt: skip

_DOWNLOADS = {
    'svg': 'drawing, SVG',
    'png': 'drawing, PNG',
    'gif': 'animation, GIF',
    'dxf': 'links with holes, DXF',
    'yaml': 'linkage file',
    'c': 'C',
    'py': 'Python',
    'js': 'JavaScript',
}
_TOOLS = {
    'shape': 'move pins',
    'turn': 'turn the crank',
    'trace': 'trace a point',
    'input': 'choose the input',
}
_QUALITY = {'#d55e00': 'below 30°', '#e6b422': '30 to 45°', '#009e73': 'above 45°'}
"""Colour of a transmission angle."""

_CURVES = {
    'joints': 'Joints',
    'rates': 'Rates',
    'accelerations': 'Accelerations, at a constant input rate',
}


_HEIGHT = 900
"""Of the cell, in pixels; what is below is scrolled to."""


def page_html(
    model: Mapping[str, Any],
    *,
    mode: str,
    can_save: bool = False,
    scene: str | None = None,
    node: str | None = None,
) -> str:
    """
    Return the page of a linkage; see `linkage_ros.tools.view.model`.

    The mode is ``edit`` with a server, ``still`` without one, ``live`` with a node.
    ``can_save`` is whether the server may save the user's file. ``scene`` is the name of the scene
    whose sensors are read. A LinkageError is raised if plotly is not installed.
    """
    data = {
        'mode': mode,
        'model': model,
        'server': mode != 'still',
        'can_save': can_save,
        'scene': scene,
        'node': node,
    }
    title = escape_unprintable(node or model['name'])
    body = _page_body(title, mode, can_save, in_space='camera' in model['drawn'])
    return html_document(title, body, data, _PACKAGE, _FILES, is_served=True)


def _page_body(title: str, mode: str, can_save: bool, *, in_space: bool) -> Iterator[str]:
    served = mode == 'edit'
    editing = served and not in_space
    yield from _header(title, served, editing, can_save)
    yield '<p id="lost" role="status" hidden>Not connected: <span id="lost-why"></span>. '
    yield 'The linkage still moves; the page tries again.</p>'
    yield '<p id="wrong" role="alert" hidden></p>'
    yield '<noscript><p class="warnings">This page needs JavaScript.</p></noscript>'
    yield '<main><section class="player" aria-label="The linkage">'
    yield from _player(in_space)
    if editing:
        yield from _tool_choice()
    yield '<dl class="readout" id="readout" aria-live="off"></dl>'
    yield '<ul class="warnings" id="warnings" hidden></ul>'
    yield '</section><section>'
    yield from _plots()
    hidden = ' hidden' if in_space else ''
    yield f'<div class="forms"{hidden}><div><h2>Lengths [<span id="unit-of-length"></span>]</h2>'
    yield '<table><tbody id="lengths"></tbody></table></div>'
    yield '<div><h2>Assembly</h2><table><tbody id="choices"></tbody></table></div>'
    yield '<div><h2>Traced points</h2><div id="traced"></div></div></div>'
    yield '</section></main>'


def _header(title: str, served: bool, editing: bool, can_save: bool) -> Iterator[str]:
    yield '<header class="bar">'
    yield f'<h1 id="title">{escape(title)}</h1>'
    if editing:
        yield '<button type="button" id="undo" title="Undo (Ctrl+Z)">Undo</button>'
        yield '<button type="button" id="redo" title="Redo (Ctrl+Y)">Redo</button>'
        if can_save:
            yield '<button type="button" id="save" title="Save (Ctrl+S)">Save</button>'
        yield '<select id="open" class="edit" aria-label="New from a shipped linkage">'
        yield '<option value="">New from …</option></select>'
    if served:
        yield '<select id="download" class="edit" aria-label="Download">'
        yield '<option value="">Download …</option>'
        for kind, what in _DOWNLOADS.items():
            if kind == 'dxf' and not editing:
                continue  # links in space are not flat parts
            yield f'<option value="{kind}">{what}</option>'
        yield '</select>'
    yield '</header>'


def _player(in_space: bool) -> Iterator[str]:
    """Yield the drawing and its controls."""
    does = (
        'the arrows turn the camera'
        if in_space
        else 'n and p choose a pin, the arrows move it, or turn the crank'
    )
    yield '<figure><canvas id="drawing" tabindex="0" role="application" aria-label="The linkage; '
    yield f'{does}"></canvas></figure>'
    yield '<p id="status" role="status"></p>'
    yield '<div class="controls"><button type="button" id="play" aria-label="Play">▶</button>'
    yield '<label>angles in <select id="angles"><option value="degrees">degrees</option>'
    yield '<option value="radians">radians</option></select></label>'
    yield '<label>ω <input type="number" id="rate" step="any" value="1" aria-label="rate of the '
    yield 'first input"> <span id="rate-unit"></span></label>'
    for what, checked in {
        'names': 'names', 'ghosts': 'other assemblies', 'centres': 'instant centres'
    }.items():  # fmt: skip
        if in_space and what != 'names':
            continue
        on = '' if what == 'centres' else ' checked'
        yield f'<label><input type="checkbox" id="{what}"{on}> {checked}</label>'
    yield '</div><div id="inputs"></div>'


def _tool_choice() -> Iterator[str]:
    """Yield the choice of what the hand does on the drawing."""
    yield '<div class="controls"><fieldset><legend hidden>tool</legend>'
    for tool, what in _TOOLS.items():
        on = ' checked' if tool == 'shape' else ''
        yield f'<label><input type="radio" name="tool" class="edit" value="{tool}"{on}> '
        yield f'{what}</label>'
    yield '</fieldset><label>snap to <select id="snap" class="edit">'
    yield '<option value="0">nothing</option>'
    for step in ('0.001', '0.005', '0.01', '0.1', '1', '5', '10'):
        yield f'<option>{step}</option>'
    yield '</select></label></div>'


def _plots() -> Iterator[str]:
    """Yield the figures of the curves over the input."""
    yield '<div id="plots">'
    for key, what in _CURVES.items():
        yield f'<figure data-key="{key}"><figcaption>{what}</figcaption><div class="plot"></div>'
        yield '</figure>'
        if key == 'joints':
            yield '<figure class="band"><figcaption>Transmission angle '
            yield '<span class="key">'
            for colour, of in _QUALITY.items():
                yield f'<span><i style="background:{colour}"></i>{of}</span>'
            yield '; the line is the singularity margin, from 0 at a singularity to 1</span>'
            yield '</figcaption>'
            yield '<div><canvas id="band" role="img" aria-label="transmission angle over the '
            yield 'input"></canvas></div></figure>'
    yield '</div>'


class LinkagePage:
    """
    The page of `linkage view` without a server: it moves, and is not edited.

    A notebook shows it in a cell, as an object at its end.

    Parameters
    ----------
    closure
        The linkage.

    Raises
    ------
    LinkageError
        If plotly is not installed.

    """

    def __init__(self, closure: Closure) -> None:
        self.text = page_html(model_of(closure, closure.name or 'linkage'), mode='still')
        """The page, as a browser opens it from a file."""

    def _repr_html_(self) -> str:
        # What the cell shows reaches nothing of the notebook.
        return (
            f'<iframe srcdoc="{escape(self.text)}" title="the linkage" sandbox="allow-scripts" '
            f'style="width: 100%; height: {_HEIGHT}px; border: 0"></iframe>'
        )
