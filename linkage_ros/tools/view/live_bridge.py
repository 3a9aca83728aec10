# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The pages' end of a graph: follows a running linkage node, and does what a page asks of it.

It subscribes with best effort and a short queue, so a node does not wait for it; it takes what it
shows of that queue 60 times a second, however fast the node ticks. The poses come from the
published joints, as in the report, and not from the inputs by the program of `linkage compile`:
the page shows what the node has published, with its noise, play and faults.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future, InvalidStateError
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
import json
from math import inf, isfinite
import os
from queue import Empty, SimpleQueue
from threading import Event, Lock, Thread
from time import monotonic, sleep, time_ns
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from lifecycle_msgs.srv import GetState
from linkage_ros.description import SceneLinkage
from linkage_ros.errors import (
    did_you_mean,
    escape_unprintable,
    LinkageError,
    list_names,
    quote,
    shorten,
)
from linkage_ros.messages import (
    CrankSample,
    input_reader,
    JointStateReader,
    JointStateWriter,
    NANOSECONDS,
    Rejection,
)
from linkage_ros.node import (
    CHANGES_QOS,
    leave_out_shared_memory,
    never_called,
    SCENE_QOS,
    SCENE_TOPIC,
    TakenByTick,
)
from linkage_ros.replay import read_change
from linkage_ros.signals import bounded_end
from linkage_ros.stages.drives import DependentSampleReader, ExchangedInputs
from linkage_ros.tools.view.followed_run import diagnostics_content, FollowedRun, read_run
from linkage_ros.tools.view.hand_crank import HandCrank, HELD
from linkage_ros.tools.view.live import KINDS
import rclpy
from rclpy.clock import Clock, ClockType
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger

Floats = Sequence[float]

_STATES_PERIOD = 1.0 / 60.0
_HAND_PERIOD = 0.01
"""Time between two messages while a hand turns the crank, in [s]."""

_LOOK = 0.25
"""Time between two looks at whether the node is there, in [s]."""

_NODE_PERIOD = 1.0
"""Most time between two messages about the node, in [s]."""

_SILENT, _GONE = 0.75, 1.75
"""Times without any message after which a node is asked for its state, and taken for gone [s]."""

_SETTLED = 2.0
"""How long the graph is watched for a second node once it has a first one, in [s]."""

_SERVICE_PATIENCE, _SNAPSHOT_PATIENCE = 5.0, 80.0
"""Time limits of the node's answers, in [s]."""

_FARTHEST = 1e6
"""Greatest angle, slide or effort that a page may ask for."""

_NEWEST_QOS = QoSProfile(depth=4, reliability=ReliabilityPolicy.BEST_EFFORT)
_HAND_QOS = QoSProfile(depth=1)
"""Reliable, for any subscriber; only the newest crank matters."""

_PLAIN = ('snapshot', 'reset')
"""Requests that are services without an argument."""

_REQUESTS = ('fault', 'record', *_PLAIN, 'crank', 'effort')


@dataclass(slots=True, eq=False)
class _Call:
    """A call of a service of the node."""

    # The client of the service, and what is asked.
    client: Any
    request: Any
    future: Future[str]  # Has the line that the answer says
    until: float  # When it is given up, in [s]
    answer: Any = None  # The future of the client, as soon as the service is found and called


