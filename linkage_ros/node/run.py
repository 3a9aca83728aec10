# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Run nodes in this process until a signal ends them: ROS up, spin, ROS down, exit code."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
import gc
from math import inf
import sys
from threading import Event, Thread
from time import monotonic
from typing import Any, Protocol

from linkage_ros.node.node import LinkageNode
from linkage_ros.node.real_time import leave_out_shared_memory
from linkage_ros.signals import bounded_end, raise_on_signals, StoppedError
import rclpy
from rclpy.executors import (
    ExternalShutdownException,
    ShutdownException,
    SingleThreadedExecutor,
)
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions

EXIT_OK, EXIT_INCOMPLETE, EXIT_CONFIGURATION = 0, 1, 2

_SWITCH_INTERVAL = 1e-4
_LOOK = 0.1
_AFTER_FAILURE = 0.01
"""Pause of the executor after a failure, in [s], so that it does not fail continuously."""


class LiveView(Protocol):
    """Displays a run while it goes on."""

    def begin(self, node: LinkageNode) -> None:
        """Prepare to show a node; called before its first tick."""

    def show(self, node: LinkageNode) -> None:
        """Show the current state of the node; called ten times a second on another thread."""

    def close(self) -> None:
        """Release the screen; called before the node ends its run."""


def run_linkage_node(
    stop: Event,
    arguments: Sequence[str],
    overrides: Mapping[str, Any] | None = None,
    *,
    seconds: float = inf,
    patience: float = 0.0,
    view: LiveView | None = None,
    at_end: Callable[[LinkageNode], None] | None = None,
    raise_errors: bool = False,
) -> int:
    """
    Run the linkage node until the event is set, or for ``seconds`` from its first tick.

    ``arguments`` follow the program's name; ``overrides`` are further parameters of the node. The
    first message for the crank may take ``patience`` seconds. ``at_end`` is called when the bag is
    closed. Return 0; 1 if the recording failed or the tick ended early; 2 if the configuration is
    wrong, which is a LinkageError with ``raise_errors``. A StoppedError says that a signal arrived
    before the node was configured.
    """
    # The tick shares the interpreter with executor and recorder: at the default switch interval it
    # would wait 5 ms for them.
    sys.setswitchinterval(_SWITCH_INTERVAL)
    leave_out_shared_memory()
    try:
        rclpy.init(
            args=['linkage_node', *arguments], signal_handler_options=SignalHandlerOptions.NO
        )
        parameters = [Parameter(name, value=value) for name, value in (overrides or {}).items()]
        node = LinkageNode(parameter_overrides=parameters, logs_failure=not raise_errors)
    except Exception as error:  # noqa: BLE001 (rcl's errors have no common base class)
        print(f'linkage_node: {_first_line(error)}; see linkage_node --help', file=sys.stderr)
        rclpy.try_shutdown()
        return EXIT_CONFIGURATION
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    code = EXIT_INCOMPLETE
    try:
        code = _run_node(node, executor, stop, seconds, patience, view)
        if raise_errors and node.failure is not None:
            raise node.failure
        if code == EXIT_OK and at_end is not None:
            at_end(node)
        if node.recording.failure or (node.loop is not None and node.loop.failure):
            code = code or EXIT_INCOMPLETE
        return code
    finally:
        node.end_run()
        with bounded_end(EXIT_CONFIGURATION if node.failure is not None else code):
            executor.shutdown()
            node.destroy_node()
            rclpy.try_shutdown()


def _run_node(
    node: LinkageNode,
    executor: SingleThreadedExecutor,
    stop: Event,
    seconds: float,
    patience: float,
    view: LiveView | None,
) -> int:
    """Start the node, unless told otherwise, and run it to its end."""
    autostart = node.get_parameter('autostart').value
    if autostart:
        with raise_on_signals():
            if stop.is_set():  # by an earlier signal
                raise StoppedError
            node.trigger_configure()
        if node.failure is not None:
            return EXIT_CONFIGURATION
    if view is not None:
        view.begin(node)
    with _no_garbage_in_ticks():
        if autostart and node.trigger_activate() != TransitionCallbackReturn.SUCCESS:
            return EXIT_INCOMPLETE
        gc.freeze()  # includes the objects built for the ticks
        return _spin_until_end(node, executor, stop, seconds, patience, view)


@contextmanager
def _no_garbage_in_ticks() -> Iterator[None]:
    """
    Disable Python's automatic cyclic garbage collection; explicit `gc.collect` calls replace it.

    A tick makes no cycles, but with a hundred linkages it makes enough objects to trigger a
    collection in every tick. Objects that exist before the first tick are frozen: to search them
    takes 10 ms.
    """
    gc.collect()
    gc.freeze()
    gc.disable()
    try:
        yield
    finally:
        gc.enable()
        gc.unfreeze()


def _spin_until_end(
    node: LinkageNode,
    executor: SingleThreadedExecutor,
    stop: Event,
    seconds: float,
    patience: float,
    view: LiveView | None,
) -> int:
    """Spin until the end, and end the run of the node."""
    # The executor waits without a timeout, which no signal would interrupt. So it has its own
    # thread and does not poll: each of its rounds costs as much as five ticks.
    ended = Event()
    serving = Thread(
        target=_serve_callbacks, args=(node, executor, ended), name='executor', daemon=True
    )
    serving.start()
    begin = monotonic()
    waits_until, end = begin + patience, begin + seconds
    while not stop.wait(_LOOK) and serving.is_alive():
        now = monotonic()
        if now < waits_until and not _is_heard(node):
            end = now + seconds
        if now >= end:
            break
        gc.collect()
        if view is not None:
            view.show(node)
        if node.loop is not None and node.loop.failure:
            break
    served = serving.is_alive()
    # A shutdown of the executor while it waits is a race: if lost, it waits forever. The node's
    # watch timer wakes it several times a second.
    ended.set()
    serving.join()
    if view is not None:
        view.close()
    node.end_run()
    return EXIT_OK if served else EXIT_INCOMPLETE


def _is_heard(node: LinkageNode) -> bool:
    """Return whether a message for the crank has come, where the drive wants some."""
    if node.loop is None:
        return False
    counts = node.loop.counts
    return bool(counts.received if node.crank_topic else counts.published)


def _serve_callbacks(node: LinkageNode, executor: SingleThreadedExecutor, ended: Event) -> None:
    # rclpy raises here what a service callback raises; its own services raise for a parameter of
    # unknown type. A client's request must neither end the node nor show a traceback.
    while not ended.is_set():
        try:
            executor.spin_once()
        except (ExternalShutdownException, ShutdownException) as error:  # noqa: PERF203
            node.get_logger().error(f'the executor has stopped: {type(error).__name__}: {error}')
            return
        except Exception as error:  # noqa: BLE001 (see above)
            node.warn_of_failure(f'a call failed: {type(error).__name__}: {_first_line(error)}')
            ended.wait(_AFTER_FAILURE)


def _first_line(error: Exception) -> str:
    return ' '.join((str(error).strip() or type(error).__name__).splitlines()[:1])
