"""`RotationCase`: an instrument on a table, at rest, with the schemes that are compared."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler._files import check_keys, number, read_toml
from schuler.constants import DEG
from schuler.earth import Site
from schuler.errors import InputError, located
from schuler.modulation.propagation import TriadErrors
from schuler.motion.named_schemes import load_scheme, named_scheme
from schuler.motion.rotation import Limits, Scheme
from schuler.sensors import SensorArray, load_array
from schuler.units import parse

__all__ = ["RotationCase"]

Array = NDArray[np.float64]


_KEYS = ("name", "about", "duration", "array", "site", "heading", "headings", "latitudes",
         "errors", "single_axis", "two_axis")  # fmt: skip
_ERRORS = {
    "gyro_bias": "angular rate", "gyro_scale": "ratio",
    "accel_bias": "acceleration", "accel_scale": "ratio",
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class RotationCase:
    """An instrument on a table, at rest: what is compared.

    Parameters
    ----------
    name : str
    array : SensorArray
    gyro_bias, gyro_scale : (n,) float64
        Of each gyro of the array: rad/s, ratio.
    accel_bias, accel_scale : (3,) float64
        m/s^2, ratio.
    duration : float
        s.
    site : Site
    heading : float
        Of the carrier, deg.
    latitudes, headings : (p,), (q,) float64
        deg; headings clockwise from north.
    single, double : Scheme

    Examples
    --------
    >>> case = RotationCase.from_toml("rotation.toml")
    >>> case.single.name, case.duration
    ('four-position', 3600.0)
    """

    name: str
    array: SensorArray
    gyro_bias: Array
    gyro_scale: Array
    accel_bias: Array
    accel_scale: Array
    duration: float
    site: Site
    heading: float
    latitudes: Array
    headings: Array
    single: Scheme
    double: Scheme

    @property
    def errors(self) -> TriadErrors:
        """The fused triad's errors."""
        k = self.array.estimator()
        return TriadErrors(
            k @ self.gyro_bias, self.accel_bias,
            (k * self.gyro_scale) @ self.array.h, np.diag(self.accel_scale),
        )  # fmt: skip

    @classmethod
    def from_toml(cls, path: str | Path) -> RotationCase:
        """Read a case; see the documentation's page on rotation.

        Raises
        ------
        InputError
            If the file cannot be read, is not TOML, or holds a bad value.
        """
        path = Path(path)
        data = read_toml(path)
        with located(path):
            return cls.from_dict(data, path.stem, path.parent)

    @classmethod
    def from_dict(
        cls, data: dict[str, Any], name: str = "rotation", folder: Path = Path()
    ) -> RotationCase:
        """Make a case of plain values.

        Raises
        ------
        InputError
            For an unknown key or a bad value.
        """
        check_keys(data, _KEYS)
        site = data.get("site", {})
        check_keys(site, ("lat", "lon", "height"), prefix="site.")
        where = Site(*(number(site.get(k, 0.0), f"site.{k}") for k in ("lat", "lon", "height")))
        array = load_array(_beside(str(data.get("array", "triad")), folder))
        errors = data.get("errors")
        if not isinstance(errors, dict):
            raise InputError("the table [errors] is missing")
        check_keys(errors, _ERRORS, prefix="errors.")
        counts = {"gyro_bias": len(array), "gyro_scale": len(array)}
        values = {
            key: _quantities(errors.get(key), kind, counts.get(key, 3), f"errors.{key}")
            for key, kind in _ERRORS.items()
        }
        duration = parse(data.get("duration", "8 h"), "time", "duration")
        if not 60.0 <= duration <= 30 * 86400.0:
            raise InputError(f"duration must be 1 min to 30 d, got {duration:g} s")
        headings = _numbers(data.get("headings", list(range(0, 360, 15))), "headings")
        latitudes = _numbers(data.get("latitudes", list(range(0, 71, 10))), "latitudes")
        if np.any(np.abs(latitudes) > 89.0):
            raise InputError("latitudes must be within 89 deg of the equator")
        return cls(
            str(data.get("name", name)), array, values["gyro_bias"], values["gyro_scale"],
            values["accel_bias"], values["accel_scale"], duration, where,
            number(data.get("heading", 0.0), "heading"), latitudes, headings,
            _scheme(data.get("single_axis", {"scheme": "reciprocating", "rate": "2 deg/s"}),
                    "single_axis", folder),
            _scheme(data.get("two_axis", {"scheme": "two-axis-16"}), "two_axis", folder),
        )  # fmt: skip


def _beside(text: str, folder: Path) -> str:
    return str(folder / text) if text.endswith(".toml") else text


def _numbers(value: Any, what: str) -> Array:
    if not isinstance(value, list) or not value:
        raise InputError(f"{what}: expected a list of numbers, got {value!r}")
    return np.array([number(v, what) for v in value])


def _quantities(value: Any, kind: str, count: int, what: str) -> Array:
    if value is None:
        return np.zeros(count)
    values = value if isinstance(value, list) else [value] * count
    if len(values) != count:
        raise InputError(f"{what}: expected {count} values, one for each sensor, got {len(values)}")
    return np.array([parse(v, kind, what) for v in values])


def _scheme(table: Any, what: str, folder: Path) -> Scheme:
    if isinstance(table, str):
        return load_scheme(_beside(table, folder))
    check_keys(
        table,
        ("scheme", "rate", "acceleration", "dwell", "travel", "encoder", "first_turn", "start"),
        prefix=f"{what}.",
    )
    name = _beside(str(table.get("scheme", "")), folder)
    if name.endswith(".toml"):
        if len(table) > 1:
            raise InputError(f"{what}: a scheme's file says all itself; leave the other keys out")
        return load_scheme(name)
    limits = Limits(
        parse(table.get("rate", "10 deg/s"), "angular rate", f"{what}.rate") / DEG,
        number(table.get("acceleration", 20.0), f"{what}.acceleration"),
        None if "travel" not in table else number(table["travel"], f"{what}.travel"),
        number(table.get("encoder", 0.0), f"{what}.encoder"),
    )
    dwell = parse(table["dwell"], "time", f"{what}.dwell") if "dwell" in table else None
    first = table.get("first_turn", "counter-clockwise")
    if first not in ("counter-clockwise", "clockwise"):
        raise InputError(
            f"{what}.first_turn: expected clockwise or counter-clockwise, got {first!r}"
        )
    if "start" in table:
        if name != "reciprocating" or table["start"] not in ("middle", "end"):
            raise InputError(
                f"{what}.start: expected middle or end, of the scheme reciprocating, got "
                f"{table['start']!r} of '{name}'"
            )
        name += "-from-end" if table["start"] == "end" else ""
    return named_scheme(name, dwell=dwell, limits=limits, clockwise=first == "clockwise")
