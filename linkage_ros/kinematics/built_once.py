# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
State that is built at its first use: once, by one thread, while all others wait for it.

All of it has one lock: what is built often needs something else that is built at its first use,
and with several locks two threads could wait for each other.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
import os
from threading import RLock
from typing import Any, ParamSpec, TYPE_CHECKING, TypeVar

P = ParamSpec('P')
T = TypeVar('T')

BUILD_LOCK = RLock()
"""The lock of the thread that builds."""

if hasattr(os, 'register_at_fork'):
    # A forked process would wait for ever for a thread that it does not have.
    os.register_at_fork(
        before=BUILD_LOCK.acquire,
        after_in_parent=BUILD_LOCK.release,
        after_in_child=BUILD_LOCK.release,
    )


if TYPE_CHECKING:
    BuiltProperty = cached_property
else:

    class BuiltProperty(cached_property):
        """A cached property under the one lock; in `functools` it has no lock, or its own."""

        def __get__(self, instance, owner=None):
            if instance is None:
                return self
            kept, name = vars(instance), self.attrname
            with BUILD_LOCK:
                if name not in kept:
                    kept[name] = self.func(instance)
                return kept[name]


def keep_results(build: Callable[P, T]) -> Callable[P, T]:
    """Return a function that keeps its results; each is built once, positional arguments only."""
    kept: dict[Any, T] = {}

    def get_result(*arguments: P.args, **_: P.kwargs) -> T:
        try:
            return kept[arguments]
        except KeyError:
            with BUILD_LOCK:
                if arguments not in kept:
                    kept[arguments] = build(*arguments)  # type: ignore[call-arg]
                return kept[arguments]

    return get_result
