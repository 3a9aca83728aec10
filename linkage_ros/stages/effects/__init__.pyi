# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

from linkage_ros.stages.effects.angle_unwrap import (
    Continuous as Continuous,
    first_values as first_values,
    wrap_all as wrap_all,
    wrap_angle as wrap_angle,
)
from linkage_ros.stages.effects.backlash import BacklashParameters as BacklashParameters
from linkage_ros.stages.effects.bias import (
    BiasParameters as BiasParameters,
    EccentricDisc as EccentricDisc,
)
from linkage_ros.stages.effects.clearance import ClearanceParameters as ClearanceParameters
from linkage_ros.stages.effects.compliance import ComplianceParameters as ComplianceParameters
from linkage_ros.stages.effects.delay import (
    Delay as Delay,
    DelayParameters as DelayParameters,
    JointDelay as JointDelay,
)
from linkage_ros.stages.effects.dispatch import (
    Effect as Effect,
    effect_of as effect_of,
    effects_requiring as effects_requiring,
    in_order as in_order,
    module_of as module_of,
    needed_effects as needed_effects,
)
from linkage_ros.stages.effects.dropout import (
    DropoutParameters as DropoutParameters,
    JointDropout as JointDropout,
)
from linkage_ros.stages.effects.encoder import (
    EncoderParameters as EncoderParameters,
    JointEncoder as JointEncoder,
)
from linkage_ros.stages.effects.friction import FrictionParameters as FrictionParameters
from linkage_ros.stages.effects.history import History as History
from linkage_ros.stages.effects.jitter import JitterParameters as JitterParameters
from linkage_ros.stages.effects.markers import MESSAGE as MESSAGE
from linkage_ros.stages.effects.measuring_range import (
    JointRange as JointRange,
    MeasuringRangeParameters as MeasuringRangeParameters,
)
from linkage_ros.stages.effects.noise import (
    JointNoise as JointNoise,
    NoiseParameters as NoiseParameters,
)
from linkage_ros.stages.effects.rate_limit import (
    JointRateLimit as JointRateLimit,
    RateLimitParameters as RateLimitParameters,
)
from linkage_ros.stages.effects.stage import (
    EFFECTS as EFFECTS,
    FORCE_EFFECTS as FORCE_EFFECTS,
    MechanismState as MechanismState,
    NEEDS as NEEDS,
    PUBLISHED_WITH as PUBLISHED_WITH,
    restamp as restamp,
    Sensor as Sensor,
    SensorReading as SensorReading,
    SensorStage as SensorStage,
    WriterStage as WriterStage,
)
from linkage_ros.stages.effects.tolerance import (
    alter as alter,
    ToleranceParameters as ToleranceParameters,
)
from linkage_ros.stages.effects.user_effects import (
    effect_version as effect_version,
    found_in as found_in,
    FUNCTIONS as FUNCTIONS,
)
from linkage_ros.stages.effects.velocity import VelocityParameters as VelocityParameters
