"""One error-state filter: inertial navigation whose errors a Kalman filter estimates.

Stationary alignment, systematic calibration and aided navigation are configurations of it: a
`Layout` of error states, their `ProcessNoise`, and the measurements.

Errors: phi is that of attitude, C_est = (I - [phi x]) C_true; velocity, position and what belongs
to aids are estimate minus truth; what belongs to the sensors is truth minus estimate, what is left
of it.
"""

from schuler.ins.custom import CustomMeasurement, State
from schuler.ins.dynamics import (
    SOURCES,
    GroupNoise,
    ProcessNoise,
    instability_walk,
    instrument_noise,
    instrument_prior,
)
from schuler.ins.epoch_states import EpochStates, SampleStates
from schuler.ins.filter import ErrorStateFilter
from schuler.ins.filter_state import FilterState
from schuler.ins.layout import Layout
from schuler.ins.measurement import Handling, Measurement
from schuler.ins.measurements import (
    Attitude,
    BodyVelocity,
    ConstantBase,
    Heading,
    Height,
    NonHolonomic,
    OutputEpoch,
    Position,
    Rate,
    Velocity,
    ZeroDisplacement,
    ZeroForce,
    ZeroRate,
    ZeroVelocity,
)
from schuler.ins.result import EpochHistory
from schuler.ins.smoother import Epochs, Smoothed, smooth
from schuler.ins.state_group import StateGroup, groups_of

__all__ = [
    "SOURCES",
    "Attitude",
    "BodyVelocity",
    "ConstantBase",
    "CustomMeasurement",
    "EpochHistory",
    "EpochStates",
    "Epochs",
    "ErrorStateFilter",
    "FilterState",
    "GroupNoise",
    "Handling",
    "Heading",
    "Height",
    "Layout",
    "Measurement",
    "NonHolonomic",
    "OutputEpoch",
    "Position",
    "ProcessNoise",
    "Rate",
    "SampleStates",
    "Smoothed",
    "State",
    "StateGroup",
    "Velocity",
    "ZeroDisplacement",
    "ZeroForce",
    "ZeroRate",
    "ZeroVelocity",
    "groups_of",
    "instability_walk",
    "instrument_noise",
    "instrument_prior",
    "smooth",
]
