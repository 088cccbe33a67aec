"""One chunk of runs: a pure function from scenario and run numbers to rows of numbers."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from schuler._blas import with_one_blas_thread
from schuler._version import __version__
from schuler.errors import InputError, SchulerError

if TYPE_CHECKING:
    from schuler.alignment import Alignment
    from schuler.simulation import Simulation

__all__ = ["AXES", "NUMBERS", "Chunk", "run_chunk"]

AXES = ("east", "north", "up")

#: columns of 64-bit numbers: rad, rad^2; the budget's variances are those of phi up
NUMBERS = (
    *(f"phi_{axis}" for axis in AXES),
    *(f"sigma_{axis}" for axis in AXES),
    *(f"limit_{axis}" for axis in AXES),
    "heading_error", "nees",
    "variance_gyro", "variance_accelerometer", "variance_disturbance", "variance_other",
)  # fmt: skip


@dataclass(frozen=True)
class Chunk:
    """A stretch of runs.

    Parameters
    ----------
    number : int
        Of the chunk in its campaign.
    point : int
        Place in the sweep.
    scenario : str
        `Scenario.to_json`.
    methods : tuple of str
    first, count : int
        Runs.
    version : str
        Of the schuler that made it.
    """

    number: int
    point: int
    scenario: str
    methods: tuple[str, ...]
    first: int
    count: int
    version: str


@with_one_blas_thread
def run_chunk(chunk: Chunk) -> bytes:
    """Simulate and align the runs of a chunk; return an Arrow table as bytes (IPC stream).

    Raises
    ------
    InputError
        If a run cannot be aligned, with its number.
    SchulerError
        If another version of schuler sent the chunk: its results could differ.
    """
    import pyarrow as pa

    from schuler.alignment import align
    from schuler.config import parse_scenario

    if chunk.version != __version__:
        raise SchulerError(
            f"this worker has schuler {__version__} and the campaign {chunk.version}: "
            "install the same version everywhere"
        )
    scenario = parse_scenario(json.loads(chunk.scenario))
    rows: list[dict[str, Any]] = []
    for run in range(chunk.first, chunk.first + chunk.count):
        made = scenario.run(scenario.sequence(run))
        for method in chunk.methods:
            try:
                fix = align(made.record, scenario.site, method, scenario.align_spec, at=scenario.at)
            except InputError as error:
                raise InputError(
                    f"{scenario.name}: run {run} with the method {method} cannot be aligned: "
                    f"{error}"
                ) from None
            rows.append({"point": chunk.point, "run": run, "method": method, **_row(fix, made)})
    table = pa.Table.from_pylist(rows, schema=schema())
    sink = pa.BufferOutputStream()
    with pa.ipc.new_stream(sink, table.schema) as writer:
        writer.write_table(table)
    return bytes(sink.getvalue().to_pybytes())


def schema() -> Any:
    """Return the columns of a chunk."""
    import pyarrow as pa

    return pa.schema(
        [
            ("point", pa.int32()), ("run", pa.int64()), ("method", pa.string()),
            *((name, pa.float64()) for name in NUMBERS), ("warnings", pa.int32()),
        ]
    )  # fmt: skip


def _row(fix: Alignment, made: Simulation) -> dict[str, Any]:
    """Return the errors of an alignment against the truth, beside what it says of them."""
    import numpy as np

    from schuler.attitude import euler_to_quat, multiply, psi_to_heading, quat_to_rotvec
    from schuler.constants import DEG

    euler = made.euler_at(round((fix.time - made.start) / made.step))
    back = euler_to_quat(euler) * [1.0, -1.0, -1.0, -1.0]
    # C_est = (I - [phi x]) C_true turns by -phi.
    phi = -quat_to_rotvec(multiply(fix.quat_nb, back))
    off = fix.heading_deg * DEG - float(psi_to_heading(euler[0]))
    sigma = np.sqrt(np.diag(fix.covariance))
    limit = np.full(3, np.nan) if fix.bound is None else np.sqrt(np.diag(fix.bound))
    shares = dict.fromkeys(("gyro", "accelerometer", "disturbance", "other"), 0.0)
    for name, covariance in fix.budget.items():
        kind = name.partition("_")[0]
        shares[kind if kind in shares else "other"] += float(covariance[2, 2])
    values = [
        *phi, *sigma, *limit,
        (off + np.pi) % (2.0 * np.pi) - np.pi,
        phi @ np.linalg.pinv(fix.covariance, hermitian=True) @ phi,
        *shares.values(),
    ]  # fmt: skip
    return {
        **{name: float(v) for name, v in zip(NUMBERS, values, strict=True)},
        "warnings": len(fix.warnings),
    }
