# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Topics and services that a scene asks for, in addition to the joint states."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, TYPE_CHECKING

from linkage_ros.bag import Topic, WRENCH_TOPICS
from linkage_ros.description import Scene
from linkage_ros.errors import LinkageError
from linkage_ros.messages import text_message
from linkage_ros.node.bag_topics import bag_topic
from linkage_ros.node.run_recording import DESCRIPTION
from linkage_ros.replay import announced_text, change_text, EXTRA, message_type, scene_files
from linkage_ros.tick import Pipeline, RecordedTopics, TakeMessage
from linkage_ros.workbench import find_tool
from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.subscription import Subscription
from rclpy.topic_endpoint_info import TopicEndpointInfo
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool

if TYPE_CHECKING:
    from linkage_ros.stages.faults import FaultChange

SCENE_TOPIC = '~/scene'

CRANK_QOS = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Sensor data QoS with a deeper queue: even at a slow tick every sample gets into the bag."""

OUTPUT_QOS = QoSProfile(depth=10)
"""Reliable and volatile, as robot_state_publisher and RViz expect."""

_DESCRIPTION_QOS = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""As robot_state_publisher and RViz expect of a robot model, whenever they start."""

SCENE_QOS = _DESCRIPTION_QOS
"""A page that is opened later has to know the linkage."""

