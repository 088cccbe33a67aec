"""Alignment where the latitude is not known: gravity's cone in inertial space shows it.

The theory of the velocity, G(t; L), gets a column for the latitude; least squares is iterated from
the angle between mean rate and mean force, and closed by the optimal weights of
`schuler.alignment.stationary.optimal`.

Source: Yan (2008), inertial-frame alignment without latitude.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler._blas import with_one_blas_thread
from schuler._result import Result
from schuler.alignment.aligner import Aligner
from schuler.alignment.history import inertial_to_local
from schuler.alignment.result import Alignment
from schuler.alignment.stationary.optimal import joint
from schuler.constants import DEG
from schuler.earth import Site
from schuler.errors import InputError
from schuler.record import ImuRecord
from schuler.sensors import ImuSpec, load_spec

__all__ = ["LatitudeFix", "align_without_latitude"]

Array = NDArray[np.float64]

_ROUNDS = 12
_CLOSE = 1e-9
_SETTLED = 0.01
"""Step, in sigmas, below which a further round is worth nothing."""

_STEEPEST = 85.0 * DEG


@dataclass(frozen=True, eq=False)
class LatitudeFix(Result):
    """Latitude and attitude.

    Parameters
    ----------
    latitude, sigma : float
        rad, north positive, and its 1-sigma.
    alignment : Alignment
        At that latitude; its covariance holds what the latitude leaves open.
    """

    latitude: float
    sigma: float
    alignment: Alignment

    def to_dict(self) -> dict[str, Any]:
        """Return the alignment's document with the latitude and its 1-sigma."""
        return {
            **self.alignment.to_dict(),
            "latitude_deg": self.latitude / DEG,
            "latitude_sigma_deg": self.sigma / DEG,
        }

    def __str__(self) -> str:
        side = "N" if self.latitude >= 0 else "S"
        return (
            f"latitude {abs(self.latitude) / DEG:.3f} deg {side} ± {self.sigma / DEG:.2g} deg\n"
            f"{self.alignment}"
        )


@with_one_blas_thread
def align_without_latitude(
    record: ImuRecord,
    spec: ImuSpec | str | Path | None = None,
    *,
    height: float = 0.0,
    at: str = "end",
    gravity_sigma: float = 20.0,
    deflection_sigma: float = 5.0,
) -> LatitudeFix:
    """Align a record and find its latitude.

    Parameters
    ----------
    record : ImuRecord
        A stationary, possibly rocking vehicle.
    spec : ImuSpec, str or path, optional
        The instrument; without one sigma holds no biases.
    height : float
        m.
    at : {"end", "start"}
        The instant of the attitude.
    gravity_sigma, deflection_sigma : float
        As of `Site`, mGal and arcsec.

    Raises
    ------
    InputError
        If the record shows no latitude: it is too short or too disturbed, or lies at a pole.

    Examples
    --------
    >>> found = sc.align_without_latitude(record, spec)
    >>> bool(abs(np.rad2deg(found.latitude) - 48.1) < 1.0)
    True
    """
    from dataclasses import replace

    spec = load_spec(spec)
    w, f = record.dtheta.sum(axis=0), record.dvel.sum(axis=0)
    sine = float(w @ f / max(np.linalg.norm(w) * np.linalg.norm(f), 1e-300))
    lat = float(np.clip(np.arcsin(np.clip(sine, -1.0, 1.0)), -_STEEPEST, _STEEPEST))
    sigma = np.inf
    for _ in range(_ROUNDS):
        site = Site(lat / DEG, 0.0, height, gravity_sigma, deflection_sigma)
        tracker = Aligner(site, "optimal", spec, at=at).update(record)
        found = joint(tracker.history(), site, spec, free_latitude=True)
        step = float(np.clip(found.latitude[0], -0.35, 0.35))
        sigma = float(found.latitude[1])
        lat = float(np.clip(lat + step, -_STEEPEST, _STEEPEST))
        if abs(step) < max(_CLOSE, _SETTLED * sigma):
            break
    else:
        raise InputError(
            "the latitude is not observable in the record: the estimate still moves by "
            f"{step / DEG:.2g} deg a round; take a longer or quieter record, or say --lat"
        )
    if sigma > 30.0 * DEG:
        raise InputError(
            f"the record shows its latitude to {sigma / DEG:.0f} deg only: take a longer or "
            "quieter one, or say --lat"
        )
    site = Site(lat / DEG, 0.0, height, gravity_sigma, deflection_sigma)
    aligner = Aligner(site, "optimal", spec, at=at)
    # Found in this record, it may be off by its sigma: no contradiction of the Earth's rate there.
    aligner.latitude_known = False
    fix = aligner.update(record).solution()
    # What the latitude leaves open, on top of the covariance at a known one.
    when = fix.duration if at == "end" else 0.0
    c = inertial_to_local(when, lat)
    known = joint(fix.history, site, spec)
    extra = c @ (found.covariance[:3, :3] - known.covariance[:3, :3]) @ c.T
    values, vectors = np.linalg.eigh(0.5 * (extra + extra.T))
    extra = (vectors * np.maximum(values, 0.0)) @ vectors.T
    budget = {**fix.budget, "latitude": extra}
    fix = replace(fix, budget=budget, covariance=fix.covariance + extra, bound=None)
    return LatitudeFix(lat, sigma, fix)
