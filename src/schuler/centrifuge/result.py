"""`identify`: a centrifuge test's judgement and estimates, as one result with its own table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from schuler._blas import with_one_blas_thread
from schuler._result import Result, table_of_rows
from schuler.centrifuge.coefficients import (
    PUBLISHED_ESTIMATES,
    coefficient_names,
    coefficient_units,
)
from schuler.centrifuge.files import true_coefficients
from schuler.centrifuge.filter import Ekf, PlatformFit, fit_platform
from schuler.centrifuge.information import scheme_information
from schuler.centrifuge.objective import Judgement, judge
from schuler.centrifuge.plant import Plant
from schuler.centrifuge.scheme import CentrifugeScheme

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["CentrifugeTest", "identify"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class CentrifugeTest(Result):
    """What a test shows of the coefficients, and what it has found.

    Parameters
    ----------
    plant : Plant
    scheme : CentrifugeScheme
    judgement : Judgement
        Of the scheme, before any output.
    fit : PlatformFit or None
        From the outputs, where there are some.
    truth : (n,) float64 or None
        Coefficients of a simulated platform, inside units.
    """

    plant: Plant
    scheme: CentrifugeScheme
    judgement: Judgement = field(repr=False)
    fit: PlatformFit | None = field(default=None, repr=False)
    truth: Array | None = field(default=None, repr=False)

    @property
    def nees(self) -> float | None:
        """Squared error over its covariance, per coefficient: about 1 where all is right."""
        if self.fit is None or self.truth is None:
            return None
        # Scaled to one: the coefficients' units lie ten powers apart.
        error = (self.fit.value - self.truth) / self.fit.sigma
        return float(error @ np.linalg.solve(self.fit.correlation, error)) / len(error)

    @property
    def remarks(self) -> list[str]:
        """What the outputs say against the plant."""
        if self.fit is None:
            return []
        # Squared innovations of unit variance: five sigmas, and a per cent of what is linear.
        most = 1.02 + 5.0 * (2.0 / max(self.fit.samples, 1)) ** 0.5
        if self.fit.nis <= most:
            return []
        return [
            f"the plant does not fit the outputs: the mean squared innovation is "
            f"{self.fit.nis:.3g}, which should be at most {most:.3g}; look at the noise, the "
            "gimbals' order, the positions, the commanded rate and the arm's angle; the sigmas "
            "are too small"
        ]

    def rows(self) -> list[dict[str, Any]]:
        """Return a row for each coefficient, in its customary unit."""
        units, factor = coefficient_units(self.plant.d_oo)
        published = true_coefficients({}, self.plant)
        printed = iter(PUBLISHED_ESTIMATES)
        sigma = self.judgement.sigma if self.fit is None else self.fit.sigma
        out = []
        for k, name in enumerate(coefficient_names(self.plant.d_oo)):
            in_source = not name.startswith("D_OO")
            out.append({
                "name": name, "unit": units[k],
                "true": None if self.truth is None else float(self.truth[k] / factor[k]),
                "sigma": float(sigma[k] / factor[k]),
                "estimate": None if self.fit is None else float(self.fit.value[k] / factor[k]),
                "published_true": float(published[k] / factor[k]) if in_source else None,
                "published_estimate": next(printed) if in_source else None,
            })  # fmt: skip
        return out

    def to_dict(self) -> dict[str, Any]:
        """Return the test as JSON takes it (docs/calibrate-centrifuge.schema.json)."""
        return {
            "schema": "schuler.calibrate-centrifuge/1",
            "gimbal_order": self.plant.order,
            "dwell_s": self.scheme.dwell,
            "positions": [list(row) for row in self.scheme.positions],
            "forces_g": list(self.scheme.forces) or [self.plant.force] * len(self.scheme.positions),
            "objectives": self.judgement.values,
            "worst_relative_sigma": 0.01 * float(self.judgement.relative.max()),
            "rows": self.rows(),
            "mean_squared_innovation": None if self.fit is None else self.fit.nis,
            "nees_per_coefficient": self.nees,
            "weakest": [{"singular_value": s, "parts": part} for s, part in self.judgement.weakest],
        }

    def columns(self) -> dict[str, Any]:
        """Return `rows` as columns, a row to each coefficient."""
        return table_of_rows(self.rows())

    def to_pandas(self) -> pd.DataFrame:
        """Return `rows` as a table by the coefficient's name."""
        return super().to_pandas().set_index("name")

    def __str__(self) -> str:
        worst = int(self.judgement.relative.argmax())
        name = coefficient_names(self.plant.d_oo)[worst]
        lines = [
            f"worst sigma {self.judgement.relative[worst]:.3g} % ({name}, of the published "
            f"coefficient), sum of |rho| {self.judgement.values['sum-rho']:.2f}"
        ]
        if self.fit is not None:
            said = f"mean squared innovation {self.fit.nis:.4f}"
            if self.nees is not None:
                said += f", squared error over covariance {self.nees:.3f} per coefficient"
            lines.append(said)
        lines.append(
            f"{'':8} {'unit':9} {'true':>10} {'sigma':>10} {'estimate':>11} {'error %':>8}   "
            f"{'published':>10} {'error %':>8}"
        )
        for row in self.rows():
            true = row["published_true"] if self.fit is None else row["true"]
            printed, known = row["published_estimate"], row["published_true"]
            off = "-"
            if row["estimate"] is not None and row["true"]:
                off = f"{100 * (row['estimate'] / row['true'] - 1):.2f}"
            lines.append(
                f"{row['name']:8} {row['unit']:9} {_cell(true, 'g', 10)} {row['sigma']:10.3g} "
                f"{_cell(row['estimate'], '.5g', 11)} {off:>8}   {_cell(printed, 'g', 10)} "
                + ("       -" if printed is None else f"{100 * (printed / known - 1):8.2f}")
            )
        return "\n".join(lines)


def _cell(value: float | None, form: str, width: int) -> str:
    return f"{'-' if value is None else format(value, form):>{width}}"


@with_one_blas_thread
def identify(
    plant: Plant, scheme: CentrifugeScheme, outputs: Sequence[Array] | Array | None = None,
    method: Ekf | None = None, *, first: Sequence[float] | None = None, truth: Array | None = None,
) -> CentrifugeTest:  # fmt: skip
    """Judge a scheme and, from a test's outputs, find the coefficients.

    Parameters
    ----------
    plant : Plant
    scheme : CentrifugeScheme
    outputs : (p, m, 3) array_like, or p arrays (m, 3), optional
        Accelerometer outputs at each position, g; without them the scheme is only judged.
    method : Ekf, optional
    first : sequence of float, optional
        As `fit_platform` takes it.
    truth : (n,) float64, optional
        True coefficients of a simulated platform.

    Raises
    ------
    InputError
        For outputs that do not fit, or a scheme in which a coefficient is not observable.

    Examples
    --------
    >>> plan = CentrifugeScheme(dwell=20.0)
    >>> identify(Plant(), plan).judgement.sigma.shape
    (45,)
    """
    forces = list(scheme.forces) or None
    information = scheme_information(plant, scheme.positions, scheme.dwell, forces)
    found = judge(plant, scheme.positions, scheme.dwell, information=information)
    fit = None
    if outputs is not None:
        fit = fit_platform(plant, scheme.positions, outputs, method, forces, first)
    return CentrifugeTest(plant, scheme, found, fit, truth)
