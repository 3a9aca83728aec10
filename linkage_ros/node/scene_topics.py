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

from linkage_ros.bag import QosProfile, Topic, WRENCH_TOPICS
from linkage_ros.description import Scene
from linkage_ros.errors import LinkageError
from linkage_ros.messages import text_message
from linkage_ros.node.qos import offered_qos, recorded_qos
from linkage_ros.replay import (
    announced_text,
    change_text,
    describe_topic,
    message_type,
    scene_files,
)
from linkage_ros.tick import (
    CRANK,
    DESCRIPTION,
    DIAGNOSTICS,
    EXTRA,
    FAULTS,
    FAULTS_QOS,
    JOINT_STATES,
    LATCHED_QOS,
    list_run_topics,
    Pipeline,
    RunTopic,
    SENSOR_QOS,
    TakeMessage,
)
from linkage_ros.workbench import find_tool
from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.subscription import Subscription
from rclpy.topic_endpoint_info import TopicEndpointInfo
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool

if TYPE_CHECKING:
    from linkage_ros.stages.faults import FaultChange

SCENE_TOPIC = '~/scene'

CRANK_QOS = offered_qos(SENSOR_QOS)
OUTPUT_QOS = offered_qos(QosProfile())

CHANGES_QOS = offered_qos(FAULTS_QOS)

SCENE_QOS = offered_qos(LATCHED_QOS)
"""A page that is opened later has to know the linkage."""