CHANGES_QOS = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""A late subscriber has to know which faults are on."""

Inject = Callable[[str, SetBool.Request, SetBool.Response], SetBool.Response]


class SceneTopics:
    """
    The topics and services of a scene, from its configuration to its clean-up.

    ``on_inject`` serves a fault's service; its first argument is the fault's name.
    """

    def __init__(self, node: Node, on_inject: Inject) -> None:
        self._node = node
        self._on_inject = on_inject
        self._fault_kinds: dict[str, str] = {}
        self._change_publisher: Publisher | None = None
        self._description: Publisher | None = None
        self.description = b''
        """Serialized message with the robot model; empty if the scene asks for none."""
        self._scene_publisher: Publisher | None = None
        self._injectors: list[Any] = []
        self.extras: list[Publisher] = []
        """Publishers of the pipeline's auxiliary topics."""
        self._crank_name = ''
        self.crank: Subscription | None = None
        """Subscription to the drives' topic; None without one."""
        self.wrenches: list[Subscription] = []
        """Subscriptions to the topics of wrenches on links."""

    def connect(self, pipeline: Pipeline) -> None:
        """
        Create what the scene asks for, and nothing else.

        LinkageError if the package of a message is not installed, or the topic of a wrench is
        taken.
        """
        self.disconnect()
        node, overridable = self._node, QoSOverridingOptions.with_default_policies()
        for extra in pipeline.extras:
            self.extras.append(
                node.create_publisher(
                    message_type(extra.message, f'effects.{extra.effect}'),
                    extra.topic,
                    OUTPUT_QOS,
                    qos_overriding_options=overridable,
                )
            )
        self._crank_name = pipeline.topic
        if pipeline.topic:
            self.crank = node.create_subscription(
                JointState,
                pipeline.topic,
                never_called,
                CRANK_QOS,
                callback_group=TakenByTick(),
                qos_overriding_options=overridable,
            )
        if pipeline.injection is not None:
            self._change_publisher = node.create_publisher(
                message_type('std_msgs/msg/String', 'faults'), '~/faults', CHANGES_QOS
            )
            for name, fault in pipeline.injection.faults.items():
                self._fault_kinds[name] = fault.kind
                serve = partial(self._on_inject, name)
                self._injectors.append(node.create_service(SetBool, f'~/inject/{name}', serve))
        if pipeline.wrenches:
            self._connect_wrenches(pipeline, overridable)

    def _connect_wrenches(self, pipeline: Pipeline, overridable: QoSOverridingOptions) -> None:
        """Subscribe to the topics of wrenches, unless the node has other messages there."""
        node = self._node
        kind = message_type('geometry_msgs/msg/WrenchStamped', 'loads.wrenches')
        others: list[Any] = [*node.publishers, *node.subscriptions]
        taken = {each.topic_name for each in others}
        taken |= {node.resolve_topic_name(name) for name in (SCENE_TOPIC, 'robot_description')}
        for wrench in pipeline.wrenches:
            name = node.resolve_topic_name(wrench.topic)
            if name in taken:
                raise LinkageError(
                    f'{wrench.key}.topic',
                    f'{name} is another topic of the node',
                    'write or remap another',
                )
            taken.add(name)
            self.wrenches.append(
                node.create_subscription(
                    kind,
                    wrench.topic,
                    never_called,
                    CRANK_QOS,
                    callback_group=TakenByTick(),
                    qos_overriding_options=overridable,
                )
            )

    def publish_description(self, scene: Scene, pipeline: Pipeline) -> None:
        """
        Publish the linkages as a robot model, once, with transient-local durability.

        LinkageError if the published joints do not determine the pose of every link.
        """
        text_type = message_type('std_msgs/msg/String', 'robot_description')
        model = find_tool('robot_description').scene_urdf(scene, pipeline.closures).decode()
        self._description = self._node.create_publisher(
            text_type, 'robot_description', _DESCRIPTION_QOS
        )
        self.description = text_message(model)
        self._description.publish(self.description)

    def publish_scene(self, scene: Scene, pipeline: Pipeline, joint_states: str) -> None:
        """
        Publish the files of the scene, once, with transient-local durability.

        A page on another machine so knows the linkage, the topics and the faults; ``joint_states``
        is the resolved name of their topic.
        """
        topics = {'joint_states_topic': joint_states}
        if self.crank is not None:
            topics['crank_topic'] = self.crank_topic
        if self._change_publisher is not None:
            topics['faults_topic'] = self._change_publisher.topic_name
        text_type = message_type('std_msgs/msg/String', '~/scene')
        self._scene_publisher = self._node.create_publisher(text_type, SCENE_TOPIC, SCENE_QOS)
        files = scene_files(scene, topics, '')
        self._scene_publisher.publish(text_message(announced_text(files)))

    def disconnect(self) -> None:
        """Remove all topics and services."""
        for publisher in (
            *self.extras,
            self._change_publisher,
            self._description,
            self._scene_publisher,
        ):
            if publisher is not None:
                self._node.destroy_publisher(publisher)
        for service in self._injectors:
            self._node.destroy_service(service)
        for subscription in (*self.wrenches, self.crank):
            if subscription is not None:
                self._node.destroy_subscription(subscription)
        self.wrenches = []
        self.extras, self._injectors, self._fault_kinds = [], [], {}
        self._change_publisher = self._description = self._scene_publisher = self.crank = None
        self.description = b''

    @property
    def crank_topic(self) -> str:
        """Return the resolved name of the drives' topic; '' for none."""
        return '' if self.crank is None else str(self.crank.topic_name)

    @property
    def crank_publishers(self) -> list[TopicEndpointInfo]:
        """Return the publishers on that topic."""
        # With the name before remapping: rclpy remaps its argument again.
        if self.crank is None:
            return []
        return self._node.get_publishers_info_by_topic(self._crank_name)

    @property
    def take_sample(self) -> TakeMessage | None:
        """Return a function that takes the next message for the drives; None without a topic."""
        if self.crank is None:
            return None
        return partial(self.crank.handle.take_message, JointState, True)

    @property
    def take_wrenches(self) -> list[TakeMessage]:
        """Return functions that take the next message of each topic with a wrench."""
        return [partial(one.handle.take_message, one.msg_type, True) for one in self.wrenches]

    def publish_change(self, change: FaultChange) -> bytes:
        """Publish the begin or end of a fault; return the serialized message."""
        assert self._change_publisher is not None
        message = text_message(change_text(change, self._fault_kinds[change.name]))
        self._change_publisher.handle.publish_raw(message)
        return message

    def describe_topics(self, handles: RecordedTopics) -> dict[int, tuple[str, Topic]]:
        """Describe the topics for a bag, by their handles."""
        node, topics = self._node, {}
        if handles.crank is not None:
            publishers = self.crank_publishers
            qos = publishers[0].qos_profile if publishers else CRANK_QOS
            topics[handles.crank] = 'crank_topic', bag_topic(self.crank_topic, JointState, qos)
        for handle, wrench in zip(handles.wrenches, self.wrenches, strict=True):
            described = bag_topic(wrench.topic_name, wrench.msg_type, CRANK_QOS)
            topics[handle] = WRENCH_TOPICS, described
        if handles.faults is not None and (changes := self._change_publisher) is not None:
            described = bag_topic(changes.topic_name, changes.msg_type, CHANGES_QOS)
            topics[handles.faults] = 'faults_topic', described
        # Recorded for the replay only; not published on the graph.
        time_type = message_type('builtin_interfaces/msg/Time', 'record')
        withheld, resets = (
            bag_topic(f'{node.get_fully_qualified_name()}/{name}', time_type, OUTPUT_QOS)
            for name in ('withheld', 'resets')
        )
        if handles.suppressed is not None:
            topics[handles.suppressed] = 'withheld_topic', withheld
        for handle, extra in zip(handles.extras, self.extras, strict=True):
            described = bag_topic(extra.topic_name, extra.msg_type, extra.qos_profile)
            topics[handle] = EXTRA, described
        topics[handles.resets] = 'resets_topic', resets
        if (model := self._description) is not None:
            described = bag_topic(model.topic_name, model.msg_type, _DESCRIPTION_QOS)
            topics[handles.description] = DESCRIPTION, described
        return topics


class TakenByTick(CallbackGroup):
    """A callback group that no executor serves: the tick takes the messages itself."""

    def can_execute(self, _: Any) -> bool:
        return False

    def beginning_execution(self, _: Any) -> bool:
        return False

    def ending_execution(self, _: Any) -> None:
        pass


def never_called(_: Any) -> None:
    """Serve as the callback that rclpy requires of a subscription."""
