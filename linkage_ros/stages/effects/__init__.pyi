# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

# Read first: EFFECTS, effect_class, Effect, MechanismEffect, SensorEffect, MessageEffect,
# ForceEffect, SensorReading, SensorStage, WriterStage, MechanismState, VelocityEffect,
# NoiseEffect, DelayEffect.

from linkage_ros.stages.effects.angle_unwrap import (
    Continuous as Continuous,
    first_values as first_values,
    wrap_all as wrap_all,
)
from linkage_ros.stages.effects.backlash import (
    BacklashEffect as BacklashEffect,
)
from linkage_ros.stages.effects.bias import (
    BiasEffect as BiasEffect,
    EccentricDisc as EccentricDisc,
)
from linkage_ros.stages.effects.deflections import (
    ClearanceEffect as ClearanceEffect,
    ComplianceEffect as ComplianceEffect,
)
from linkage_ros.stages.effects.delay import (
    Delay as Delay,
    DelayEffect as DelayEffect,
    JointDelay as JointDelay,
)
from linkage_ros.stages.effects.derivatives import (
    AccelerationEffect as AccelerationEffect,
    VelocityEffect as VelocityEffect,
)
from linkage_ros.stages.effects.dropout import (
    DropoutEffect as DropoutEffect,
    JointDropout as JointDropout,
)
from linkage_ros.stages.effects.effect import (
    BASES as BASES,
    DriveEffect as DriveEffect,
    Effect as Effect,
    EFFECTS as EFFECTS,
    ForceEffect as ForceEffect,
    LinkageEffect as LinkageEffect,
    MechanismEffect as MechanismEffect,
    MessageEffect as MessageEffect,
    SensorEffect as SensorEffect,
)
from linkage_ros.stages.effects.encoder import (
    EncoderEffect as EncoderEffect,
    JointEncoder as JointEncoder,
)
from linkage_ros.stages.effects.friction import (
    FrictionEffect as FrictionEffect,
)
from linkage_ros.stages.effects.history import (
    History as History,
)
from linkage_ros.stages.effects.jitter import (
    JitterEffect as JitterEffect,
)
from linkage_ros.stages.effects.markers import (
    MarkersEffect as MarkersEffect,
)
from linkage_ros.stages.effects.measuring_range import (
    JointRange as JointRange,
    MeasuringRangeEffect as MeasuringRangeEffect,
)
from linkage_ros.stages.effects.noise import (
    JointNoise as JointNoise,
    NoiseEffect as NoiseEffect,
)
from linkage_ros.stages.effects.rate_limit import (
    JointRateLimit as JointRateLimit,
    RateLimitEffect as RateLimitEffect,
)
from linkage_ros.stages.effects.registry import (
    effect_class as effect_class,
    effects_requiring as effects_requiring,
    force_effects as force_effects,
    in_order as in_order,
    needed_effects as needed_effects,
)
from linkage_ros.stages.effects.stage import (
    MechanismState as MechanismState,
    restamp as restamp,
    Sensor as Sensor,
    SensorReading as SensorReading,
    SensorStage as SensorStage,
    WriterStage as WriterStage,
)
from linkage_ros.stages.effects.tolerance import (
    BEFORE as BEFORE,
    ToleranceEffect as ToleranceEffect,
)
from linkage_ros.stages.effects.user_effects import (
    effect_version as effect_version,
    found_in as found_in,
)
