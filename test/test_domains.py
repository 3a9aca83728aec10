# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A ROS domain belongs to one process of the machine at a time."""

from contextlib import ExitStack
import subprocess
import sys

from linkage_ros import domains
from linkage_ros.domains import held_domain, private_domain
from linkage_ros.errors import LinkageError
import pytest

HOLD = (
    'from linkage_ros.domains import private_domain; print(private_domain(), flush=True); input()'
)


def holder():
    """Start a process that holds a domain, and return it with the domain."""
    process = subprocess.Popen(
        [sys.executable, '-c', HOLD], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    return process, int(process.stdout.readline())


def held(domain):
    """Return whether this process could hold a domain."""
    with domains._lock_domain(domain) as locked:
        return locked


def test_process_keeps_its_ros_domain():
    assert private_domain() == private_domain()


def test_killed_process_releases_its_ros_domain():
    with ExitStack() as stack:
        taken = {stack.enter_context(held_domain()) for _ in range(20)}
        assert len(taken) == 20
        assert private_domain() not in taken
        process, domain = holder()
        try:
            assert domain not in taken
            assert not held(domain)
        finally:
            process.kill()
            process.communicate()
        assert held(domain)


def test_symbolic_link_named_as_a_lock_is_not_followed(tmp_path, monkeypatch):
    """Any user may make one in the folder of temporary files."""
    monkeypatch.setattr(domains, 'gettempdir', lambda: str(tmp_path))
    precious = tmp_path / 'precious'
    precious.write_text('content')
    (tmp_path / 'linkage_ros_domain_7').symlink_to(precious)
    (tmp_path / 'linkage_ros_domain_8').write_text('content')
    assert not held(7)
    assert held(8)
    assert precious.read_text() == (tmp_path / 'linkage_ros_domain_8').read_text() == 'content'


def test_exhausted_ros_domains_are_reported_in_one_line(monkeypatch):
    # Domains that no graph uses: the real ones are needed by tests beside this one.
    monkeypatch.setattr(domains, '_DOMAINS', range(1001, 1003))
    with (
        held_domain() as one,
        held_domain() as other,
        pytest.raises(
            LinkageError, match=r'^ROS_DOMAIN_ID: 2 graphs run on this machine; end some'
        ),
        held_domain(),
    ):
        pass
    assert {one, other} == {1001, 1002}
