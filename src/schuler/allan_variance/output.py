"""Deviations and fitted noise for files and people, in the field's units."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

from schuler._files import replacing
from schuler.allan_variance.density import UNITS_SI
from schuler.allan_variance.noise_fit import NoiseFit, NoiseTerm
from schuler.allan_variance.result import Allan
from schuler.errors import InputError
from schuler.units import to_unit

__all__ = [
    "columns", "curve_lines", "fit_lines", "in_si", "save_spec", "si_unit", "term_text", "to_dict",
    "unit_of",
]  # fmt: skip


def unit_of(channel: str) -> str:
    """Return the customary unit of a channel's deviation."""
    return "deg/h" if channel.startswith("gyro") else "ug"


def _digits(value: float, digits: int) -> str:
    """Return a number with so many digits, and 482 as 480 and not as 4.8e+02."""
    return f"{float(f'{value:.{digits}g}'):g}"


def term_text(term: NoiseTerm) -> str:
    """Return a term as ``2.307 ± 0.051 deg/sqrt(h)``, or its limit as ``< 1.2 deg/h``."""
    if term.value is None or term.sigma is None:
        return f"< {_digits(to_unit(term.below, term.unit), 3)} {term.unit}"
    value, sigma = to_unit(term.value, term.unit), to_unit(term.sigma, term.unit)
    return f"{_digits(value, 4)} ± {_digits(sigma, 2)} {term.unit}"


def in_si(channel: str, place: int, term: NoiseTerm) -> str:
    """Return the term at a place of a channel's fit in SI, as ``1.456e-05 rad/s/sqrt(Hz)``."""
    unit = si_unit(channel, place)
    return f"< {term.below:.3g} {unit}" if term.value is None else f"{term.value:.4g} {unit}"


def si_unit(channel: str, place: int) -> str:
    """Return the SI unit of the term at a place (Q, N, B, K, R) of a channel's fit."""
    return UNITS_SI["gyro" if channel.startswith("gyro") else "accel"][place]


def _in_json(channel: str, place: int, term: NoiseTerm) -> dict[str, Any]:
    seen = term.value is not None and term.sigma is not None
    sigma = term.sigma if seen else term.below / 1.645
    return {
        "value": to_unit(term.value or 0.0, term.unit),
        "unit": term.unit,
        "sigma": to_unit(sigma or 0.0, term.unit),
        "value_si": term.value or 0.0,
        "unit_si": si_unit(channel, place),
    }


def to_dict(found: Allan, fit: NoiseFit | None = None) -> dict[str, Any]:
    """Return deviations and fit ready for JSON (schema ``schuler.allan/2``).

    A term that is not observable in the record has the value 0 and the sigma of which 1.645 is its
    95 % limit; without a fit, ``fit`` is null.
    """
    channels: dict[str, Any] = {}
    for k, name in enumerate(found.channels):
        unit = unit_of(name)
        one: dict[str, Any] = {"unit": unit}
        for key, values in (
            ("adev", found.deviation),
            ("lower", found.lower),
            ("upper", found.upper),
        ):
            one[key] = [to_unit(float(v), unit) for v in values[:, k]]
        one["fit"] = None
        if fit is not None:
            terms = fit.channels[name].terms
            one["fit"] = {
                term: _in_json(name, place, value)
                for place, (term, value) in enumerate(terms.items())
            }
        channels[name] = one
    return {
        "schema": "schuler.allan/2",
        "kind": found.kind,
        "tau_s": [float(t) for t in found.tau],
        "channels": channels,
    }


def columns(found: Allan, fit: NoiseFit | None = None) -> dict[str, Any]:
    """Return a table: averaging time, and of each channel deviation, bounds and fitted curve."""
    out: dict[str, Any] = {"tau [s]": found.tau}
    for k, name in enumerate(found.channels):
        unit = unit_of(name)
        factor = to_unit(1.0, unit)
        for what, values in (
            ("", found.deviation), (" lower", found.lower), (" upper", found.upper),
        ):  # fmt: skip
            out[f"{name}{what} [{unit}]"] = factor * values[:, k]
        if fit is not None:
            out[f"{name} fit [{unit}]"] = factor * fit.curve(name, found.tau)
    return out


def curve_lines(found: Allan) -> list[str]:
    """Return a table of the deviations: a line to an averaging time, a column to a channel."""
    units = [unit_of(name) for name in found.channels]
    lines = [
        f"{found.kind} deviation of {found.name}: {found.samples} samples, {found.duration:.6g} s",
        f"{'tau s':>10}" + "".join(f"  {name:>10}" for name in found.channels),
        f"{'':>10}" + "".join(f"  {unit:>10}" for unit in units),
    ]
    for tau, row in zip(found.tau, found.deviation, strict=True):
        cells = (to_unit(float(v), u) for v, u in zip(row, units, strict=True))
        lines.append(f"{tau:10.5g}" + "".join(f"  {v:10.4g}" for v in cells))
    return lines


def fit_lines(fit: NoiseFit) -> list[str]:
    """Return the fitted terms: a line to each channel and term."""
    lines = ["noise, ± 1 sigma, and in SI (<: not seen in this record, under this with 95 %)"]
    for name, part in fit.channels.items():
        for k, (term, value) in enumerate(part.terms.items()):
            label = name if k == 0 else ""
            lines.append(
                f"{label:>10}  {term.replace('_', ' '):<24}  {term_text(value):<32}  "
                f"{in_si(name, k, value)}"
            )
    return lines


def save_spec(
    fit: NoiseFit,
    path: str | Path,
    *,
    gyro_bias: float = 0.0,
    accel_bias: float = 0.0,
    note: str = "",
    by_axis: bool = False,
) -> None:
    """Write the fitted noise as a TOML specification that ``--spec`` takes.

    Parameters
    ----------
    fit : NoiseFit
    path : str or path
    gyro_bias, accel_bias : float
        What is not observable in a static record, 1 sigma, rad/s and m/s^2; the file says where it
        holds none.
    note : str
        Added to where the figures come from.
    by_axis : bool
        Write the figures of x, y and z, and not their rms.

    Raises
    ------
    InputError
        If a bias is no number of 0 or more, or the file cannot be written.
    """
    import tomli_w

    path = Path(path)
    for name, value in (("gyro", gyro_bias), ("accelerometer", accel_bias)):
        if not (math.isfinite(value) and value >= 0.0):
            raise InputError(f"the {name} bias must be 0 or more (1 sigma), got {value:g}")
    found = fit.to_spec(path.stem, by_axis=by_axis)
    without = [
        name for name, value in (("gyro", gyro_bias), ("accelerometer", accel_bias)) if not value
    ]
    said = [found.source]
    if without:
        said.append(f"no {' or '.join(without)} bias is in it")
    spec = replace(
        found,
        gyro=replace(found.gyro, bias=gyro_bias),
        accelerometer=replace(found.accelerometer, bias=accel_bias),
        source="; ".join([*said, *([note] if note else [])]),
    )
    text = tomli_w.dumps({"name": spec.name, "source": spec.source, **spec.describe()})
    head = f"# Noise from a static record, {'of x, y, z' if by_axis else 'rms over the axes'}.\n"
    if without:
        head += (
            f"# It holds no {' or '.join(without)} bias, which is not observable at rest:\n"
            '# take from the data sheet bias = "... deg/h" for [gyro], bias = "... ug" for\n'
            "# [accelerometer], or say --gyro-bias and --accel-bias.\n"
        )
    with replacing(path) as temporary:
        temporary.write_text(head + text, encoding="utf-8", errors="replace")
