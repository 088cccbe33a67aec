"""`MovingAlignment`: an `Alignment` of a vehicle that moves, with its velocity and position."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler.alignment.method import Estimate, Method, Problem
from schuler.alignment.moving.fine import FineState
from schuler.alignment.result import Alignment
from schuler.constants import ARCMIN, DEG
from schuler.errors import InputError
from schuler.in_motion.coarse import CoarseAlignment
from schuler.ins import BodyVelocity, EpochHistory, Measurement

__all__ = ["InMotion", "MovingAlignment"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class InMotion(Method):
    """What a `MovingAlignment` was made with: it needs more than a record.

    Parameters
    ----------
    form : {"velocity", "position", "body velocity"}
        Of the series of the coarse stage.
    vibration : float
        Velocity random walk on the vehicle, m/s/sqrt(s).
    """

    form: str = "velocity"
    vibration: float = 0.0

    def solve(self, problem: Problem) -> Estimate:
        """See `Method.solve`.

        Raises
        ------
        InputError
            Always: an alignment in motion needs aids.
        """
        raise InputError("an alignment in motion needs aids: say schuler.align(record, aiding=...)")

    def to_table(self) -> dict[str, Any]:
        """Return name and options."""
        return {"name": "in-motion", "options": {"form": self.form, "vibration": self.vibration}}

    def __str__(self) -> str:
        return f"in motion (coarse from {self.form})"


@dataclass(frozen=True, eq=False)
class MovingAlignment(Alignment):
    """An alignment in motion; what `Alignment` has, and what else was found.

    The covariance, the bound and the budget are those of the aided filter; `site` is where the
    vehicle was at the instant.

    Parameters
    ----------
    state : FineState
        All that is known at the instant, with its covariance.
    coarse : CoarseAlignment or None
        What the filter started from; None where that was a master.
    measured : tuple of Measurement
        What it took.
    used, refused : dict of str to int
        Measurements by aid.
    passes : int
        Of the filter over the span.
    mean_square : float
        Squared normalised innovations, on average: 1 where noise is as it was said to be.
    restamped : dict of str to float
        Part of an estimated delay that was taken off the stamps of the aid, s.
    epochs : EpochHistory
        What the last pass had after each measurement; n is the wander frame, East-North-Up at the
        start.
    innovations : dict of str to tuple
        Times (k,), innovations and their sigma (k, 3), weights (k,) by aid.
    smoothed_heading : (3, k) float64
        Times of the measurements (s), the smoothed heading there, clockwise, and its 1-sigma (rad).

    Examples
    --------
    >>> moving = sc.align(drive, aiding=[gnss], spec=spec)
    >>> sorted(moving.used)
    ['gnss', 'gnss_velocity']
    """

    state: FineState = field(kw_only=True, repr=False)
    coarse: CoarseAlignment | None = field(kw_only=True, repr=False)
    measured: tuple[Measurement, ...] = field(kw_only=True, repr=False)
    used: dict[str, int] = field(kw_only=True)
    refused: dict[str, int] = field(kw_only=True)
    passes: int = field(kw_only=True)
    mean_square: float = field(kw_only=True)
    restamped: dict[str, float] = field(kw_only=True)
    epochs: EpochHistory = field(kw_only=True, repr=False)
    innovations: dict[str, tuple[Array, Array, Array, Array]] = field(kw_only=True, repr=False)
    smoothed_heading: Array = field(kw_only=True, repr=False)

    def _part(self, group: str) -> Array:
        place = self.state.layout[group]
        return self.state.covariance[place, place]

    @property
    def v_n(self) -> Array:
        """Velocity of the IMU, east, north, up, m/s, (3,)."""
        return self.state.v_n

    @property
    def v_sigma(self) -> Array:
        """1-sigma of it, m/s, (3,)."""
        return np.asarray(np.sqrt(np.diag(self._part("velocity"))))

    @property
    def position_sigma(self) -> Array:
        """1-sigma of the position, east, north, up, m, (3,)."""
        return np.asarray(np.sqrt(np.diag(self._part("position"))))

    @property
    def start_covariance(self) -> Array:
        """Covariance of phi (rad), velocity (m/s) and position (m), (9, 9)."""
        return self.state.covariance[:9, :9]

    @property
    def estimated(self) -> dict[str, Any]:
        """Values and 1-sigma of what was estimated of aids, by kind and aid."""
        out: dict[str, Any] = {}
        sigma = np.sqrt(np.maximum(np.diag(self.state.covariance), 0.0))
        for aid in self.measured:
            for group, _ in aid.groups:
                if not group.startswith(f"{aid.label}."):
                    continue
                part = group.rpartition(".")[2]
                value, spread = self.state.parameters[group], sigma[self.state.layout[group]]
                if part == "delay":
                    whole = self.restamped.get(aid.label, 0.0) + aid.delay + value[0]
                    pair = [float(whole), float(spread[0])]
                    out.setdefault("delay_s", {})[aid.label] = pair
                elif part == "lever":
                    total = np.asarray(aid.lever, np.float64) + value
                    out.setdefault("lever_m", {})[aid.label] = [total.tolist(), spread.tolist()]
                elif part == "scale" and isinstance(aid, BodyVelocity):
                    pair = [float(aid.scale + value[0]), float(spread[0])]
                    out.setdefault("scale", {})[aid.label] = pair
                elif part == "mount" and isinstance(aid, BodyVelocity):
                    pairs = [(value / DEG).tolist(), (spread / DEG).tolist()]
                    out.setdefault("mount_rotation_deg", {})[aid.label] = {
                        axis: [pairs[0][k], pairs[1][k]] for k, axis in enumerate(aid.mount_axes)
                    }
        return out

    def to_dict(self) -> dict[str, Any]:
        """Return the keys of one at rest, and ``"aids"``."""
        out = super().to_dict()
        rough = self.coarse
        out["aids"] = {
            "used": self.used, "refused": self.refused,
            "form": "master" if rough is None else rough.form,
            "coarse": None if rough is None else {
                "start_s": rough.window[0], "end_s": rough.window[1],
                "heading_sigma_arcmin": rough.heading_sigma / ARCMIN,
                "residual_ratio": rough.ratio,
            },
            "passes": self.passes, "mean_square_innovation": self.mean_square,
            "position": {
                "lat_deg": self.site.lat, "lon_deg": self.site.lon, "height_m": self.site.height,
                "sigma_enu_m": self.position_sigma.tolist(),
            },
            "velocity_enu_m_s": self.v_n.tolist(), "velocity_sigma_m_s": self.v_sigma.tolist(),
            "estimated": self.estimated,
        }  # fmt: skip
        return out

    def __str__(self) -> str:
        lines = super().__str__().split("\n")
        said = ", ".join(f"{n} {name}" for name, n in self.used.items())
        off = sum(self.refused.values())
        v, s = self.v_n, self.v_sigma
        rough = ""
        if self.coarse is not None:
            rough = (
                f"coarse heading ± {self.coarse.heading_sigma / DEG:.2g} deg from "
                f"{self.coarse.form}, "
            )
        more = [
            f"moving: {said}{f', {off} refused' if off else ''}; {rough}{self.passes} passes of "
            "the filter",
            f"velocity {v[0]:.3f}, {v[1]:.3f}, {v[2]:.3f} m/s east, north, up "
            f"(± {s[0]:.2g}, {s[1]:.2g}, {s[2]:.2g}); position {self.site.lat:.7f} deg, "
            f"{self.site.lon:.7f} deg, {self.site.height:.2f} m "
            f"(± {float(np.max(self.position_sigma)):.2g} m)",
        ]
        more += [f"{name} {text}" for name, text in self.estimate_rows()]
        first = next((k for k, line in enumerate(lines) if line.startswith("warning:")), len(lines))
        return "\n".join([*lines[:first], *more, *lines[first:]])

    def estimate_rows(self) -> list[tuple[str, str]]:
        """Return names and values with 1-sigma of what was estimated of aids, in words."""
        out = []
        for kind, each in self.estimated.items():
            for aid, pair in each.items():
                if kind == "delay_s":
                    out.append((f"delay of {aid}", f"{pair[0]:.4f} s ± {pair[1]:.2g}"))
                elif kind == "lever_m":
                    text = ", ".join(f"{v:.2f} ± {s:.2g}" for v, s in zip(*pair, strict=True))
                    out.append((f"lever arm of {aid}", f"{text} m"))
                elif kind == "scale":
                    out.append((f"scale of {aid}", f"{pair[0]:.5f} ± {pair[1]:.2g}"))
                else:
                    text = ", ".join(f"{k} {v:.2f} ± {s:.2g}" for k, (v, s) in pair.items())
                    out.append((f"mounting of {aid}", f"{text} deg"))
        return out
