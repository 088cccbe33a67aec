"""A calibration as a value and a file, and its application to a record: output -> SI."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from schuler._files import check_keys, read_toml, replacing
from schuler.errors import InputError, located

if TYPE_CHECKING:
    from schuler.record import ImuRecord

__all__ = ["Calibration"]

Array = NDArray[np.float64]


def _zeros() -> Array:
    return np.zeros(3)


@dataclass(frozen=True, eq=False)
class Calibration:
    """Biases and matrices of the triads: true = matrix (output - bias).

    Parameters
    ----------
    gyro_bias, accel_bias : (3,) float64
        In the output's units: rad/s and m/s^2, or counts.
    gyro_matrix, accel_matrix : (3, 3) float64
        Scale and axes: SI an output unit.
    input : {"SI", "counts"}
        What outputs it is for; a record that schuler has read is in SI.
    name : str
    sigma : dict of str to (…,) float64
        1 sigma of `gyro_bias`, `accel_matrix`, ... where known.

    Examples
    --------
    >>> corrected = Calibration(accel_bias=[0.01, 0.0, 0.0]).apply(record)
    >>> round(float((record.dvel - corrected.dvel)[0, 0] / record.dt[0]), 4)
    0.01
    """

    gyro_bias: Array = field(default_factory=_zeros)
    accel_bias: Array = field(default_factory=_zeros)
    gyro_matrix: Array = field(default_factory=lambda: np.eye(3))
    accel_matrix: Array = field(default_factory=lambda: np.eye(3))
    input: str = "SI"
    name: str = "calibration"
    sigma: dict[str, Array] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.input not in ("SI", "counts"):
            raise InputError(f"calibration: input must be SI or counts, got '{self.input}'")
        for key in _SHAPES:
            value = np.asarray(getattr(self, key), dtype=np.float64)
            if value.shape != _SHAPES[key] or not np.isfinite(value).all():
                size = " x ".join(map(str, _SHAPES[key]))
                raise InputError(f"calibration: {key} must be {size} finite numbers")
            object.__setattr__(self, key, value)
        for key in ("gyro_matrix", "accel_matrix"):
            matrix = getattr(self, key)
            scale = np.prod(np.linalg.norm(matrix, axis=1))
            if not abs(np.linalg.det(matrix)) > 1e-3 * scale:
                raise InputError(f"calibration: {key} has no inverse: its rows lie in one plane")

    def apply(self, record: ImuRecord) -> ImuRecord:
        """Return the record as a perfect instrument would have given it.

        Raises
        ------
        InputError
            For a calibration of counts, or a record without three gyros and accelerometers.
        """
        if self.input != "SI":
            raise InputError(
                f"the calibration '{self.name}' is for raw counts, and a record is in SI: "
                "calibrate the record as schuler reads it"
            )
        if record.dtheta.shape[1] != 3 or record.dvel.shape[1] != 3:
            raise InputError("a calibration is for three gyros and three accelerometers")
        span = record.dt[:, None]
        return replace(
            record,
            dtheta=(record.dtheta - span * self.gyro_bias) @ self.gyro_matrix.T,
            dvel=(record.dvel - span * self.accel_bias) @ self.accel_matrix.T,
        )

    def each(self, chunks: Iterable[ImuRecord]) -> Iterator[ImuRecord]:
        """Apply to chunks as they come."""
        for chunk in chunks:
            yield self.apply(chunk)

    def to_toml(self, path: str | Path) -> None:
        """Write the file, whole or not at all.

        Raises
        ------
        InputError
            If it cannot be written.

        Examples
        --------
        >>> Calibration(accel_bias=[0.01, 0.0, 0.0]).to_toml("unit.toml")
        >>> round(float(Calibration.from_toml("unit.toml").accel_bias[0]), 3)
        0.01
        """
        import tomli_w

        data: dict[str, Any] = {"schema": "schuler.calibration/1", "name": self.name,
                                "input": self.input}  # fmt: skip
        for part in ("gyro", "accel"):
            table: dict[str, Any] = {}
            for item in ("bias", "matrix"):
                table[item] = getattr(self, f"{part}_{item}").tolist()
                if f"{part}_{item}" in self.sigma:
                    table[f"{item}_sigma"] = self.sigma[f"{part}_{item}"].tolist()
            data[part] = table
        with replacing(path) as temporary:
            temporary.write_text(tomli_w.dumps(data), encoding="utf-8", errors="replace")

    @classmethod
    def from_toml(cls, path: str | Path) -> Calibration:
        """Read a file that `to_toml` wrote, or one like it.

        Raises
        ------
        InputError
            If it cannot be read, is not TOML, or does not hold a calibration.
        """
        path = Path(path)
        data = read_toml(path)
        if data.get("schema") != "schuler.calibration/1":
            raise InputError(
                f'{path}: is not a calibration: expected schema = "schuler.calibration/1"'
            )
        values: dict[str, Any] = {}
        sigma = {}
        for part in ("gyro", "accel"):
            table = data.get(part, {})
            known = ("bias", "matrix", "bias_sigma", "matrix_sigma")
            check_keys(table, known, f"{path}: [{part}]")
            for key, value in table.items():
                try:
                    array = np.asarray(value, dtype=np.float64)
                except (TypeError, ValueError):
                    raise InputError(f"{path}: {part}.{key} must be numbers") from None
                if key.endswith("_sigma"):
                    sigma[f"{part}_{key[:-6]}"] = array
                else:
                    values[f"{part}_{key}"] = array
        with located(path):
            return cls(
                **values, input=str(data.get("input", "SI")),
                name=str(data.get("name", path.stem)), sigma=sigma,
            )  # fmt: skip


_SHAPES: dict[str, tuple[int, ...]] = {
    "gyro_bias": (3,), "accel_bias": (3,), "gyro_matrix": (3, 3), "accel_matrix": (3, 3)
}  # fmt: skip
