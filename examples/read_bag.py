# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Read the joint states of a bag that the node has recorded: ``read_bag.py BAG``."""

import sys

import linkage_ros as lr

bag = lr.read_bag(sys.argv[1])
for topic in bag.topics:
    print(topic.name, topic.type)
scene = lr.recorded_scene(bag)
reader = lr.JointStateReader(scene.joint_names)
print('stamp [ns]', *scene.joint_names)
for message in bag.messages():
    if message.topic == '/joint_states':
        state = reader.read(message.data)
        if not isinstance(state, lr.Rejection):
            print(state.stamp, *(f'{value:.6f}' for value in state.angles))
