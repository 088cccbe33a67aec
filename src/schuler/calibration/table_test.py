"""Tests on a turntable from records: dwells and turns found or given, one calibration out.

Positions are dwells in a record, or records of one dwell each. Where the table put the instrument
is either given in a sequence, or told from the force: the nearest of the known directions of 6, 12,
18 or 24 positions. What is not observable in a test is taken from an earlier calibration (`base`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler._files import check_keys, number, read_toml
from schuler._result import Result
from schuler.attitude import euler_to_quat, quat_to_matrix
from schuler.calibration.apply import Calibration
from schuler.calibration.poses import find_rests
from schuler.calibration.turntable import rate_test, scheme, static_test
from schuler.constants import DEG, DEG_PER_HOUR, EARTH_RATE, MICRO_G
from schuler.earth import Site
from schuler.errors import InputError
from schuler.record import ImuRecord
from schuler.units import parse

if TYPE_CHECKING:
    pass

__all__ = [
    "Position", "RateTurn", "TableTest", "calibrate_positions", "calibrate_rates",
    "positions_from_toml", "turns_from_toml",
]  # fmt: skip

Array = NDArray[np.float64]

_AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
_TOO_FAR = 15.0 * DEG
_BLOCK = 0.5
_SHORTEST = 2.0


@dataclass(frozen=True)
class Position:
    """Where the table puts the instrument.

    Parameters
    ----------
    attitude : (3,) tuple of float
        psi, theta, gamma, deg: its C_b^n.
    start, stop : float, optional
        The dwell in the record's time, s; found in order where left out.
    """

    attitude: tuple[float, float, float]
    start: float | None = None
    stop: float | None = None

    @property
    def mat_nb(self) -> Array:
        """C_b^n (3, 3)."""
        return np.asarray(quat_to_matrix(euler_to_quat(np.array(self.attitude) * DEG)))


@dataclass(frozen=True)
class RateTurn:
    """A turn of the table at a constant rate.

    Parameters
    ----------
    axis : (3,) tuple of float
        The table's axis in body axes.
    rate : float
        rad/s, counter-clockwise about the axis.
    direction : (3,) tuple of float
        Where the axis points: east, north, up. The Earth's rate along it is taken off.
    start, stop : float, optional
        In the record's time, s; found in order where left out.
    """

    axis: tuple[float, float, float]
    rate: float
    direction: tuple[float, float, float] = (0.0, 0.0, 1.0)
    start: float | None = None
    stop: float | None = None


@dataclass(frozen=True, eq=False)
class TableTest(Result):
    """What a test on a turntable has found.

    Parameters
    ----------
    kind : {"positions", "rates"}
    calibration : Calibration
    found : tuple of str
        Which of its parts are from this test.
    stretches : (m, 2) float64
        Begin and end of each dwell or turn, s (of its own record).
    truth, residual : (m, 3) float64
        What is true in each, and what the fit leaves of the outputs: m/s^2 or rad/s.
    residual_rms : float
    """

    kind: str
    calibration: Calibration
    found: tuple[str, ...]
    stretches: Array = field(repr=False)
    truth: Array = field(repr=False)
    residual: Array = field(repr=False)
    residual_rms: float

    def to_dict(self) -> dict[str, Any]:
        """Return the test as JSON takes it (docs/calibrate-table.schema.json)."""
        c = self.calibration
        return {
            "schema": "schuler.calibrate-table/1",
            "kind": self.kind,
            "found": list(self.found),
            "values": {
                key: {
                    "value": getattr(c, key).tolist(),
                    "sigma": c.sigma[key].tolist() if key in c.sigma else None,
                }
                for key in ("gyro_bias", "gyro_matrix", "accel_bias", "accel_matrix")
            },
            "residual_rms": self.residual_rms,
            "stretches": [
                {
                    "start_s": float(a),
                    "stop_s": float(b),
                    "true": t.tolist(),
                    "residual": r.tolist(),
                }
                for (a, b), t, r in zip(self.stretches, self.truth, self.residual, strict=True)
            ],
        }

    def columns(self) -> dict[str, Any]:
        """Return a row to each dwell or turn: times, what is true, what is left."""
        columns: dict[str, Any] = {"start_s": self.stretches[:, 0], "stop_s": self.stretches[:, 1]}
        for k, axis in enumerate("xyz"):
            columns |= {f"true_{axis}": self.truth[:, k], f"residual_{axis}": self.residual[:, k]}
        return columns

    def __str__(self) -> str:
        c, rates = self.calibration, self.kind == "rates"
        unit, factor = ("deg/h", DEG_PER_HOUR) if rates else ("ug", MICRO_G)
        what = "turns" if rates else "dwells"
        lines = [f"{len(self.stretches)} {what}; left {self.residual_rms / factor:.3g} {unit} rms"]
        for sensor, name, one, size in (
            ("accelerometer", "accel", "ug", MICRO_G), ("gyro", "gyro", "deg/h", DEG_PER_HOUR),
        ):  # fmt: skip
            bias, matrix = (f"{name}_{part}" for part in ("bias", "matrix"))
            for k, axis in enumerate("xyz"):
                text = f"{sensor} {axis}:"
                if bias in self.found:
                    text += f" bias {getattr(c, bias)[k] / size:.5g}"
                    if bias in c.sigma:
                        text += f" ± {c.sigma[bias][k] / size:.2g}"
                    text += f" {one}"
                if matrix in self.found:
                    row = getattr(c, matrix)[k] - np.eye(3)[k]
                    text += "  matrix less one " + "  ".join(f"{1e6 * v:9.1f}" for v in row)
                    text += f" ± {1e6 * c.sigma[matrix][k].max():.2g} ppm"
                if text[-1] != ":":
                    lines.append(text)
        return "\n".join(lines)


def calibrate_positions(
    records: Sequence[ImuRecord], gravity: float, *, positions: int | Sequence[Position] = 6,
    site: Site | None = None, base: Calibration | None = None, initial: float = 1.0,
    name: str = "positions",
) -> TableTest:  # fmt: skip
    """Calibrate accelerometers, and with known attitudes the gyros' bias, from dwells.

    Parameters
    ----------
    records : sequence of ImuRecord
        One record with all dwells, or a record for each.
    gravity : float
        At the place, m/s^2.
    positions : int or sequence of Position
        6, 12, 18 or 24, whose directions are told from the force; or where the table was, in order.
    site : Site, optional
        With attitudes: its Earth rate shows the gyros' bias.
    base : Calibration, optional
        Has what is not observable in this test.
    initial : float
        Rest at the start of a record in which the dwells are found, s.
    name : str

    Raises
    ------
    InputError
        For dwells that are not as many as the positions, or leave an axis that is not observable.

    Examples
    --------
    >>> from dataclasses import replace
    >>> dt = record.dt[:, None]
    >>> up = sc.calibration.turntable.scheme(6)
    >>> dwells = [replace(record, dvel=(9.81 * x + [0.05, 0.0, 0.0]) * dt) for x in up]
    >>> fit = calibrate_positions(dwells, 9.81)
    >>> round(float(fit.calibration.accel_bias[0]), 3)
    0.05
    """
    given = None if isinstance(positions, int) else list(positions)
    count = positions if isinstance(positions, int) else len(positions)
    dwells = _dwells(records, given, count, initial)
    force = np.array([np.sum(r.dvel, axis=0) / np.sum(r.dt) for r in dwells])
    rate = np.array([np.sum(r.dtheta, axis=0) / np.sum(r.dt) for r in dwells])
    if given is None:
        up = _nearest(force, scheme(count))
    else:
        up = np.array([p.mat_nb[2] for p in given])
        angle = np.arccos(
            np.clip(np.sum(force * up, axis=1) / np.linalg.norm(force, axis=1), -1, 1)
        )
        if angle.max() > _TOO_FAR:
            k = int(angle.argmax())
            raise InputError(
                f"position {k + 1}: the force is {angle[k] / DEG:.0f} deg from where the sequence "
                "says that up is: look at its order, its angles and the axes of the record"
            )
    fit = static_test(force, gravity * up)
    parts: dict[str, Array] = {"accel_bias": fit.bias, "accel_matrix": fit.matrix}
    sigma = {"accel_bias": fit.bias_sigma, "accel_matrix": fit.matrix_sigma}
    base = base or Calibration()
    if given is not None and site is not None:
        earth_n = EARTH_RATE * np.array([0.0, np.cos(site.latitude), np.sin(site.latitude)])
        earth = np.array([p.mat_nb.T @ earth_n for p in given])
        left = rate - earth @ np.linalg.inv(base.gyro_matrix).T
        parts["gyro_bias"] = left.mean(axis=0)
        sigma["gyro_bias"] = left.std(axis=0, ddof=1) / np.sqrt(len(left))
    residual = force - fit.bias - gravity * up @ fit.model.T
    return TableTest(
        "positions", _merged(base, parts, sigma, name), tuple(parts),
        np.array([[r.start, r.time[-1]] for r in dwells]), gravity * up, residual, fit.residual_rms,
    )  # fmt: skip


def calibrate_rates(
    record: ImuRecord, turns: Sequence[RateTurn], site: Site, *, base: Calibration | None = None,
    name: str = "rates",
) -> TableTest:  # fmt: skip
    """Calibrate the gyros from turns of a table at known constant rates.

    Each turn is cut to whole revolutions, over which what is across its axis averages out.

    Parameters
    ----------
    record : ImuRecord
    turns : sequence of RateTurn
        About each axis, both ways; in order where their times are not given.
    site : Site
        Its Earth rate along the table's axis is taken off.
    base : Calibration, optional
        Has what is not observable in this test: the accelerometers.
    name : str

    Raises
    ------
    InputError
        For turns that are not found in the record, or leave an axis that is not observable.

    Examples
    --------
    >>> rates, axes = np.tile([0.6, -0.6], 3), np.repeat(np.eye(3), 2, axis=0)
    >>> turning = np.repeat(rates[:, None] * axes, 240, axis=0)
    >>> turning[np.arange(1440) % 240 < 60] = 0.0
    >>> time, dt = 0.05 * np.arange(1, 1441), np.full(1440, 0.05)
    >>> turned = sc.ImuRecord(time, dt, (turning + 1e-4) * 0.05, np.zeros((1440, 3)))
    >>> turns = [RateTurn(tuple(axis), rate) for rate, axis in zip(rates, axes)]
    >>> fit = calibrate_rates(turned, turns, sc.Site(0.0))
    >>> round(float(fit.calibration.gyro_bias[0]), 5)
    0.0001
    """
    stretches = _turn_stretches(record, turns)
    earth_n = EARTH_RATE * np.array([0.0, np.cos(site.latitude), np.sin(site.latitude)])
    outputs, along, kept = [], [], []
    for k, (turn, (a, b)) in enumerate(zip(turns, stretches, strict=True), 1):
        revolution = 2.0 * np.pi / abs(turn.rate)
        whole = np.floor((b - a) / revolution + 1e-6) * revolution
        part = record.between(a, a + (whole or b - a))
        if len(part) < 10:
            raise InputError(f"turn {k}: holds {len(part)} samples; a turn needs ten or more")
        outputs.append(np.sum(part.dtheta, axis=0) / np.sum(part.dt))
        direction = np.asarray(turn.direction) / np.linalg.norm(turn.direction)
        along.append(float(direction @ earth_n))
        kept.append((part.start, part.time[-1]))
    rates, axes = np.array([t.rate for t in turns]), np.array([t.axis for t in turns])
    y = np.array(outputs)
    fit = rate_test(y, rates, axes, along)
    truth = (rates + along)[:, None] * axes / np.linalg.norm(axes, axis=1)[:, None]
    residual = y - fit.bias - truth @ fit.model.T
    parts = {"gyro_bias": fit.bias, "gyro_matrix": fit.matrix}
    sigma = {"gyro_bias": fit.bias_sigma, "gyro_matrix": fit.matrix_sigma}
    return TableTest(
        "rates", _merged(base or Calibration(), parts, sigma, name), tuple(parts), np.array(kept),
        truth, residual, fit.residual_rms,
    )  # fmt: skip


def _merged(
    base: Calibration, parts: dict[str, Array], sigma: dict[str, Array], name: str
) -> Calibration:
    kept = {key: value for key, value in base.sigma.items() if key not in parts}
    changed: dict[str, Any] = dict(parts)
    return replace(base, **changed, sigma={**kept, **sigma}, name=name)


def _dwells(
    records: Sequence[ImuRecord], given: list[Position] | None, count: int, initial: float
) -> list[ImuRecord]:
    if given is not None and any(p.start is not None for p in given):
        if len(records) != 1 or any(p.start is None or p.stop is None for p in given):
            raise InputError(
                "a sequence with times is for one record, and needs start and stop of each position"
            )
        return [_between(records[0], p.start, p.stop, f"position {k}")
                for k, p in enumerate(given, 1)]  # fmt: skip
    if len(records) == 1:
        r = records[0]
        rests = find_rests(r.time, r.accel, r.gyro, initial=initial)
        found = [r.rows(int(a), int(b)) for a, b in rests]
    else:
        found = list(records)
    if len(found) != count:
        raise InputError(
            f"found {len(found)} dwells, but {count} positions were asked for: say their times in "
            "a sequence, give one file for each dwell, or --positions"
        )
    return found


def _between(record: ImuRecord, start: float | None, stop: float | None, what: str) -> ImuRecord:
    part = record.between(start, stop)
    if len(part) < 10:
        raise InputError(f"{what}: {start} to {stop} s holds {len(part)} samples of the record")
    return part


def _nearest(force: Array, known: Array) -> Array:
    """Return which direction of a scheme each force is along, each as often as it has it."""
    unit = force / np.linalg.norm(force, axis=1)[:, None]
    directions, times = np.unique(np.round(known, 12), axis=0, return_counts=True)
    cosine = unit @ directions.T
    nearest = cosine.argmax(axis=1)
    far = np.arccos(np.clip(cosine.max(axis=1), -1.0, 1.0))
    if far.max() > _TOO_FAR:
        k = int(far.argmax())
        raise InputError(
            f"dwell {k + 1}: its force is {far[k] / DEG:.0f} deg from any position of this scheme; "
            "say where the table was with a sequence"
        )
    seen = np.bincount(nearest, minlength=len(directions))
    if not np.array_equal(seen, times):
        k = int(np.argmax(np.abs(seen - times)))
        axis = ", ".join(f"{v:.2g}" for v in directions[k])
        raise InputError(
            f"{seen[k]} dwell(s) have up along ({axis}), where this scheme has {times[k]}"
        )
    return np.asarray(directions[nearest])


def _turn_stretches(record: ImuRecord, turns: Sequence[RateTurn]) -> list[tuple[float, float]]:
    if any(t.start is not None for t in turns):
        if any(t.start is None or t.stop is None for t in turns):
            raise InputError("a sequence with times needs start and stop of every turn")
        return [(float(t.start or 0.0), float(t.stop or 0.0)) for t in turns]
    least = 0.5 * min(abs(t.rate) for t in turns)
    each = max(2, round(_BLOCK / float(np.median(record.dt))))
    k = len(record) // each
    mean = record.gyro[: k * each].reshape(k, each, 3).mean(axis=1)
    ends = record.time[each - 1 :: each][:k]
    size = np.linalg.norm(mean, axis=1)
    same = np.linalg.norm(np.diff(mean, axis=0), axis=1) < 0.01 * np.maximum(size[1:], least)
    found: list[tuple[float, float]] = []
    a = 0
    for i in range(1, k + 1):
        if i < k and same[i - 1]:
            continue
        length = ends[i - 1] - ends[a]
        if size[a] > least and length >= _SHORTEST:
            # The first block and the last may hold a part of the table's speeding up.
            found.append((float(ends[a]), float(ends[i - 1] - _BLOCK)))
        a = i
    if len(found) != len(turns):
        raise InputError(
            f"found {len(found)} stretches of constant rate, but the sequence has {len(turns)} "
            "turns: give start and stop of each"
        )
    return found


def positions_from_toml(path: str | Path) -> list[Position]:
    r"""Read where the table was: tables ``[[position]]`` with attitude and, if wanted, times.

    Raises
    ------
    InputError
        If the file cannot be read or holds a bad value.

    Examples
    --------
    >>> from pathlib import Path
    >>> text = "[[position]]\nattitude = [30, 0, 0]\n"
    >>> length = Path("table.toml").write_text(text)
    >>> positions_from_toml("table.toml")[0].attitude
    (30.0, 0.0, 0.0)
    """
    out = []
    for k, table in _tables(path, "position", ("attitude", "start", "stop")):
        what = f"{path}: position {k}"
        angles = table.get("attitude")
        if not isinstance(angles, list) or len(angles) != 3:
            raise InputError(f"{what}: attitude must be psi, theta, gamma in deg, got {angles!r}")
        psi, theta, gamma = (number(v, f"{what}: attitude") for v in angles)
        out.append(Position((psi, theta, gamma), *_times(table, what)))
    return out


def turns_from_toml(path: str | Path) -> list[RateTurn]:
    r"""Read a rate test: tables ``[[turn]]`` with axis, rate and, if wanted, direction and times.

    Raises
    ------
    InputError
        If the file cannot be read or holds a bad value.

    Examples
    --------
    >>> from pathlib import Path
    >>> length = Path("turns.toml").write_text('[[turn]]\naxis = "z"\nrate = "10 deg/s"\n')
    >>> turns_from_toml("turns.toml")[0].axis
    (0.0, 0.0, 1.0)
    """
    out = []
    for k, table in _tables(path, "turn", ("axis", "rate", "direction", "start", "stop")):
        what = f"{path}: turn {k}"
        axis = table.get("axis")
        vector = _AXES.get(axis) if isinstance(axis, str) else _vector(axis, f"{what}: axis")
        if vector is None:
            raise InputError(f"{what}: axis must be x, y, z or three numbers, got {axis!r}")
        rate = parse(table.get("rate", ""), "angular rate", f"{what}: rate")
        if rate == 0.0:
            raise InputError(f"{what}: a rate of zero shows no scale factor")
        direction = _vector(table.get("direction", [0.0, 0.0, 1.0]), f"{what}: direction")
        out.append(RateTurn(vector, rate, direction, *_times(table, what)))
    return out


def _tables(path: str | Path, name: str, keys: Sequence[str]) -> list[tuple[int, dict[str, Any]]]:
    data = read_toml(path)
    check_keys(data, (name,), str(path))
    rows = data.get(name)
    if not isinstance(rows, list) or not rows:
        raise InputError(f"{path}: expected tables [[{name}]], one for each")
    for k, row in enumerate(rows, 1):
        check_keys(row, keys, f"{path}: {name} {k}")
    return list(enumerate(rows, 1))


def _times(table: dict[str, Any], what: str) -> tuple[float | None, float | None]:
    start, stop = (
        number(table[key], f"{what}: {key}", " of s") if key in table else None
        for key in ("start", "stop")
    )
    if (start is None) != (stop is None) or (start is not None and stop is not None and
                                             stop <= start):  # fmt: skip
        raise InputError(f"{what}: expected start and stop, the second later, or neither")
    return start, stop


def _vector(value: ArrayLike | None, what: str) -> tuple[float, float, float]:
    if not isinstance(value, list) or len(value) != 3:
        raise InputError(f"{what}: expected three numbers, got {value!r}")
    x, y, z = (number(v, what) for v in value)
    if x == y == z == 0.0:
        raise InputError(f"{what}: must not be zero")
    return x, y, z
