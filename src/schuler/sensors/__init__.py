"""What an instrument is: its errors by type, named grades, and arrays of more than three axes."""

from __future__ import annotations

from schuler.sensors.array import SensorArray
from schuler.sensors.assumed import CONSUMER_MEMS
from schuler.sensors.axes_fit import AxesFit, fit_axes
from schuler.sensors.design import Mounting, design_array
from schuler.sensors.draw import Imperfections, draw
from schuler.sensors.errors import GRADES, AccelerometerSpec, GyroSpec, ImuSpec, load_spec
from schuler.sensors.fault_monitor import FaultMonitor, Verdict
from schuler.sensors.fault_scan import FaultEvent, FaultScan, scan_faults
from schuler.sensors.faults import Fault, Isolation, isolate_by_rate
from schuler.sensors.figures import ArrayFigures
from schuler.sensors.named_arrays import ARRAYS, load_array, named_array
from schuler.sensors.parity import ParityTest, isolable, parity_matrix
from schuler.sensors.reliability import Lifetime, Reliability

__all__ = [
    "ARRAYS",
    "CONSUMER_MEMS",
    "GRADES",
    "AccelerometerSpec",
    "ArrayFigures",
    "AxesFit",
    "Fault",
    "FaultEvent",
    "FaultMonitor",
    "FaultScan",
    "GyroSpec",
    "Imperfections",
    "ImuSpec",
    "Isolation",
    "Lifetime",
    "Mounting",
    "ParityTest",
    "Reliability",
    "SensorArray",
    "Verdict",
    "design_array",
    "draw",
    "fit_axes",
    "isolable",
    "isolate_by_rate",
    "load_array",
    "load_spec",
    "named_array",
    "parity_matrix",
    "scan_faults",
]
