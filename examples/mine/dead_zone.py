# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Dead zone: a sensor shows a new value only after the joint has moved far enough."""

from dataclasses import dataclass

from linkage_ros.description import number
from linkage_ros.stages.effects import SensorEffect


@dataclass(frozen=True, slots=True)
class DeadZone(SensorEffect):
    """A sensor shows a new value only after the joint has moved far enough."""

    after = 'noise'

    width: float = number('least change shown', unit='rad or m', above=0.0, most=1e6)

    def sensor(self, context):
        """Build the sensor; it remembers the values shown last."""
        shown = []

        def dead_zone(now, reading):
            values = zip(shown or reading.joints, reading.joints)
            shown[:] = [new if abs(new - old) >= self.width else old for old, new in values]
            return reading._replace(joints=tuple(shown))

        return dead_zone
