# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Make an FMU of a scene, by PythonFMU3.

The FMU holds the scene, its linkages, PythonFMU3's wrapper and a module of a few lines. It
does not hold Python, nor this package.
"""

from __future__ import annotations

from hashlib import sha256
from io import BytesIO
import json
from pathlib import Path
from tempfile import TemporaryDirectory
from uuid import NAMESPACE_URL, uuid5
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

from linkage_ros import __version__
from linkage_ros.description import Scene
from linkage_ros.errors import check_installed
from linkage_ros.tools.models.fmu.stepped_scene import SteppedScene
from linkage_ros.tools.models.source_code import c_name

_MODULE = 'linkage_fmu.py'

# PythonFMU3 finds the class by the text of its line. The module is cached by its name, whichever
# FMU of the process it came from: so it holds nothing of a scene. Its import must not fail: the
# wrapper then ends the whole process by a segmentation fault (0.3.4).
_SOURCE = f"""\
from pythonfmu3 import Fmi3Slave

try:
    from linkage_ros.tools.models.fmu.slave import SceneSlave
except Exception as error:
    _REASON = f'linkage_ros {__version__} is needed in this Python: {{error}}'

    class SceneSlave:
        def __init__(self, **given):
            raise ImportError(_REASON)


class LinkageFmu(SceneSlave, Fmi3Slave):
    pass
"""

_LONG_AGO = (1980, 1, 1, 0, 0, 0)


def scene_fmu(scene: Scene) -> bytes:
    """
    Return the FMU of a scene; the same scene gives the same bytes.

    A FileError says why it is not stepped from outside, a LinkageError that PythonFMU3 is missing.
    """
    check_installed('pythonfmu3', "pip install 'linkage_ros[fmu]'")
    SteppedScene(scene)
    from linkage_ros.tools.models.fmu.slave import (  # local import: it needs PythonFMU3
        Content,
        CONTENT_FILE,
    )
    from pythonfmu3 import FmuBuilder

    digest = sha256(repr((__version__, scene.name, scene.seed, scene.files)).encode()).hexdigest()
    content = Content(
        version=__version__,
        name=scene.name,
        identifier=c_name(scene.name) or 'linkage',
        seed=scene.seed,
        files=tuple(scene.files),
        token=str(uuid5(NAMESPACE_URL, digest)),
    )
    with TemporaryDirectory(prefix='linkage_fmu_') as folder:
        described = json.dumps(content._asdict(), indent=2).encode()
        paths = []
        for name, data in {**scene.files, CONTENT_FILE: described}.items():
            paths.append(Path(folder, name))
            paths[-1].write_bytes(data)
        script = Path(folder, _MODULE)
        script.write_text(_SOURCE, 'utf-8')
        return _repack_without_times(
            FmuBuilder.build_FMU(script, dest=folder, project_files=paths)
        )


def _repack_without_times(made: Path) -> bytes:
    """Return an archive without the times of its files, in the order of their names."""
    packed = BytesIO()
    with ZipFile(made) as archive, ZipFile(packed, 'w') as target:
        for name in sorted(archive.namelist()):
            target.writestr(ZipInfo(name, _LONG_AGO), archive.read(name), ZIP_DEFLATED)
    return packed.getvalue()
