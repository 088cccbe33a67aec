"""`Alignment`: an attitude with its covariance, budget, limit and warnings."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from schuler._notebook import bar, card
from schuler._result import Result
from schuler.alignment.history import History
from schuler.alignment.method import Method
from schuler.alignment.stationary.kalman import FilterHistory
from schuler.attitude import heading_sigma, psi_to_heading, quat_to_euler
from schuler.constants import ARCMIN, DEG
from schuler.earth import Site
from schuler.record import Summary
from schuler.sensors import ImuSpec
from schuler.units import significant, time_text

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

__all__ = ["AXES", "SCHEMA", "Alignment"]

Array = NDArray[np.float64]

SCHEMA = "schuler.alignment/3"
AXES = ("east", "north", "up")

NO_HEADING = 10.0
"""Sigma (deg) above which a heading is none."""

UNKNOWN = 60.0
"""Sigma (deg) above which JSON has no heading."""

STEEP = 89.0
"""Pitch (deg) beyond which heading and roll are not defined singly."""


@dataclass(frozen=True, eq=False)
class Alignment(Result):
    """Where the body points, how sure that is, and why.

    Parameters
    ----------
    method : Method
    site : Site
    start, end : float
        The span that was used, s in the record's time.
    samples : int
        Samples used.
    at : {"start", "end"}
        The instant of the attitude.
    quat_nb : (4,) float64
        quat_nb, scalar first.
    covariance : (3, 3) float64
        Of phi (east, north, up), rad^2: the sum of the budget.
    budget : dict of str to (3, 3) float64
        Covariance by source, rad^2. Without a specification only the disturbance is in it.
    bound : (3, 3) float64 or None
        Cramér-Rao limit for that specification, latitude and time at rest, rad^2.
    warnings : tuple of str
        What a reader of the result must know.
    contradictions : tuple of str
        What the record shows and cannot be, said first: the result is not to be trusted.
    spec : ImuSpec or None
        The instrument that was assumed.
    orthonormality : float or None
        For the analytic method, how far the measured vectors are from the angle that latitude
        gives, rad.
    gyro_bias, accel_bias : (3,) float64 or None
        Estimated biases, rad/s and m/s^2; None where the method does not estimate them.
    bias_covariance : (6, 6) float64 or None
        Of both, gyros first.
    history : History
        The pass over the record.
    summary : Summary
        What the record looks like.
    why : str
        Why the method was chosen, where it was.
    filter_history : FilterHistory or None
        What a Kalman filter said after each step.
    inputs : dict of str to str
        What is needed to do the same again.

    Examples
    --------
    >>> fix = sc.align(record, site, spec=spec)
    >>> bool(abs(fix.heading_deg - 30.0) < 3.0 * fix.heading_sigma_arcmin / 60.0), fix.consistent
    (True, True)
    """

    method: Method
    site: Site
    start: float
    end: float
    samples: int
    at: str
    quat_nb: Array
    covariance: Array
    budget: dict[str, Array]
    bound: Array | None
    warnings: tuple[str, ...]
    spec: ImuSpec | None
    orthonormality: float | None
    gyro_bias: Array | None
    accel_bias: Array | None
    bias_covariance: Array | None
    history: History = field(repr=False)
    summary: Summary = field(repr=False)
    why: str = ""
    filter_history: FilterHistory | None = field(default=None, repr=False)
    contradictions: tuple[str, ...] = ()
    inputs: dict[str, str] = field(default_factory=dict, repr=False)

    def noting(self, warnings: Iterable[str], inputs: dict[str, str]) -> Alignment:
        """Return the same result with warnings put first and inputs added.

        Examples
        --------
        >>> fix.noting(["a crane was running nearby"], {"record": "imu.csv"}).warnings[-1]
        'a crane was running nearby'
        """
        return replace(
            self,
            warnings=(*warnings, *self.warnings),
            inputs={**self.inputs, **inputs},
        )

    def contradicted(self, texts: Iterable[str]) -> Alignment:
        """Return the same result with contradictions from elsewhere: then there is no heading.

        Examples
        --------
        >>> wider = fix.contradicted(["the table stood elsewhere"])
        >>> wider.consistent
        False
        """
        added = tuple(texts)
        if not added:
            return self
        # Of the heading nothing is known: the largest variance that is ever stated.
        unknown = np.diag([0.0, 0.0, max(np.pi**2 / 3.0 - self.covariance[2, 2], 0.0)])
        return replace(
            self,
            contradictions=(*added, *self.contradictions),
            covariance=self.covariance + unknown,
            budget={**self.budget, "contradiction": unknown},
        )

    @property
    def time(self) -> float:
        """The instant of the attitude, s in the record's time."""
        return self.end if self.at == "end" else self.start

    @property
    def duration(self) -> float:
        """Length of the span, s."""
        return self.end - self.start

    @property
    def rotation(self) -> Rotation:
        """C_b^n as a `scipy.spatial.transform.Rotation`."""
        from schuler.attitude import to_scipy

        return to_scipy(self.quat_nb)

    @property
    def heading_deg(self) -> float:
        """Heading, clockwise from north in [0, 360), deg."""
        return float(psi_to_heading(quat_to_euler(self.quat_nb)[0])) / DEG

    @property
    def pitch_deg(self) -> float:
        """Pitch, deg."""
        return float(quat_to_euler(self.quat_nb)[1]) / DEG

    @property
    def roll_deg(self) -> float:
        """Roll, deg."""
        return float(quat_to_euler(self.quat_nb)[2]) / DEG

    @property
    def sigma_arcmin(self) -> Array:
        """1-sigma of phi, east, north, up, arcmin, (3,)."""
        return np.asarray(np.sqrt(np.diag(self.covariance)) / ARCMIN)

    @property
    def consistent(self) -> bool:
        """Whether nothing in the record contradicts the result."""
        return not self.contradictions

    @property
    def heading_sigma_arcmin(self) -> float:
        """1-sigma of the printed heading, arcmin.

        It is that of phi about up where the body is level; with a pitch theta the tilts enter by
        tan(theta). No larger than that of an unknown angle, 104 deg.
        """
        return heading_sigma(self.quat_nb, self.covariance) / ARCMIN

    @property
    def limit_arcmin(self) -> Array | None:
        """Cramér-Rao limit of phi, east, north, up, arcmin, (3,)."""
        return None if self.bound is None else np.asarray(np.sqrt(np.diag(self.bound)) / ARCMIN)

    @property
    def budget_arcmin2(self) -> dict[str, float]:
        """Variance of phi_U by source, arcmin^2."""
        return {name: float(cov[2, 2]) / ARCMIN**2 for name, cov in self.budget.items()}

    def to_dict(self) -> dict[str, Any]:
        """Return the result with the keys of the JSON schema `schuler.alignment/3`.

        The heading is null where its sigma is above 60 deg.
        """

        def named(values: Array | None) -> dict[str, float] | None:
            if values is None:
                return None
            return {axis: float(v) for axis, v in zip(AXES, values, strict=True)}

        def plain(values: Array | None, unit: float) -> list[float] | None:
            return None if values is None else [float(v) / unit for v in values]

        from schuler.constants import DEG_PER_HOUR, MICRO_G

        sigma = None if self.bias_covariance is None else np.sqrt(np.diag(self.bias_covariance))
        heading = None if self.heading_sigma_arcmin > UNKNOWN * 60.0 else self.heading_deg
        return {
            "schema": SCHEMA,
            "consistent": self.consistent,
            "contradictions": list(self.contradictions),
            "method": self.method.to_table(),
            "time": {
                "start": self.start,
                "end": self.end,
                "duration_s": self.duration,
                "samples": self.samples,
            },
            "heading_deg": heading,
            "heading_sigma_arcmin": self.heading_sigma_arcmin,
            "pitch_deg": self.pitch_deg,
            "roll_deg": self.roll_deg,
            "quaternion_wxyz": [float(v) for v in self.quat_nb],
            "sigma_arcmin": named(self.sigma_arcmin),
            "limit_arcmin": named(self.limit_arcmin),
            "budget_arcmin2": self.budget_arcmin2,
            "gyro_bias_deg_h": plain(self.gyro_bias, DEG_PER_HOUR),
            "gyro_bias_sigma_deg_h": plain(None if sigma is None else sigma[:3], DEG_PER_HOUR),
            "accelerometer_bias_ug": plain(self.accel_bias, MICRO_G),
            "accelerometer_bias_sigma_ug": plain(None if sigma is None else sigma[3:], MICRO_G),
            "warnings": list(self.warnings),
            "assumed": [v for k, v in self.inputs.items() if k.startswith("assumed ")],
        }

    def to_json(self) -> str:
        """Return the result as JSON text."""
        return json.dumps(self.to_dict(), indent=2, allow_nan=False)

    def _bias_lines(self) -> list[str]:
        from schuler.constants import DEG_PER_HOUR, MICRO_G

        assert self.gyro_bias is not None
        assert self.accel_bias is not None
        assert self.bias_covariance is not None
        sigma = np.sqrt(np.diag(self.bias_covariance))
        out = []
        for name, values, s, unit, text in (
            ("gyro", self.gyro_bias, sigma[:3], DEG_PER_HOUR, "deg/h"),
            ("accelerometer", self.accel_bias, sigma[3:], MICRO_G, "ug"),
        ):
            each = ", ".join(
                f"{significant(v / unit, 3)} ± {significant(e / unit, 2)}"
                for v, e in zip(values, s, strict=True)
            )
            out.append(f"{name} bias {each} {text}")
        return out

    def headline(self) -> str:
        """Return ``heading 269.40 deg ± 1.9' (limit 1.7'; 62 % gyro bias)``.

        A contradiction comes first, after ``INCONSISTENT:``. A heading whose sigma is above 10 deg
        is none: ``no heading (sigma 38 deg)``.
        """
        first = f"INCONSISTENT: {'; '.join(self.contradictions)}; " if self.contradictions else ""
        return first + self._heading_text()

    def _heading_text(self) -> str:
        sigma = self.heading_sigma_arcmin
        if sigma > NO_HEADING * 60.0:
            return f"no heading (sigma {sigma / 60.0:.0f} deg)"
        if abs(self.pitch_deg) > STEEP:
            psi, _, gamma = (float(v) / DEG for v in quat_to_euler(self.quat_nb))
            # Both turn about the vertical: what is left of them is one angle.
            sign = -1.0 if self.pitch_deg > 0 else 1.0
            return (
                f"heading and roll are not defined singly at a pitch of {self.pitch_deg:.2f} deg; "
                f"heading {'-' if sign < 0 else '+'} roll {(sign * gamma - psi) % 360.0:.3f} deg"
            )
        inside = []
        if self.spec is not None and not self.spec.gyro.bias:
            inside.append("repeatability: no bias in it")
        bound = self.limit_arcmin
        if bound is not None:
            inside.append(f"limit {significant(bound[2], 2)}'")
        shares = self.budget_arcmin2
        total = sum(shares.values())
        if total > 0:
            name = max(shares, key=lambda k: shares[k])
            inside.append(f"{100 * shares[name] / total:.0f} % {name.replace('_', ' ')}")
        tail = f" ({'; '.join(inside)})" if inside else ""
        digits = max(0, 1 - int(np.floor(np.log10(max(sigma, 1e-3)))))
        return f"heading {self.heading_deg:.3f} deg ± {sigma:.{digits}f}'{tail}"

    def _repr_html_(self) -> str:
        from html import escape

        east, north, up = self.sigma_arcmin
        rows = [
            ("heading", f"{self.heading_deg:.4f}° ± {up:.2g}′"),
            ("pitch, roll", f"{self.pitch_deg:.4f}°, {self.roll_deg:.4f}° "
                            f"(tilt ± {east:.2g}′ east, ± {north:.2g}′ north)"),
            ("method", escape(f"{self.method}, {self.duration:.6g} s, {self.samples} samples, "
                              f"attitude at the {self.at}")),
        ]  # fmt: skip
        if self.why:
            rows.append(("chosen because", escape(self.why)))
        if self.gyro_bias is not None:
            rows += [("", escape(line)) for line in self._bias_lines()]
        total = float(self.covariance[2, 2]) / ARCMIN**2
        for name, variance in sorted(self.budget_arcmin2.items(), key=lambda item: -item[1]):
            share = variance / total if total > 0 else 0.0
            rows.append((name.replace("_", " "), f"{significant(variance**0.5, 2)}′{bar(share)}"))
        return card(self.headline(), rows, self.warnings)

    def __str__(self) -> str:
        east, north, _ = self.sigma_arcmin
        lines = [
            self.headline(),
            f"pitch {self.pitch_deg:.4f} deg, roll {self.roll_deg:.4f} deg "
            f"(tilt ± {east:.2g}' east, ± {north:.2g}' north)",
            f"{self.method}, {self.duration:.6g} s, {self.samples} samples, "
            f"attitude at the {self.at} (t = {time_text(self.time)} s)",
        ]
        if self.why:
            lines.append(f"chosen because {self.why}")
        if self.gyro_bias is not None and self.accel_bias is not None:
            lines += self._bias_lines()
        return "\n".join(lines + [f"warning: {text}" for text in self.warnings])
