# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The languages of a compiled linkage, by the suffix of their files."""

from __future__ import annotations

from collections.abc import Callable
import re

from linkage_ros.tools.models.source_code.c import C
from linkage_ros.tools.models.source_code.javascript import JavaScript
from linkage_ros.tools.models.source_code.python_module import PythonModule
from linkage_ros.tools.models.source_code.source import Language, Subject

LANGUAGES: dict[str, Callable[[Subject], Language]] = {
    '.c': lambda subject: C(subject.name, header=False),
    '.h': lambda subject: C(subject.name, header=True),
    '.js': lambda _: JavaScript(),
    '.py': lambda subject: PythonModule(subject.derivatives),
}
"""The languages, by file suffix."""

C_NAME = re.compile('[A-Za-z][0-9A-Za-z_]*')
"""An identifier of C, as far as a linkage needs one."""


def c_name(name: str) -> str:
    """Return a name as an identifier of C; '' if it makes none."""
    made = re.sub('[^0-9A-Za-z]+', '_', name).strip('_')
    return made if C_NAME.fullmatch(made) else ''
