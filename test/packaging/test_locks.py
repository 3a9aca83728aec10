# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What is installed is bounded and known by its hash; a release says what it is made of."""

from importlib.metadata import distribution
import json
import re
import shutil
import subprocess
import sys

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
import pytest

PYTHONS = ('3.10', '3.11', '3.12')
USED_AT_RUN_TIME = ('', 'ros', 'report', 'design', 'dask', 'export', 'completion', 'view')
HARD = {'numpy', 'mcap', 'pyyaml'}


def pins(file):
    """Return (requirement, its hashes) of each entry of a lock file."""
    entries = file.read_text('utf-8').replace('\\\n', ' ').splitlines()
    return [
        (
            Requirement(entry.split(' --hash')[0]),
            re.findall(r'--hash=sha256:([0-9a-f]{64})', entry),
        )
        for entry in entries
    ]


def installed_by(file, python):
    """Return name and version of what a lock file installs with a Python on Linux."""
    machine = {
        'python_version': python,
        'python_full_version': f'{python}.1',
        'sys_platform': 'linux',
        'platform_system': 'Linux',
        'platform_machine': 'x86_64',
        'platform_python_implementation': 'CPython',
        'implementation_name': 'cpython',
        'os_name': 'posix',
    }
    return [
        (canonicalize_name(pin.name), next(iter(pin.specifier)).version)
        for pin, _ in pins(file)
        if pin.marker is None or pin.marker.evaluate(machine)
    ]


def wanted(root, extra):
    """Return what setup.py asks for, with an extra, as the package's own metadata have it."""
    for text in distribution('linkage_ros').requires or ():
        requirement = Requirement(text)
        marker = str(requirement.marker or '')
        if f'extra == "{extra}"' in marker if extra else 'extra' not in marker:
            yield requirement


@pytest.mark.parametrize('name', ['bench.txt', 'dev.txt', 'demo.txt', 'npm.txt', 'run.txt'])
def test_lock_file_pins_one_version_with_hashes(root, name):
    found = pins(root / 'requirements' / name)
    assert found
    for pin, hashes in found:
        assert [each.operator for each in pin.specifier] == ['=='], pin
        assert hashes, pin
        assert pin.url is None
    assert '://' not in (root / 'requirements' / name).read_text('utf-8')


@pytest.mark.parametrize('python', PYTHONS)
@pytest.mark.parametrize(
    ('name', 'extra'),
    [
        ('bench.txt', 'bench'),
        ('dev.txt', 'dev'),
        ('dev.txt', ''),
        ('demo.txt', 'demo'),
        ('demo.txt', ''),
        ('run.txt', ''),
    ],
)
def test_lock_file_installs_every_requirement_of_setup_py(root, name, extra, python):
    installed = installed_by(root / 'requirements' / name, python)
    versions = dict(installed)
    assert len(versions) == len(installed)
    for requirement in wanted(root, extra):
        marker = requirement.marker
        if marker is None or marker.evaluate({'extra': extra, 'python_version': python}):
            version = versions.get(canonicalize_name(requirement.name))
            assert version, f'{requirement}: not in {name}; make lock'
            assert requirement.specifier.contains(version), f'{requirement}: {version}; make lock'


def test_runtime_requirements_have_lower_and_upper_bounds(root):
    for extra in USED_AT_RUN_TIME:
        for requirement in wanted(root, extra):
            operators = {each.operator for each in requirement.specifier}
            assert operators == {'>=', '<'}, requirement


@pytest.mark.parametrize('folder', ['browser', 'bag/foreign_reader'])
def test_npm_packages_of_tests_have_hashes(root, folder):
    lock = json.loads((root / 'test' / folder / 'package-lock.json').read_text('utf-8'))
    packages = {name: of for name, of in lock['packages'].items() if name}
    assert packages
    assert all(of['integrity'].startswith('sha512-') for of in packages.values())


@pytest.mark.parametrize('python', PYTHONS)
@pytest.mark.parametrize('name', ['demo.txt', 'run.txt'])
def test_make_test_keeps_packages_of_make_demo(root, name, python):
    part, whole = (root / 'requirements' / each for each in (name, 'dev.txt'))
    assert set(installed_by(part, python)) <= set(installed_by(whole, python))
    hashes = {(pin.name, str(pin.specifier)): known for pin, known in pins(whole)}
    assert all(hashes[pin.name, str(pin.specifier)] == known for pin, known in pins(part))


@pytest.mark.parametrize('python', PYTHONS)
def test_make_bench_keeps_packages_of_make_test(root, python):
    part, whole = (dict(installed_by(root / 'requirements' / name, python))
                   for name in ('bench.txt', 'dev.txt'))  # fmt: skip
    assert {name: whole[name] for name in part.keys() & whole.keys()} == {
        name: part[name] for name in part.keys() & whole.keys()
    }
    # What only they compare with, in no other lock file: the most of what is installed.
    assert {'pin', 'casadi', 'numba', 'pylinkage', 'llvmlite'}.isdisjoint(whole)


def test_make_installs_only_by_lock_files(root):
    made = (root / 'Makefile').read_text('utf-8')
    by_hash = '--require-hashes --requirement'
    assert re.findall(r'\$\((?:PIP|UV)_INSTALL\) ([^;|}\n]*?)\s*[;|}\n]', made) == [
        f'{by_hash} /dev/stdin \\',
        f'{by_hash} $(1)',
        f'{by_hash} $(1)',
        '--no-build-isolation --editable .',
    ]
    assert re.findall(r'_INSTALL := .* (--no-deps)\b', made) == ['--no-deps', '--no-deps']
    assert re.findall(r'call install_by,(\S+)\)', made) == [
        'requirements/demo.txt',
        'requirements/dev.txt',
        'requirements/bench.txt',
    ]


@pytest.mark.sample(0)
def test_release_sbom_lists_dependencies_with_versions(root, copy_checkout, tmp_path):
    for tool in ('make', f'{sys.prefix}/bin/cyclonedx-py'):
        if shutil.which(tool) is None:
            pytest.skip(f'{tool} is not installed')
    checkout = copy_checkout(tmp_path / 'checkout')
    # Of .venv there is no copy: this environment stands for it.
    command = ['make', '-o', '.venv/.installed', f'BIN={sys.prefix}/bin', 'sbom']
    done = subprocess.run(command, cwd=checkout, capture_output=True, text=True, check=False)
    if done.returncode and re.search('NewConnectionError|Max retries exceeded', done.stderr):
        pytest.skip('PyPI cannot be reached')
    assert done.returncode == 0, done.stderr
    (wheel,) = (checkout / 'dist').glob('*.whl')
    text = wheel.with_suffix('.whl.cdx.json').read_text('utf-8')
    bill = json.loads(text)
    assert bill['bomFormat'] == 'CycloneDX'
    assert 'file://' not in text
    found = {part['name'].lower(): part['version'] for part in bill['components']}
    assert found.pop('linkage_ros') == distribution('linkage_ros').version
    python = f'{sys.version_info.major}.{sys.version_info.minor}'
    assert found == dict(installed_by(root / 'requirements' / 'run.txt', python))
    assert found.keys() >= HARD


def test_make_demo_installs_the_view_extra(root):
    view = {requirement.name for requirement in wanted(root, 'view')}
    assert view <= {requirement.name for requirement in wanted(root, 'demo')}