class LiveBridge:
    """
    Follows a linkage node, on its own thread; ``name`` becomes the node's full name.

    A name of '' takes the only node on the graph. ``patience`` is how long to wait for the node
    and its scene, in [s]; a domain of None takes the ROS domain of the environment. A LinkageError
    is raised if there is no such node, or there are several to choose from.
    """

    def __init__(
        self, name: str = '', *, patience: float = 10.0, domain: int | None = None
    ) -> None:
        leave_out_shared_memory()
        self._context = rclpy.Context()
        rclpy.init(
            context=self._context,
            domain_id=domain,
            signal_handler_options=SignalHandlerOptions.NO,
        )
        self._executor = SingleThreadedExecutor(context=self._context)
        without = Parameter('start_type_description_service', value=False)  # rclpy frees it twice
        self._node = Node(
            f'linkage_view_{os.getpid()}',
            context=self._context,
            use_global_arguments=False,
            parameter_overrides=[without],
        )
        self._executor.add_node(self._node)
        self._ending = Event()
        self._thread: Thread | None = None
        self._lock = Lock()
        self._newest: dict[str, tuple[int, str]] = dict.fromkeys(KINDS, (0, ''))
        self._listeners: list[Callable[[], None]] = []
        self._requests: SimpleQueue[tuple[Mapping[str, Any], Future[str]]] = SimpleQueue()
        self._calls: list[_Call] = []
        self._clients: dict[str, Any] = {}
        self._run: FollowedRun | None = None
        self._trouble = ''
        self._faults: dict[str, bool] = {}
        self._run_subscriptions: list[Any] = []
        self._statuses: list[DiagnosticStatus] = []
        self._lifecycle = ''
        self._pending_state: tuple[float, Any] | None = None
        self._last_heard = -inf
        self._is_present = False
        self._last_told = -inf
        self._cranks: CrankSample | None = None
        self._hand = HandCrank(())
        self._hand_publisher: Any = None
        self._hand_timer: Any = None
        self._effort: tuple[float, float] = (0.0, -inf)
        self.name = ''
        try:
            self.name = self._find_node(name, patience)
            self._wait_for_scene(patience)
        except BaseException:
            self.end()
            raise
        self._thread = Thread(target=self._spin_thread, name='bridge', daemon=True)
        self._thread.start()

    # For the pages; called on any thread.

    def add_listener(self, heard: Callable[[], None]) -> Callable[[], None]:
        """Call a function whenever there is news; return one that ends this."""
        with self._lock:
            self._listeners = [*self._listeners, heard]

        def stop_listening() -> None:
            with self._lock:
                self._listeners = [
                    listener for listener in self._listeners if listener is not heard
                ]

        return stop_listening

    def newest_message(self, kind: str) -> tuple[int, str]:
        """Return the number and the JSON of the newest message of a kind; 0 and '' for none."""
        return self._newest[kind]

    def send_request(self, content: Mapping[str, Any]) -> Future[str]:
        """Ask for something; the future has what the answer says, one line."""
        future: Future[str] = Future()
        self._requests.put((content, future))
        with suppress(Exception):  # the bridge has ended
            self._news.trigger()
        return future

    def end(self) -> None:
        """Leave the graph."""
        self._ending.set()
        if self._thread is not None:
            self._thread.join()
        with bounded_end(0):
            self._executor.shutdown()
            self._node.destroy_node()
            rclpy.try_shutdown(context=self._context)

    # The beginning.

    def _find_node(self, name: str, patience: float) -> str:
        """Return the full name of the node to follow."""
        wanted = f'/{name.lstrip("/")}' if name else ''
        until, settled = monotonic() + patience, inf
        names: list[str] = []
        while monotonic() < min(until, settled):
            names = self._scene_nodes()
            if wanted in names:
                return wanted
            if names and not wanted:
                settled = min(settled, monotonic() + _SETTLED)
            sleep(0.05)
        if len(names) == 1 and not wanted:
            return names[0]
        if wanted:
            remedy = did_you_mean(wanted, names, _node_remedy(names))
            raise LinkageError(f'--node {name}', 'is not a linkage node on this graph', remedy)
        reason = f'there are {len(names)} linkage nodes' if names else 'there is no linkage node'
        raise LinkageError('--node', f'{reason} on this graph', _node_remedy(names))

    def _scene_nodes(self) -> list[str]:
        """Return the full names of the nodes that publish a scene."""
        ending = SCENE_TOPIC.removeprefix('~')
        names = set()
        for topic, types in self._node.get_topic_names_and_types():
            if topic.endswith(ending) and types == ['std_msgs/msg/String']:
                for info in self._node.get_publishers_info_by_topic(topic):
                    name = f'{info.node_namespace.rstrip("/")}/{info.node_name}'
                    if name + ending == topic:
                        names.add(name)
        return sorted(names)

    def _wait_for_scene(self, patience: float) -> None:
        """Subscribe, and wait for the scene."""
        node = self._node
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._news = node.create_guard_condition(self._answer_requests)
        topic = self.name + SCENE_TOPIC.removeprefix('~')
        node.create_subscription(String, topic, self._on_scene, SCENE_QOS, raw=True)
        node.create_subscription(
            DiagnosticArray,
            '/diagnostics',
            self._on_diagnostics,
            QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT),
        )
        until = monotonic() + patience
        while self._run is None and not self._trouble and monotonic() < until:
            self._executor.spin_once(timeout_sec=0.1)
        if self._run is None:
            reason = self._trouble or 'has not sent its scene'
            remedy = 'run the same version of linkage_ros here and there'
            raise LinkageError(self.name, reason, remedy)
        node.create_timer(_STATES_PERIOD, self._take_states, clock=self._steady)
        node.create_timer(_LOOK, self._check_node, clock=self._steady)

    def _spin_thread(self) -> None:
        while not self._ending.is_set():
            try:
                self._executor.spin_once(timeout_sec=0.1)
            except Exception as error:  # noqa: BLE001, PERF203 (rcl's have no base class)
                # A message of the graph must not end the page.
                self._trouble = (
                    f'{type(error).__name__}: {shorten(escape_unprintable(str(error)), 200)}'
                )
                self._ending.wait(0.01)

    # What the node says.

    def _on_scene(self, message: bytes) -> None:
        """Learn the scene: at the beginning, and whenever the node is configured anew."""
        try:
            run = read_run(message, f'{self.name}/scene')
        except LinkageError as error:
            self._trouble = f'has a scene that cannot be read ({escape_unprintable(str(error))})'
        else:
            self._trouble = ''
            self._run = run
            self._follow_run(run)
            self._publish_news('model', {'model': run.model})
            self._last_heard, self._is_present = monotonic(), True
        self._last_told = -inf

    def _follow_run(self, run: FollowedRun) -> None:
        """Subscribe to the topics of a run, and forget the topics of the run before."""
        node = self._node
        for subscription in self._run_subscriptions:
            node.destroy_subscription(subscription)
        if self._hand_publisher is not None:
            node.destroy_timer(self._hand_timer)
            node.destroy_publisher(self._hand_publisher)
            self._hand_publisher = None
        self._cranks = None
        self._effort = 0.0, -inf
        self._faults = dict.fromkeys(run.scene.faults, False)
        self._run_subscriptions = []
        # Taken by a timer, so that a fast node costs this process nothing.
        self._joint_states = self._subscribe_polled(JointState, run.metadata.joint_states_topic)
        self._read_joints = JointStateReader(run.scene.joint_names)
        self._read_inputs = _crank_reader(run.drawn_linkage)
        self._crank_states = None
        if run.crank_topic not in ('', run.metadata.joint_states_topic):
            self._crank_states = self._subscribe_polled(JointState, run.crank_topic)
        if faults := run.metadata.faults_topic:
            # Latched: what began before comes now.
            self._run_subscriptions.append(
                node.create_subscription(String, faults, self._on_fault, CHANGES_QOS, raw=True)
            )
        if run.topic_driven is not None:
            self._hand = HandCrank(
                [
                    driven.unit == 'rad' and not isfinite(driven.limits.high - driven.limits.low)
                    for driven in run.topic_driven.linkage.inputs
                ]
            )

    def _subscribe_polled(self, kind: Any, topic: str) -> Any:
        subscription = self._node.create_subscription(
            kind, topic, never_called, _NEWEST_QOS, callback_group=TakenByTick()
        )
        self._run_subscriptions.append(subscription)
        return subscription

    def _on_fault(self, message: bytes) -> None:
        with suppress(ValueError):
            name, on = read_change(message)
            if name in self._faults:
                self._faults[name] = on
                self._publish_node()

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        own = [status for status in message.status if status.name.startswith(f'{self.name}: ')]
        if own:
            self._statuses, self._last_heard = own, monotonic()
            self._lifecycle = ''
            self._publish_node()

    def _take_states(self) -> None:
        """Take the newest joint states and crank, and tell them."""
        run = self._run
        assert run is not None
        joints = None
        for message in _take_all(self._joint_states):
            # Other nodes may publish on the same topic, or the crank comes by it.
            read = self._read_joints.read(message)
            joints = read if isinstance(read, CrankSample) else joints
            self._take_cranks(message)
        for message in _take_all(self._crank_states):
            self._take_cranks(message)
        if joints is not None:
            self._last_heard = monotonic()
            self._publish_news(
                'state', {'state': run.state_content(joints, self._cranks, time_ns())}
            )

    def _take_cranks(self, message: bytes) -> None:
        """Take the inputs that a message names."""
        inputs = self._read_inputs(message)
        if isinstance(inputs, CrankSample):
            self._cranks = inputs.merged_over(self._cranks)

    def _check_node(self) -> None:
        """Find out whether the node is there, and give up what it does not answer."""
        now = monotonic()
        self._attend_calls(now)
        if self._pending_state is not None and now > self._pending_state[0]:
            self._service_client(GetState, 'get_state').remove_pending_request(
                self._pending_state[1]
            )
            self._pending_state = None
        if now - self._last_heard > _SILENT and self._pending_state is None:
            client = self._service_client(GetState, 'get_state')
            if client.service_is_ready():
                called = client.call_async(GetState.Request())
                called.add_done_callback(self._on_lifecycle)
                self._pending_state = now + 2 * _SILENT, called
        there = now - self._last_heard <= _GONE
        if there != self._is_present or now - self._last_told >= _NODE_PERIOD:
            self._is_present = there
            self._publish_node()

    def _on_lifecycle(self, called: Any) -> None:
        self._pending_state = None
        if called.exception() is None and called.result() is not None:
            self._last_heard = monotonic()
            self._lifecycle = str(called.result().current_state.label)

    def _publish_node(self) -> None:
        """Tell how the node is."""
        if self._run is None:
            return
        self._last_told = monotonic()
        troubles = [[2, f'the node {self._trouble}']] if self._trouble else []
        told = diagnostics_content(self._statuses)
        node = {
            'name': self.name,
            'there': self._is_present,
            'state': self._lifecycle,
            'faults': self._faults,
            'drive': self._run.drive_name,
            **told,
            'diagnostics': troubles + told['diagnostics'],
        }
        self._publish_news('node', {'node': node})

    def _publish_news(self, kind: str, content: dict[str, Any]) -> None:
        number, _ = self._newest[kind]
        self._newest[kind] = number + 1, json.dumps(content, allow_nan=False)
        for heard in self._listeners:
            heard()

    # What the pages ask for.

    def _answer_requests(self) -> None:
        while True:
            try:
                content, future = self._requests.get_nowait()
            except Empty:
                return
            try:
                self._handle_request(content, future)
            except LinkageError as error:
                _send_reply(future, str(error))
            except Exception as error:  # noqa: BLE001 (rcl's have no base class)
                _send_reply(
                    future,
                    f'{type(error).__name__}: {shorten(escape_unprintable(str(error)), 200)}',
                )

    def _handle_request(self, content: Mapping[str, Any], future: Future[str]) -> None:
        """Do what a page asks for; the answer may come later."""
        do = content['do']
        if do == 'fault':
            name = content.get('name')
            if not isinstance(name, str) or name not in self._faults:
                raise LinkageError(
                    'fault', f'{quote(name)} is not in the scene', _choices_text(self._faults)
                )
            request = SetBool.Request(data=_read_flag(content))
            self._call_service(SetBool, f'inject/{name}', request, future)
        elif do == 'record':
            service = 'start_recording' if _read_flag(content) else 'stop_recording'
            self._call_service(Trigger, service, Trigger.Request(), future)
        elif do in _PLAIN:
            self._call_service(Trigger, do, Trigger.Request(), future)
        elif do == 'crank':
            _send_reply(future, self._turn_crank(content))
        elif do == 'effort':
            _send_reply(future, self._apply_effort(content))
        else:
            raise LinkageError('do', f'{quote(do)} is not known', _choices_text(_REQUESTS))

    def _call_service(self, kind: Any, service: str, request: Any, future: Future[str]) -> None:
        if not self._is_present:
            remedy = 'see whether the node runs'
            raise LinkageError(f'{self.name}/{service}', 'does not answer', remedy)
        patience = _SNAPSHOT_PATIENCE if service == 'snapshot' else _SERVICE_PATIENCE
        client = self._service_client(kind, service)
        self._calls.append(_Call(client, request, future, monotonic() + patience))
        self._attend_calls(monotonic())

    def _attend_calls(self, now: float) -> None:
        """Send the calls whose service is found by now, and give up those that are overdue."""
        for call in self._calls.copy():
            if call.answer is None and call.client.service_is_ready():
                call.answer = call.client.call_async(call.request)
                call.answer.add_done_callback(partial(self._on_answer, call))
            elif now > call.until:
                self._calls.remove(call)
                if call.answer is not None:
                    call.client.remove_pending_request(call.answer)
                _send_reply(call.future, f'{self.name} does not answer')

    def _on_answer(self, call: _Call, answer: Any) -> None:
        if call in self._calls:
            self._calls.remove(call)
            failed = answer.exception()
            _send_reply(call.future, str(failed) if failed else str(answer.result().message))

    def _service_client(self, kind: Any, service: str) -> Any:
        if service not in self._clients:
            self._clients[service] = self._node.create_client(kind, f'{self.name}/{service}')
        return self._clients[service]

    def _turn_crank(self, content: Mapping[str, Any]) -> str:
        run, target = self._require_drive('topic', 'crank'), _read_number(content, 'angle')
        assert run.topic_driven is not None
        number = content.get('input', 0)
        if type(number) is not int or not 0 <= number < len(run.topic_driven.input_names):
            count = len(run.topic_driven.input_names)
            raise LinkageError(
                'input', f'{quote(number)} is not the index of an input', f'name one of {count}'
            )
        at = [0.0] * len(run.topic_driven.input_names)
        known = self._cranks if run.topic_driven is run.drawn_linkage else None
        if known is not None and all(map(isfinite, known.angles)):
            at = list(known.angles)
        else:
            at[number] = target
        self._hand.set_target(number, target, at, monotonic())
        self._start_hand(run)
        return f'{list_names(run.topic_driven.sampled_joints)} on {run.crank_topic}, by hand'

    def _apply_effort(self, content: Mapping[str, Any]) -> str:
        run = self._require_drive('torque', 'effort')
        self._effort = _read_number(content, 'value'), monotonic()
        self._start_hand(run)
        return f'effort {self._effort[0]:g} on {run.crank_topic}'

    def _require_drive(self, drive: str, what: str) -> FollowedRun:
        run = self._run
        assert run is not None
        if run.topic_driven is None or run.topic_driven.drive[0] != drive:
            remedy = f'run a scene with the drive {drive}'
            raise LinkageError(what, f'is not taken by the drive {run.drive_name}', remedy)
        return run

    def _start_hand(self, run: FollowedRun) -> None:
        """Publish from now on, as long as a hand holds the crank."""
        assert run.topic_driven is not None
        if self._hand_publisher is None:
            self._hand_publisher = self._node.create_publisher(
                JointState, run.crank_topic, _HAND_QOS
            )
            self._hand_timer = self._node.create_timer(
                _HAND_PERIOD, self._publish_hand, clock=self._steady
            )
            self._write_crank = _crank_writer(run.topic_driven)
        if self._hand_timer.is_canceled():
            self._hand_timer.reset()

    def _publish_hand(self) -> None:
        assert self._run is not None
        assert self._run.topic_driven is not None
        now, stamp = monotonic(), time_ns()
        if (followed := self._hand.advance_to(now)) is not None:
            message = self._write_crank(stamp, *followed)
            self._hand_publisher.handle.publish_raw(message)
        elif now - self._effort[1] <= HELD:
            command = JointState(name=list(self._run.topic_driven.input_names[:1]))
            command.effort = [self._effort[0]]
            command.header.stamp.sec, command.header.stamp.nanosec = divmod(stamp, NANOSECONDS)
            self._hand_publisher.publish(command)
        else:
            self._hand_timer.cancel()