_TAKEN = (CRANK, WRENCH_TOPICS)
"""Keys of the topics whose messages a tick takes."""

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
        self.description = b''
        """Serialized message with the robot model; empty if the scene asks for none."""
        self._topics: list[RunTopic] = []
        self._endpoints: dict[RunTopic, Any] = {}
        self._scene_publisher: Publisher | None = None
        self._injectors: list[Any] = []

    def connect(self, scene: Scene, pipeline: Pipeline) -> None:
        """
        Create what the scene asks for, and nothing else.

        LinkageError if the package of a message is not installed, the topic of a wrench is taken,
        or the published joints do not determine the pose of every link of the robot model.
        """
        self.disconnect()
        self._topics = list_run_topics(pipeline, has_description=scene.robot_description)
        self._check_wrenches(pipeline)
        for topic in self._topics:
            if topic.key in {*_TAKEN, EXTRA, FAULTS, DESCRIPTION}:
                self._endpoints[topic] = self._create_endpoint(topic)
        for publisher in self._with_key(DESCRIPTION):
            model = find_tool('robot_description').scene_urdf(scene, pipeline.closures).decode()
            self.description = text_message(model)
            publisher.publish(self.description)
        for name, fault in pipeline.injection.faults.items() if pipeline.injection else ():
            self._fault_kinds[name] = fault.kind
            serve = partial(self._on_inject, name)
            self._injectors.append(self._node.create_service(SetBool, f'~/inject/{name}', serve))

    def _create_endpoint(self, topic: RunTopic) -> Any:
        """Create the publisher of a topic, or the subscription whose messages the tick takes."""
        message = message_type(topic.type, topic.asked_by)
        qos, overridable = offered_qos(topic.qos), QoSOverridingOptions.with_default_policies()
        if topic.key in _TAKEN:
            return self._node.create_subscription(
                message,
                topic.name,
                never_called,
                qos,
                callback_group=TakenByTick(),
                qos_overriding_options=overridable,
            )
        options = overridable if topic.key == EXTRA else None
        return self._node.create_publisher(
            message, topic.name, qos, qos_overriding_options=options
        )

    def _check_wrenches(self, pipeline: Pipeline) -> None:
        """Raise LinkageError if the node has other messages on a topic with a wrench."""
        node = self._node
        others: list[Any] = [*node.publishers, *node.subscriptions]
        names = [topic.name for topic in self._topics if topic.key != WRENCH_TOPICS]
        taken = {topic.topic_name for topic in others}
        taken |= set(map(node.resolve_topic_name, (*names, SCENE_TOPIC, 'robot_description')))
        for wrench in pipeline.wrenches:
            name = node.resolve_topic_name(wrench.topic)
            if name in taken:
                raise LinkageError(
                    f'{wrench.key}.topic',
                    f'{name} is another topic of the node',
                    'write or remap another',
                )
            taken.add(name)

    def _with_key(self, key: str) -> list[Any]:
        """Return the endpoints of the topics with this key."""
        return [endpoint for topic, endpoint in self._endpoints.items() if topic.key == key]

    @property
    def extras(self) -> list[Publisher]:
        """Return the publishers of the pipeline's auxiliary topics."""
        return self._with_key(EXTRA)

    @property
    def wrenches(self) -> list[Subscription]:
        """Return the subscriptions to the topics of wrenches on links."""
        return self._with_key(WRENCH_TOPICS)

    @property
    def crank(self) -> Subscription | None:
        """Return the subscription to the drives' topic; None without one."""
        return next(iter(self._with_key(CRANK)), None)

    def publish_scene(self, scene: Scene, pipeline: Pipeline, joint_states: str) -> None:
        """
        Publish the files of the scene, once, with transient-local durability.

        A page on another machine so knows the linkage, the topics and the faults; ``joint_states``
        is the resolved name of their topic.
        """
        topics = [(JOINT_STATES, joint_states)] + [
            (topic.key, endpoint.topic_name)
            for topic, endpoint in self._endpoints.items()
            if topic.key in {CRANK, FAULTS}
        ]
        text_type = message_type('std_msgs/msg/String', '~/scene')
        self._scene_publisher = self._node.create_publisher(text_type, SCENE_TOPIC, SCENE_QOS)
        files = scene_files(scene, topics, '')
        self._scene_publisher.publish(text_message(announced_text(files)))

    def disconnect(self) -> None:
        """Remove all topics and services."""
        for endpoint in (*self._endpoints.values(), self._scene_publisher):
            if isinstance(endpoint, Subscription):
                self._node.destroy_subscription(endpoint)
            elif endpoint is not None:
                self._node.destroy_publisher(endpoint)
        for service in self._injectors:
            self._node.destroy_service(service)
        self._endpoints, self._injectors, self._fault_kinds = {}, [], {}
        self._scene_publisher, self.description = None, b''

    @property
    def crank_topic(self) -> str:
        """Return the resolved name of the drives' topic; '' for none."""
        return '' if self.crank is None else str(self.crank.topic_name)

    @property
    def crank_publishers(self) -> list[TopicEndpointInfo]:
        """Return the publishers on that topic."""
        # With the name before remapping: rclpy remaps its argument again.
        names = [topic.name for topic in self._topics if topic.key == CRANK]
        return [info for name in names for info in self._node.get_publishers_info_by_topic(name)]

    @property
    def take_sample(self) -> TakeMessage | None:
        """Return a function that takes the next message for the drives; None without a topic."""
        if self.crank is None:
            return None
        return partial(self.crank.handle.take_message, JointState, True)

    @property
    def take_wrenches(self) -> list[TakeMessage]:
        """Return functions that take the next message of each topic with a wrench."""
        return [
            partial(subscription.handle.take_message, subscription.msg_type, True)
            for subscription in self.wrenches
        ]

    def publish_change(self, change: FaultChange) -> bytes:
        """Publish the begin or end of a fault; return the serialized message."""
        message = text_message(change_text(change, self._fault_kinds[change.name]))
        self._with_key(FAULTS)[0].handle.publish_raw(message)
        return message

    def describe_topics(
        self, joint_states: Publisher, diagnostics: Publisher
    ) -> list[tuple[str, Topic]]:
        """Describe the topics of the run for a bag, in the order of their handles."""
        own = {JOINT_STATES: joint_states, DIAGNOSTICS: diagnostics}
        described = []
        for topic in self._topics:
            endpoint = own.get(topic.key) or self._endpoints.get(topic)
            name, qos = f'{self._node.get_fully_qualified_name()}{topic.name[1:]}', topic.qos
            if endpoint is not None:
                name, qos = endpoint.topic_name, recorded_qos(endpoint.qos_profile)
            if topic.key == CRANK and (publishers := self.crank_publishers):
                qos = recorded_qos(publishers[0].qos_profile)
            message = message_type(topic.type, topic.asked_by)
            described.append((topic.key, describe_topic(name, message, qos)))
        return described


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
