# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The page of a linkage in a cell of a notebook."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING

from linkage_ros.tools.view.model import model_of
from linkage_ros.tools.view.page import page_html

if TYPE_CHECKING:
    from linkage_ros.kinematics import Closure

_HEIGHT = 900
"""Of the cell, in pixels; what is below is scrolled to."""


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