def _take_all(subscription: Any) -> list[bytes]:
    """Take the waiting messages of a subscription."""
    if subscription is None:
        return []
    taken: list[bytes] = []
    while len(taken) < _NEWEST_QOS.depth:
        taken_message = subscription.handle.take_message(JointState, True)
        if taken_message is None:
            break
        taken.append(taken_message[0])
    return taken


def _read_number(content: Mapping[str, Any], key: str) -> float:
    value: Any = content.get(key)
    if type(value) not in (int, float) or not abs(value) <= _FARTHEST:
        raise LinkageError(key, f'{quote(value)} is not valid', 'send a number')
    return float(value)


def _read_flag(content: Mapping[str, Any]) -> bool:
    on = content.get('on')
    if not isinstance(on, bool):
        raise LinkageError('on', f'{quote(on)} is not valid', 'send true or false')
    return on


def _exchange_of(scene_linkage: SceneLinkage) -> ExchangedInputs:
    """Return how the joints that its samples name move the inputs."""
    joints, branch = scene_linkage.instead_of_inputs, scene_linkage.drive[1].branch
    return ExchangedInputs(scene_linkage.closure, joints, branch)


def _crank_reader(scene_linkage: SceneLinkage) -> Callable[[bytes], CrankSample | Rejection]:
    """Return the reader of its inputs, as samples or published joints name them."""
    if not scene_linkage.instead_of_inputs:
        return input_reader(scene_linkage.input_names)
    exchange = _exchange_of(scene_linkage)
    return DependentSampleReader(exchange, scene_linkage.sampled_joints).read


def _crank_writer(scene_linkage: SceneLinkage) -> Callable[[int, Floats, Floats], bytes]:
    """Return the writer of samples as its drive takes them: of inputs, or of other joints."""
    write = JointStateWriter(scene_linkage.sampled_joints).write
    if not scene_linkage.instead_of_inputs:
        return write
    exchange = _exchange_of(scene_linkage)

    def write_joints(stamp: int, cranks: Floats, rates: Floats) -> bytes:
        return write(stamp, *exchange.joints_at(cranks, rates))

    return write_joints


def _choices_text(names: Sequence[str] | Mapping[str, Any]) -> str:
    return f'there are: {list_names(names)}' if names else 'there is none'


def _send_reply(future: Future[str], line: str) -> None:
    with suppress(InvalidStateError):  # the page has gone
        future.set_result(line)


def _node_remedy(names: Sequence[str]) -> str:
    if names:
        return f'name one of {list_names(names)}'
    return 'start one, in the same ROS_DOMAIN_ID (linkage run prints it)'
