"""Saving the truth of a simulated record, beside it, for people and programs to compare with."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from schuler._files import replacing
from schuler.attitude import psi_to_heading, quat_to_euler
from schuler.constants import DEG
from schuler.errors import InputError
from schuler.io.sealed import write_sealed
from schuler.simulation import Truth

__all__ = ["truth_path", "write_truth"]

_COLUMNS = (
    "t [s]", "heading [deg]", "pitch [deg]", "roll [deg]", "qw", "qx", "qy", "qz",
    "v_east [m/s]", "v_north [m/s]", "v_up [m/s]", "lat [deg]", "lon [deg]", "height [m]",
)  # fmt: skip


def truth_path(record: str | Path) -> Path:
    """Return where the truth of a record goes: ``truck.truth.parquet`` beside ``truck.csv``."""
    record = Path(record)
    return record.with_name(f"{record.stem}.truth.parquet")


def write_truth(truth: Truth, path: str | Path, about: Mapping[str, Any] | None = None) -> None:
    """Save a truth as Parquet, whole or not at all: a row at the start and at each sample.

    Parameters
    ----------
    truth : Truth
    path : str or Path
        With the suffix .parquet.
    about : mapping, optional
        What else is worth keeping (scenario, seed, the errors that were put in), as JSON in the
        file's metadata under ``schuler``.

    Raises
    ------
    InputError
        For another suffix, or if the file cannot be written.
    """
    import pyarrow as pa

    path = Path(path)
    if path.suffix.lower() != ".parquet":
        raise InputError(f"{path}: the truth is written as Parquet; name a file in .parquet")
    quaternion = truth.quaternion
    psi, theta, gamma = quat_to_euler(quaternion).T
    columns = [
        truth.time, psi_to_heading(psi) / DEG, theta / DEG, gamma / DEG, *quaternion.T,
        *truth.velocity.T, truth.position[:, 0] / DEG, truth.position[:, 1] / DEG,
        truth.position[:, 2],
    ]  # fmt: skip
    table = pa.table(
        [pa.array(np.ascontiguousarray(column)) for column in columns], names=list(_COLUMNS)
    )
    text = json.dumps(about or {}, allow_nan=False)
    with replacing(path) as part:
        write_sealed(
            table, part, {"schuler": text},
            compression="zstd", use_dictionary=False, row_group_size=1 << 18,
        )  # fmt: skip
