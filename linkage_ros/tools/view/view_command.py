# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Show a linkage in the browser: drag its pins, drive it, edit it, save it.

The page is served on this machine only, at an address that nobody can guess, until Ctrl-C. Of a
scene it shows the first linkage, and what its sensors read and the true values; of a bag it is
the report. With -o it is written to a file, where it moves without a server and is not edited.
--node shows a node that runs.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
import os
from pathlib import Path
import sys
from threading import Event, Thread
from typing import Any, NamedTuple
import webbrowser

from linkage_ros.bag import is_bag_name
from linkage_ros.cli import add_output, add_robot, robot_of
from linkage_ros.description import (
    is_planar_file,
    kind_of,
    linkage_text,
    load_scene,
    read_any_closure,
    read_closure,
    read_content,
    read_yaml,
    SCENE_FILE,
    Section,
)
from linkage_ros.errors import (
    check_installed,
    escape_unprintable,
    LinkageError,
    missing_packages_reported,
)
from linkage_ros.kinematics import SpaceClosure
from linkage_ros.resources import linkage_names, named_file, scene_names
from linkage_ros.signals import heed_signals
from linkage_ros.tools.view.report import Window
from linkage_ros.tools.view.report_command import bag_page, check_page, write_page

EXAMPLE = 'linkage view jansen_leg -o jansen_leg.html'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument(
        'file',
        nargs='?',
        metavar='FILE|SCENE|BAG',
        help='linkage or scene file, a name of linkage gallery (a linkage first), or a bag',
    )
    add_output(parser, ('.html', '.htm'), 'it is served')
    parser.add_argument(
        '--node',
        nargs='?',
        const='',
        metavar='NAME',
        help='a node that runs; without a name the only one on the graph',
    )
    parser.add_argument(
        '--port', type=int, default=0, metavar='N', help='port of the server (default: a free one)'
    )
    parser.add_argument(
        '--no-browser', action='store_true', help='print the address only, and open no browser'
    )
    add_robot(parser)


def run(arguments: argparse.Namespace, stop: Event) -> int:
    """Show it."""
    for package in ('plotly', *(() if arguments.output else ('aiohttp', 'ruamel'))):
        check_installed(package, "pip install 'linkage_ros[view]'")
    if not 0 <= arguments.port < 2**16:
        raise LinkageError(f'--port {arguments.port}', 'is not a port', 'name one below 65536')
    if arguments.node is not None:
        return _show_node(arguments, stop)
    if arguments.file is None:
        raise LinkageError('FILE', 'is missing', 'name a linkage, a scene or a bag, or --node')
    if arguments.output:
        check_page(arguments.output)
    path = Path(arguments.file)
    if is_bag_name(path):
        page = bag_page(path, Window(), stop)
        if arguments.output:
            write_page(arguments.output, page)
            return 0
        return _serve_page(arguments, stop, path.resolve().name, lambda: page)
    return _show_linkage(arguments, stop)


class _NamedLinkage(NamedTuple):
    """A linkage to show: file and content, and its scene's name, files and folder, or None."""

    name: str
    path: Path
    data: bytes
    scene: tuple[str, dict[str, str], str] | None
    is_planar_file: bool  # Whether the page can save into the file


def _read_linkage(named: str, robot: Mapping[str, Any]) -> _NamedLinkage:
    """Read a linkage, or the first one of a scene; errors name the file."""
    file = named_file(named, 'linkages', 'scenes')
    content, data = read_content(file, robot)
    if kind_of(content) == 'linkage':
        data = _own_text(content, file.stem) or data
        return _NamedLinkage(file.stem, file, data, None, is_planar_file(content))
    scene = load_scene(file)
    content = scene.linkages[0].linkage_content
    path = Path(content.file)
    if text := _own_text(content, path.stem):
        # Its sensors read a linkage file.
        return _NamedLinkage(path.stem, path, text, None, is_planar_file=False)
    first = next(text for name, text in scene.files.items() if name != SCENE_FILE)
    texts = {name: text.decode() for name, text in scene.files.items()}
    folder = str(Path(scene.folder).absolute())
    shown = (scene.name, texts, folder)
    return _NamedLinkage(path.stem, path, first, shown, is_planar_file(content))


