# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The node: crank samples in, joint states of the dependent joints out.

A lifecycle node. The tick runs on a separate thread (`tick_loop`). This module runs on the
executor: transitions, services, parameters, diagnostics, and all logging.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial, wraps
from math import inf
from pathlib import Path
from sys import maxsize
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from linkage_ros.description import Confinement, load_scene, Scene, scene_notes
from linkage_ros.errors import LinkageError
from linkage_ros.kinematics import Closure
from linkage_ros.messages import NANOSECONDS
from linkage_ros.node import pacing
from linkage_ros.node.conditions import RunState, Warnings
from linkage_ros.node.diagnostics import make_statuses
from linkage_ros.node.pacing import ClockGuard
from linkage_ros.node.parameters import (
    declare_parameters,
    LINKAGE_NODE,
    nearness_limits,
    SET_BEFORE_CONFIGURATION,
)
from linkage_ros.node.real_time import RealTime, STANDSTILL, standstill_reason
from linkage_ros.node.run_recording import RunRecording
from linkage_ros.node.scene_topics import never_called, OUTPUT_QOS, SceneTopics, TakenByTick
from linkage_ros.replay import own_joint_states
from linkage_ros.tick import Counts, Pace, Pipeline, TickLoop
from rcl_interfaces.msg import SetParametersResult
from rclpy._rclpy_pybind11 import InvalidHandle, RCLError
from rclpy.clock import Clock, ClockType
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.serialization import serialize_message
from rclpy.time import Time
from rosgraph_msgs.msg import Clock as ClockMessage
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool, Trigger

_CLOCK_QOS = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
_DIAGNOSTICS_QOS = QoSProfile(depth=1)
_WATCH_PERIOD = 0.25
_NOT_YET_KNOWN = '_NODE_NAME_UNKNOWN_'
_LEASE = 25.0
"""How long another publisher is seen without a message from it and without a warning, in [s]: the
middleware remembers one that was killed for up to 20 s."""
_TWIN_PATIENCE = 0.5
"""How long a node of the same name is seen without a warning, in [s]: one that has just ended."""

Transition = Callable[['LinkageNode', LifecycleState], TransitionCallbackReturn]


class DeferredResponse:
    """
    Defers the answer of a service, so that its callback returns before the answer is known.

    At most one answer can be pending. A coroutine as callback would do so too, but then rclpy's
    executor polls it continuously, and each round of the executor costs as much as five ticks.
    """

    def __init__(self, service: Any) -> None:
        self._send = service.send_response
        self._deferred: Any = None
        self._request_header: Any = None
        service.send_response = self._send_or_keep

    def keep_response(self, response: Any) -> Any:
        """Return the response for the callback to return; it is not sent yet."""
        self._deferred = response
        return response

    def send_answer(self, success: bool, message: str) -> None:
        """Send the deferred response; call it on the executor's thread or after its end."""
        response, self._deferred = self._deferred, None
        response.success, response.message = success, message
        self._send(response, self._request_header)

    def _send_or_keep(self, response: Any, to: Any) -> None:
        if response is self._deferred:
            self._request_header = to
        else:
            self._send(response, to)


def _log_errors(transition: Transition) -> Transition:
    """Log an exception that a transition raises; rclpy would hide it."""

    @wraps(transition)
    def report_errors(node: LinkageNode, state: LifecycleState) -> TransitionCallbackReturn:
        try:
            return transition(node, state)
        except Exception as error:  # noqa: BLE001 (rclpy would hide any of them)
            node.get_logger().error(f'{transition.__name__}: {type(error).__name__}: {error}')
            return TransitionCallbackReturn.ERROR

    return report_errors


