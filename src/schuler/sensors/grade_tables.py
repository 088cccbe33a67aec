"""Figures of named grades of instruments, 1-sigma, and where they are from."""

from __future__ import annotations

from typing import Any

__all__ = ["GRADE_TABLES"]

GRADE_TABLES: dict[str, dict[str, Any]] = {
    "navigation-rlg": {
        "source": "Honeywell HG9900 product sheet (0.003 deg/h, 0.002 deg/sqrt(h), 25 ug)",
        "gyro": {"bias": "0.003 deg/h", "angle_random_walk": "0.002 deg/sqrt(h)"},
        "accelerometer": {"bias": "25 ug", "velocity_random_walk": "20 ug/sqrt(Hz)"},
    },
    "navigation-fog": {
        "source": "typical 1 nmi/h fibre-optic unit; Groves (2013), tables 4.1-4.3, aviation grade",
        "gyro": {"bias": "0.01 deg/h", "angle_random_walk": "0.003 deg/sqrt(h)"},
        "accelerometer": {"bias": "50 ug", "velocity_random_walk": "20 ug/sqrt(Hz)"},
    },
    "tactical-fog": {
        "source": "Northrop Grumman LN-200 product sheet (1 deg/h, 0.07 deg/sqrt(h), 300 ug)",
        "gyro": {"bias": "1 deg/h", "angle_random_walk": "0.07 deg/sqrt(h)"},
        "accelerometer": {"bias": "300 ug", "velocity_random_walk": "50 ug/sqrt(Hz)"},
    },
    "industrial-mems": {
        "source": "Analog Devices ADIS16488A data sheet, typical values",
        "gyro": {
            "bias": "720 deg/h",
            "angle_random_walk": "0.26 deg/sqrt(h)",
            "bias_instability": "5.1 deg/h",
        },
        "accelerometer": {
            "bias": "16 mg",
            "velocity_random_walk": "0.029 m/s/sqrt(h)",
            "bias_instability": "70 ug",
        },
    },
}
