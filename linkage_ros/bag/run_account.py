# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Where a bag keeps the account of its run, and the keys of the account."""

RUN_FILE = 'run.json'
"""Name of the attachment with the run's scene, topics and versions."""

BEGUN, MID_RUN, WITH_THE_RUN = 'begun', 'mid-run', 'with the run'
"""Key for the beginning of the bag, and its values."""

USER_EFFECTS = 'effects'
"""Key for the modules of user-defined effects."""

SEED = 'seed'
"""Key for the seed of all random numbers."""

WRENCH_TOPICS = 'wrench_topics'
"""Key for the topics with wrenches, if the scene has any."""

VERSIONS = ('linkage_ros', 'python', 'machine')
"""Keys for what the run was made with."""
