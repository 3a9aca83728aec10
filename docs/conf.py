# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

# The path comes before the imports.
# flake8: noqa: E402, I100


"""
The documentation site: Sphinx, pages in MyST's Markdown, the theme Furo.

``make docs`` builds it into build/docs. All pages are also readable on a forge.
"""

from __future__ import annotations

from pathlib import Path
import sys
from typing import Any

# Sphinx may be started in any folder.
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from docs.website.links import make_links_local
from docs.website.tutorial import PercentParser
from linkage_ros import __version__

project = 'linkage_ros'
author = 'The linkage_ros authors'
copyright = f'2026, {author}'  # noqa: A001 (Sphinx wants this name)
version = release = __version__

extensions = ['myst_parser', 'sphinx.ext.autodoc', 'sphinx.ext.napoleon']
exclude_patterns = [
    '**/__pycache__',
    'conf.py',
    'make_*.py',
    'pictures',
    'synthesis_page',
    'website',
]
nitpicky = True
# Two hyphens before an option are two hyphens.
smartquotes = False

myst_enable_extensions = ['colon_fence', 'deflist']
myst_heading_anchors = 4

autodoc_member_order = 'bysource'
autodoc_typehints = 'signature'
add_module_names = False
maximum_signature_line_length = 88
python_use_unqualified_type_names = True
# In docstrings a name in backticks is a name of the code.
default_role = 'py:obj'
napoleon_google_docstring = False
napoleon_use_ivar = True
napoleon_use_rtype = False

html_theme = 'furo'
html_title = f'linkage_ros {__version__}'
html_copy_source = False
html_show_sphinx = False
html_static_path = ['website/static']
html_css_files = ['site.css']


def setup(app: Any) -> dict[str, Any]:
    """Connect the extensions of this site to Sphinx."""
    app.add_source_suffix('.py', 'percent')
    app.add_source_parser(PercentParser)
    app.connect('source-read', lambda _app, docname, source: make_links_local(docname, source))
    app.connect('missing-reference', _unlinked)
    app.connect('autodoc-process-signature', _readable)
    return {'parallel_read_safe': True, 'parallel_write_safe': True}


def _readable(*arguments: Any) -> tuple[str | None, str | None]:
    """Return a signature that Sphinx can parse: the factory of a dataclass is not Python."""
    *_, signature, returns = arguments
    return signature and signature.replace('<factory>', '...'), returns


def _unlinked(_app: Any, _env: Any, node: Any, content: Any) -> Any:
    """Return a name of the code without a page of its own as plain text."""
    return content if node.get('refdomain') == 'py' else None
