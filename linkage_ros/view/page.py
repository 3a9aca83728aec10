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

"""The page of `linkage view`: one file with its data, its style and its scripts."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from typing import Any

from linkage_ros.drawing.painting import COLOURS, FACES, INK
from linkage_ros.errors import clean
from linkage_ros.pages.document import document


def page(
    model: Mapping[str, Any],
    *,
    mode: str,
    can_save: bool = False,
    scene: str | None = None,
    node: str | None = None,
) -> str:
    """
    Return the page.

    Parameters
    ----------
    model
        The linkage; see `linkage_ros.view.model`.
    mode
        ``edit`` beside a server, ``still`` without one, ``live`` beside a node.
    can_save
        Whether the server may save the user's file.
    scene, node
        Name of the scene whose sensors are read, and of the node; None without one.

    Raises
    ------
    LinkageError
        If plotly is not installed.

    """
    data = {
        'mode': mode,
        'model': model,
        'colours': COLOURS,
        'faces': {**FACES, 'edge': INK},
        'server': mode != 'still',
        'can_save': can_save,
        'scene': scene,
        'node': node,
    }
    title = clean(node or model['name'])
    return document(title, [f'<h1>{escape(title)}</h1>'], data, [], [])