def _own_text(content: Section, name: str) -> bytes:
    """Return the text of a robot, or of a linkage that is planar but not written so; or b''."""
    closure = read_any_closure(content, name)
    if is_planar_file(content) or (isinstance(closure, SpaceClosure) and 'urdf' not in content):
        return b''
    return linkage_text(closure.linkage, [f'From {Path(content.file).name}.']).encode()


def _show_linkage(arguments: argparse.Namespace, stop: Event) -> int:
    shown = _read_linkage(arguments.file, robot_of(arguments))
    from linkage_ros.tools.view.model import build_model
    from linkage_ros.tools.view.page import page_html

    if arguments.output:
        model = build_model(shown.data.decode(), shown.name)
        write_page(arguments.output, page_html(model, mode='still'))
        return 0
    from linkage_ros.tools.view.conversation import Conversation, UserFile
    from linkage_ros.tools.view.sensors import SceneFiles

    shipped = arguments.file in (*linkage_names(), *scene_names())
    file = UserFile(shown.path) if shown.is_planar_file and not shipped else None
    scene = None if shown.scene is None else SceneFiles(*shown.scene)
    pages = _Pages(shown, file)
    pages()  # an error ends this command before a browser opens
    conversation = Conversation(shown.name, scene, file)
    return _serve_page(arguments, stop, shown.name, pages, conversation.add_routes)


class _Pages:
    """The page of a linkage; made anew where its file has changed."""

    def __init__(self, shown: _NamedLinkage, file: Any) -> None:
        self._shown = shown
        self._file = file
        self._data = b''
        self._page = ''

    def __call__(self) -> str:
        """Return the page."""
        from linkage_ros.tools.view.model import build_model
        from linkage_ros.tools.view.page import page_html

        data = self._shown.data
        if self._page and self._file is not None:
            try:
                content, data = read_yaml(self._shown.path)
                if data != self._data:
                    read_closure(content)
            except LinkageError as error:
                print(f'linkage view: {error}; the page shows it as it was', file=sys.stderr)
                return self._page
        if data != self._data:
            model = build_model(data.decode(), self._shown.name)
            scene = self._shown.scene[0] if self._shown.scene else None
            can_save = self._file is not None and self._file.is_writable
            self._page = page_html(model, mode='edit', can_save=can_save, scene=scene)
            self._data = data
        return self._page


def _show_node(arguments: argparse.Namespace, stop: Event) -> int:
    if arguments.file is not None:
        raise LinkageError('--node', 'shows a node, not a file', f'leave {arguments.file} out')
    if arguments.output:
        raise LinkageError('-o', 'cannot hold a node that runs', 'leave it out')
    with missing_packages_reported():
        from linkage_ros.tools.view.live_bridge import LiveBridge
    from linkage_ros.tools.view.live import add_live, live_page

    bridge = LiveBridge(arguments.node)
    try:
        return _serve_page(
            arguments,
            stop,
            bridge.name,
            lambda: live_page(bridge),
            lambda app: add_live(app, bridge),
        )
    finally:
        bridge.end()


def _serve_page(
    arguments: argparse.Namespace, stop: Event, name: str, page: Any, *routes: Any
) -> int:
    from linkage_ros.tools.view.server import serve
    from linkage_ros.tools.view.worker import report_line

    def announce_address(address: str) -> None:
        print(escape_unprintable(f'{name}: {address}'), flush=True)
        if not arguments.no_browser and _has_display():
            # Some browsers let whoever opens them wait.
            Thread(target=webbrowser.open, args=(address,), daemon=True).start()

    with heed_signals():
        serve(page, routes, stop, announce_address, report_line, port=arguments.port)
    print('linkage view: ended')
    return 0


def _has_display() -> bool:
    """Return whether a browser can open a window: without one, a text browser would start."""
    if not sys.platform.startswith('linux'):
        return True
    return any(os.environ.get(name) for name in ('DISPLAY', 'WAYLAND_DISPLAY', 'BROWSER'))
