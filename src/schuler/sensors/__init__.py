"""What an instrument is: its errors by type, named grades, and arrays of more than three axes."""

from __future__ import annotations

from schuler.sensors.array import ARRAYS, AxesFit, SensorArray, fit_axes, load_array, named_array
from schuler.sensors.assumed import CONSUMER_MEMS
from schuler.sensors.design import Mounting, design_array
from schuler.sensors.draw import Imperfections, draw
from schuler.sensors.errors import GRADES, AccelerometerSpec, GyroSpec, ImuSpec, load_spec
from schuler.sensors.fault_scan import FaultEvent, FaultScan, scan_faults
from schuler.sensors.faults import (
    Blame,
    Fault,
    FaultMonitor,
    ParityTest,
    Verdict,
    blame_by_rate,
    isolable,
    parity_matrix,
)
from schuler.sensors.figures import ArrayFigures
from schuler.sensors.reliability import Lifetime, Reliability

__all__ = [
    "ARRAYS",
    "CONSUMER_MEMS",
    "GRADES",
    "AccelerometerSpec",
    "ArrayFigures",
    "AxesFit",
    "Blame",
    "Fault",
    "FaultEvent",
    "FaultMonitor",
    "FaultScan",
    "GyroSpec",
    "Imperfections",
    "ImuSpec",
    "Lifetime",
    "Mounting",
    "ParityTest",
    "Reliability",
    "SensorArray",
    "Verdict",
    "blame_by_rate",
    "design_array",
    "draw",
    "fit_axes",
    "isolable",
    "load_array",
    "load_spec",
    "named_array",
    "parity_matrix",
    "scan_faults",
]
