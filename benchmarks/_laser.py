"""Where the real laser-gyro record is, for the benchmarks that need it."""

from __future__ import annotations

import os
from pathlib import Path

HERE = Path(__file__).resolve().parent
FOLDER = Path(os.environ.get("SCHULER_DATA") or HERE.parents[1] / "shared" / "data")
RECORD = FOLDER / "psins_lasergyro_vehicle" / "lasergyro.imu"
PLACE = (34.246048, 108.909664, 380.0)


def skipped(name: str) -> bool:
    """Say by name that a benchmark is left out where the record is absent."""
    if RECORD.is_file():
        return False
    print(f"{name}: skipped, there is no {RECORD.name} (set SCHULER_DATA to the records' folder)")
    return True