class LinkageNode(LifecycleNode):
    """Solves a linkage for a crank; docs/reference lists topics, parameters and services."""

    def __init__(self, *, logs_failure: bool = True, **options: Any) -> None:
        super().__init__('linkage_node', **options)
        self._logs_failure = logs_failure
        declare_parameters(self, LINKAGE_NODE)
        self._set_at_start = self._set_scene()
        self.failure: LinkageError | None = None
        """Reason why the node could not be configured."""
        self.recording = RunRecording(self.get_logger())
        self.scene: Scene | None = None
        self._closures: list[Closure] = []
        self.loop: TickLoop | None = None
        """Tick loop of this run, or of the last one; None before the first."""

        overridable = QoSOverridingOptions.with_default_policies()
        self._joint_states = self.create_publisher(
            JointState, 'joint_states', OUTPUT_QOS, qos_overriding_options=overridable
        )
        self._scene_topics = SceneTopics(self, self._on_inject)
        self._diagnostics = self.create_publisher(
            DiagnosticArray, '/diagnostics', _DIAGNOSTICS_QOS
        )
        self._clock_subscription = self.create_subscription(
            ClockMessage, '/clock', never_called, _CLOCK_QOS, callback_group=TakenByTick()
        )
        self.create_service(Trigger, '~/reset', self._on_reset)
        self.create_service(Trigger, '~/start_recording', self._on_start_recording)
        self.create_service(Trigger, '~/stop_recording', self._on_stop_recording)
        self._snapshot_answers = DeferredResponse(
            self.create_service(Trigger, '~/snapshot', self._on_snapshot)
        )
        self._snapshot_written = self.create_guard_condition(self.recording.collect_snapshot)
        # On the steady clock: the node's clock stops when the simulation does.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(_WATCH_PERIOD, self._watch_tick, clock=steady)
        change = self._service_change_state
        change.callback = partial(self._on_change_state, change.callback)
        self._clock_guard = ClockGuard(self._time_source)
        self._activation_time = 0
        self.add_on_set_parameters_callback(self._on_parameters)
        self._warnings = Warnings(self.get_logger())
        self._twin_since = self._several_since = inf
        self._real_time = RealTime(
            self.get_parameter('thread_priority').value,
            [core for core in self.get_parameter('cpu_affinity').value if core != -1],
            self.get_parameter('lock_memory').value,
        )
        why = standstill_reason()
        self._middleware = {'Middleware': why} if why else {}

    @property
    def crank_topic(self) -> str:
        """Return the resolved name of the topic of the drives; '' for none."""
        return self._scene_topics.crank_topic

    # Transitions.

    @_log_errors
    def on_configure(self, _state: LifecycleState) -> TransitionCallbackReturn:
        """Load the scene and check that it can be built."""
        file, settings = self._set_scene()
        try:
            if not file:
                raise LinkageError(
                    'parameter scene', "'' names no file", 'start with --ros-args -p scene:=FILE'
                )
            scene = load_scene(file, settings, self._confinement)
            pipeline = Pipeline(scene)  # fails here if it cannot be built, not at the first tick
            self._scene_topics.connect(scene, pipeline)
            for closure in pipeline.closures:
                # Computed here, so that the first tick does not wait: the branch of an iterated
                # linkage is followed at this point.
                _ = closure.singular_inputs
            self._scene_topics.publish_scene(scene, pipeline, self._joint_states.topic_name)
        except LinkageError as error:
            self._scene_topics.disconnect()
            self.failure = error
            if self._logs_failure:
                self.get_logger().error(str(error))
            return TransitionCallbackReturn.FAILURE
        for note in scene_notes(scene):
            self.get_logger().warning(str(note))
        self.failure, self.scene, self._closures = None, scene, pipeline.closures
        return TransitionCallbackReturn.SUCCESS

    def _set_scene(self) -> tuple[str, list[str]]:
        """Return the scene's file and the settings of its keys, as the parameters have them."""
        settings = [setting for setting in self.get_parameter('set').value if setting]
        if self.get_parameter('model_joints').value:
            settings.append('model_joints=true')
        return self.get_parameter('scene').value, settings

    @property
    def _confinement(self) -> Confinement | None:
        """Return what the scene may name; None for what the process was started with."""
        if self._set_scene() == self._set_at_start:
            return None
        own_file, _ = self._set_at_start
        return Confinement(
            folder=Path(self.get_parameter('scene_directory').value).absolute(),
            own_file=own_file,
            runs=None if self.get_parameter('runs_directory').value else Path.cwd(),
            trusts_effects=self.get_parameter('trust_effects').value,
        )

    @_log_errors
    def on_activate(self, _: LifecycleState) -> TransitionCallbackReturn:
        """Start ticking, and recording if the scene says so."""
        assert self.scene is not None
        self.loop = self._build_loop(self.scene)
        take_crank = self._scene_topics.take_sample
        for take in (*([take_crank] if take_crank else []), *self._scene_topics.take_wrenches):
            while take() is not None:
                pass  # discard messages from before this run
        self._activation_time = time.monotonic_ns()
        counts = self.loop.read_counts(self._activation_time)
        self._last_counts = self._previous_counts = counts
        self._warnings = Warnings(self.get_logger(), counts)
        if self.scene.record is not None:
            self._start_recording()
        self._real_time.lock_memory()
        self.loop.start(self._real_time.wrap_pace(self._make_pace(self.scene.rate)))
        if self._middleware:
            self.get_logger().info(STANDSTILL)
        rate = f'at {self.scene.rate:g} Hz' if self.scene.rate else 'once for every crank sample'
        cranks = ', '.join(
            joint
            for scene_linkage in self.scene.linkages
            for joint in scene_linkage.sampled_joints
        )
        drives = ' and '.join(
            dict.fromkeys(scene_linkage.drive[0] for scene_linkage in self.scene.linkages)
        )
        source = f'from {self.crank_topic}' if self.crank_topic else f'driven by {drives}'
        wrenches = [wrench.topic_name for wrench in self._scene_topics.wrenches]
        source += f'; wrenches from {" and ".join(wrenches)}' if wrenches else ''
        to = [
            publisher.topic_name for publisher in (self._joint_states, *self._scene_topics.extras)
        ]
        self.get_logger().info(
            f'{self.scene.name}: ticking {rate}; crank {cranks} {source}; '
            f'{", ".join(self.scene.joint_names)} to {" and ".join(to)}'
        )
        return TransitionCallbackReturn.SUCCESS

    @_log_errors
    def on_deactivate(self, _: LifecycleState) -> TransitionCallbackReturn:
        """Stop ticking and close the bag."""
        self.end_run()
        return TransitionCallbackReturn.SUCCESS

    @_log_errors
    def on_cleanup(self, _: LifecycleState) -> TransitionCallbackReturn:
        """Forget the scene."""
        self.scene = None
        self._scene_topics.disconnect()
        return TransitionCallbackReturn.SUCCESS

    @_log_errors
    def on_shutdown(self, _: LifecycleState) -> TransitionCallbackReturn:
        """End the run, from any state."""
        self.end_run()
        return TransitionCallbackReturn.SUCCESS

    @_log_errors
    def on_error(self, _: LifecycleState) -> TransitionCallbackReturn:
        """Return to unconfigured."""
        self.get_logger().error('a transition failed; the node is unconfigured now')
        self.end_run()
        self.scene = None
        self._scene_topics.disconnect()
        return TransitionCallbackReturn.SUCCESS

    def _build_loop(self, scene: Scene) -> TickLoop:
        pipeline = Pipeline(scene, self._closures)
        closures, injection = pipeline.closures, pipeline.injection
        crank = self._scene_topics.crank
        return TickLoop(
            partial(Pipeline, scene, closures, injection),
            self._scene_topics.take_sample,
            self._joint_states.handle.publish_raw,
            own_joint_states(scene) if self._shares_topic else None,
            [extra.handle.publish_raw for extra in self._scene_topics.extras],
            self._scene_topics.publish_change,
            # An unbounded queue: only the time of a tick limits how many messages it takes.
            depth=(crank.qos_profile.depth if crank is not None else 0) or maxsize,
            take_wrenches=self._scene_topics.take_wrenches,
        )

    def _make_pace(self, rate: float) -> Pace:
        simulated = self.get_parameter('use_sim_time').value
        if rate and simulated:
            return pacing.on_clock(self.context, self._clock_subscription, rate)
        if rate:
            return pacing.on_steady_clock(rate)
        assert self._scene_topics.crank is not None  # a scene without samples has a rate
        clock = self.get_clock()
        now = (lambda: int(clock.now().nanoseconds)) if simulated else time.time_ns
        return pacing.on_samples(self.context, self._scene_topics.crank, now)

    def end_run(self) -> None:
        """Stop ticking and close the bag; do nothing if nothing runs."""
        if self.loop is not None and self.loop.is_running:
            self.loop.stop()
            self._publish_diagnostics(self.loop)
            if self.crank_topic:
                self.get_logger().info(f'{self.crank_topic}: {self.loop.sample_counts_text}')
            self.recording.stop(self.loop)

    def _start_recording(self) -> str:
        assert self.scene is not None
        assert self.loop is not None
        directory = self.get_parameter('runs_directory').value
        return self.recording.start(
            self.scene,
            self.loop,
            directory,
            partial(self._scene_topics.describe_topics, self._joint_states, self._diagnostics),
            self._scene_topics.description,
        )

    # Services.

    def _on_change_state(
        self, change: Callable[[Any, Any], Any], request: Any, response: Any
    ) -> Any:
        """Answer a request for a transition that the state does not have; rclpy would raise."""
        try:
            return change(request, response)
        except RCLError as error:
            self.get_logger().error(f'change_state: {str(error).splitlines()[0]}')
            response.success = False
            return response

    def _on_reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if self.loop is None or not self.loop.is_running:
            return _fill_response(response, False, 'not active: nothing to reset')
        self.loop.reset_requested = True
        return _fill_response(response, True, 'crank and turns are reset before the next tick')

    def _on_inject(
        self, name: str, request: SetBool.Request, response: SetBool.Response
    ) -> SetBool.Response:
        if self.loop is None or not self.loop.is_running or self.loop.injection is None:
            return _fill_response(response, False, 'not active: nothing to inject into')
        self.loop.injection.request_change(name, bool(request.data))
        what = 'begins' if request.data else 'ends'
        return _fill_response(response, True, f'{name} {what} at the next tick')

    def _on_start_recording(
        self, _: Trigger.Request, response: Trigger.Response
    ) -> Trigger.Response:
        if self.loop is None or not self.loop.is_running:
            return _fill_response(response, False, 'not active: nothing to record')
        if self.recording.has_ended:
            self.recording.stop(self.loop)
        if self.loop.recorder is not None:
            return _fill_response(response, False, f'already {self.recording.state_text}')
        line = self._start_recording()
        return _fill_response(response, self.loop.recorder is not None, line)

    def _on_stop_recording(
        self, _: Trigger.Request, response: Trigger.Response
    ) -> Trigger.Response:
        if self.loop is None or self.loop.recorder is None:
            return _fill_response(response, False, 'not recording')
        return _fill_response(response, *self.recording.stop(self.loop))

    def _on_snapshot(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if self.loop is None or not self.loop.is_running:
            return _fill_response(response, False, 'not active: nothing is kept in memory')
        refusal = self.recording.begin_snapshot(
            self._snapshot_answers.send_answer, self._trigger_collect
        )
        if refusal:
            return _fill_response(response, False, refusal)
        return self._snapshot_answers.keep_response(response)

    def _trigger_collect(self) -> None:
        """Make the executor collect a snapshot; called on the thread that has written it."""
        with suppress(InvalidHandle):  # the write may finish after the node is destroyed
            self._snapshot_written.trigger()

    def _on_parameters(self, parameters: list[Parameter]) -> SetParametersResult:
        simulated = self.get_parameter('use_sim_time').value
        running = self.loop is not None and self.loop.is_running
        for parameter in parameters:
            if parameter.name in SET_BEFORE_CONFIGURATION and self.scene is not None:
                return SetParametersResult(
                    successful=False,
                    reason=f'{parameter.name} cannot change while the node is configured; '
                    'deactivate it and clean it up first',
                )
            if parameter.name == 'use_sim_time' and parameter.value != simulated and running:
                return SetParametersResult(
                    successful=False,
                    reason='use_sim_time cannot change while the node is active; deactivate it '
                    'first',
                )
        return SetParametersResult(successful=True)

    def warn_of_failure(self, failure: str) -> None:
        """Log a warning about a call that failed, at a limited rate."""
        self._warnings.warn('failure', failure, self.get_parameter('warning_period').value)

    # Monitoring.

    def _watch_tick(self) -> None:
        """Log the counts of the tick, and publish the diagnostics when they are due."""
        loop = self.loop
        if loop is None or not loop.is_running:
            return
        period = self.get_parameter('warning_period').value
        run = self._observe_run(loop)
        self._warnings.warn_of_conditions(run, period)
        while self._real_time.refused:
            self.get_logger().warning(self._real_time.refused.pop(0))
        # Without /clock messages no tick has taken crank messages yet.
        if run.inputs and (loop.counts.ticks or not run.scene.rate):
            self._warnings.warn_of_silence(run, self._crank_publishers, period)
        news = self.recording.check_failure(loop)
        due = self._last_counts.time + self.get_parameter('diagnostics_period').value * NANOSECONDS
        if news or time.monotonic_ns() >= due - 0.5 * _WATCH_PERIOD * NANOSECONDS:
            self._publish_diagnostics(loop)

    def _observe_run(self, loop: TickLoop) -> RunState:
        assert self.scene is not None
        return RunState(
            node=self.get_fully_qualified_name(),
            scene=self.scene,
            loop=loop,
            counts=loop.read_counts(time.monotonic_ns()),
            clock=self.get_clock().now().nanoseconds,
            recording=self.recording,
            limits=nearness_limits(self),
            is_simulated=self.get_parameter('use_sim_time').value,
            start=self._activation_time,
            crank_topic=self.crank_topic,
            wrench_topics=[wrench.topic_name for wrench in self._scene_topics.wrenches],
            clock_silence=self._clock_silence(),
            clock_refused=self._clock_guard.refused_count,
            system=self._real_time.in_force | self._middleware,
        )

    def _publish_diagnostics(self, loop: TickLoop) -> None:
        publishers = self._crank_publishers()
        loop.had_several_publishers |= len(publishers) > 1
        run = self._observe_run(loop)
        run = replace(
            run,
            publishers=publishers,
            cranks_doubled=self._doubled_cranks(publishers, run.counts),
            node_doubled=self._doubled_node(run.counts),
        )
        self._warnings.warn_of_conditions(run, self.get_parameter('warning_period').value)
        message = DiagnosticArray(status=make_statuses(run, self._last_counts))
        self._previous_counts, self._last_counts = self._last_counts, run.counts
        message.header.stamp = Time(nanoseconds=run.clock).to_msg()
        data = serialize_message(message)
        self._diagnostics.publish(data)
        if loop.recorder is not None:
            loop.recorder.offer(loop.topics.diagnostics, run.clock, run.clock, data)

    def _doubled_cranks(self, publishers: Sequence[str], counts: Counts) -> str:
        """Return that several publishers send the same crank, and the remedy; '' if none do."""
        assert self.loop is not None
        topic, shared = self.crank_topic, self._shares_topic or counts.ignored
        among = ' and '.join(publishers) or 'nodes without a name yet'
        # Two that send are told by their numbers: a publisher that starts again begins its numbers
        # again, once.
        if counts.interleaved - self._previous_counts.interleaved > 1:
            return f'{topic}: several publishers send the crank, among {among}; stop all but one'
        # One that sends nothing is told by its life, where others do not share the topic.
        cranks = sum(len(line.drive.stamps) for line in self.loop.pipeline.linkages)
        several = len(publishers) > 1 and not shared and cranks == 1
        self._several_since = min(self._several_since, counts.time) if several else inf
        if counts.time - self._several_since > _LEASE * NANOSECONDS:
            return f'{topic}: several publishers, {among}; stop all but one'
        return ''

    def _doubled_node(self, now: Counts) -> str:
        """Return that there is another node of this name, or of these joints; '' if not."""
        name = self.get_fully_qualified_name()
        nodes = self.get_node_names_and_namespaces()
        has_twin = [f'{space.rstrip("/")}/{node}' for node, space in nodes].count(name) > 1
        self._twin_since = min(self._twin_since, now.time) if has_twin else inf
        if now.time - self._twin_since > _TWIN_PATIENCE * NANOSECONDS:
            return (
                f'another node is named {name}: services and diagnostics of both mix; rename one, '
                'as by -r __ns:=/left'
            )
        before = self._previous_counts.own_interleaved
        if now.own_interleaved - before > 1:
            topic = self._joint_states.topic_name
            return f'{topic}: another publisher sends the same joints as {name}; stop one of them'
        return ''

    @property
    def _shares_topic(self) -> bool:
        """Whether the node publishes on the topic of the crank."""
        return self.crank_topic == self._joint_states.topic_name

    def _crank_publishers(self) -> list[str]:
        """Return the other publishers on the drives' topic, each by its node's name."""
        names = [
            f'{info.node_namespace.rstrip("/")}/{info.node_name}'
            for info in self._scene_topics.crank_publishers
            if info.node_name != _NOT_YET_KNOWN
        ]
        # One publisher of this name is the node itself; another may have the same name.
        if self._shares_topic and (own := self.get_fully_qualified_name()) in names:
            names.remove(own)
        return names

    def _clock_silence(self) -> float:
        """Return the time since the last ``/clock`` message, in [s]; 0 if unused."""
        if not self.get_parameter('use_sim_time').value:
            return 0.0
        heard = self._clock_guard.last_heard
        return (time.monotonic_ns() - heard) / NANOSECONDS if heard else inf


def _fill_response(response: Any, success: bool, message: str) -> Any:
    response.success = success
    response.message = message
    return response
