"""Process noise, priors and transition of the error states, from an instrument's specification."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.constants import DEG_PER_HOUR, MICRO_G
from schuler.ins.layout import Layout
from schuler.kernels import ins_layout
from schuler.sensors import AccelerometerSpec, GyroSpec, ImuSpec

__all__ = [
    "SOURCES", "GroupNoise", "ProcessNoise", "instability_walk", "instrument_noise",
    "instrument_prior",
]  # fmt: skip

Array = NDArray[np.float64]

#: sources of error that a budget names; measurements may add their own
SOURCES = (
    "gyro_bias", "accelerometer_bias", "gyro_angle_random_walk",
    "accelerometer_velocity_random_walk", "disturbance", "start",
)  # fmt: skip
"""Sources of noise by which a covariance may be divided."""

LEAST_GYRO_BIAS, LEAST_ACCELEROMETER_BIAS = 1e-6 * DEG_PER_HOUR, 1e-3 * MICRO_G
"""Biases (1 sigma) of an instrument that is said to have none."""


@dataclass(frozen=True)
class GroupNoise:
    """How the states of a group change by themselves.

    Parameters
    ----------
    walk : float or (k,) array_like
        Power density: variance that grows by a second.
    sigma : float or (k,) array_like
        Of a first-order Gauss-Markov process.
    time : float
        Its correlation time; infinite for a constant.
    source : str
        What the noise counts as in a budget.

    Examples
    --------
    >>> GroupNoise(walk=1e-8, source="disturbance").walk
    1e-08
    """

    walk: ArrayLike = 0.0
    sigma: ArrayLike = 0.0
    time: float = np.inf
    source: str = "start"


@dataclass(frozen=True, eq=False)
class ProcessNoise:
    """Noise of all states, as the kernel takes it.

    Parameters
    ----------
    walk, bound, fade : (padded,) float64
        Variance a second, steady variance of a Markov process, 1 / its time.
    source : (padded,) int64
        Index into `sources`.
    sources : tuple of str

    Examples
    --------
    >>> layout = Layout(["phi", "velocity", "gyro_bias"])
    >>> noise = ProcessNoise.of(layout, instrument_noise(layout, spec))
    >>> bool(noise.walk[0] == spec.gyro.angle_random_walk**2)
    True
    """

    walk: Array
    bound: Array
    fade: Array
    source: NDArray[np.int64]
    sources: tuple[str, ...]

    @classmethod
    def of(
        cls, layout: Layout, noise: Mapping[str, GroupNoise], sources: Sequence[str] = SOURCES
    ) -> ProcessNoise:
        """Make it of the noise of groups; a group that is not named has none.

        Raises
        ------
        ValueError
            For a group or a source that there is not.
        """
        size = layout.padded
        walk, bound, fade = np.zeros(size), np.zeros(size), np.zeros(size)
        sources = tuple(sources)
        source = np.full(size, sources.index("start"), np.int64)
        for name, each in noise.items():
            if name not in layout:
                raise ValueError(f"there is no group '{name}'")
            place = layout[name]
            walk[place] = each.walk
            source[place] = sources.index(each.source)
            if np.isfinite(each.time):
                bound[place], fade[place] = np.square(each.sigma), 1.0 / each.time
        return cls(walk, bound, fade, source, sources)


def instrument_noise(layout: Layout, spec: ImuSpec | None) -> dict[str, GroupNoise]:
    """Return the noise that an instrument makes in the groups of a layout.

    Parameters
    ----------
    layout : Layout
    spec : ImuSpec or None
        None is an instrument without noise.

    Examples
    --------
    >>> from schuler.sensors import GRADES
    >>> layout = Layout(["phi", "velocity", "gyro_bias", "accelerometer_bias"])
    >>> sorted(instrument_noise(layout, GRADES["navigation-fog"]))
    ['accelerometer_bias', 'gyro_bias', 'phi', 'velocity']
    """
    if spec is None:
        return {}
    gyro, accel = spec.gyro, spec.accelerometer
    noise = {
        "phi": GroupNoise(gyro.white**2, source="gyro_angle_random_walk"),
        "velocity": GroupNoise(accel.white**2, source="accelerometer_velocity_random_walk"),
        "gyro_bias": GroupNoise(gyro.by_axis(gyro.DRIFT) ** 2, source="gyro_bias"),
        "accelerometer_bias": GroupNoise(
            accel.by_axis(accel.DRIFT) ** 2, source="accelerometer_bias"
        ),
    }
    for name, part, source in (
        ("gyro_markov", gyro, "gyro_bias"), ("accelerometer_markov", accel, "accelerometer_bias"),
    ):  # fmt: skip
        if part.gauss_markov:
            sigma = part.by_axis("gauss_markov")
            noise[name] = GroupNoise(0.0, sigma, part.gauss_markov_time, source)
    return {name: each for name, each in noise.items() if name in layout}


LONGEST_CYCLE = 300.0
"""Flicker noise is taken for a walk that agrees with it at one cycle of a span, at most so long:
over more, what a filter has learnt of a bias is forgotten anyway, s."""


def instability_walk(part: GyroSpec | AccelerometerSpec, span: float) -> float | Array:
    """Return the power density of a bias's walk that stands for its instability over a span.

    Flicker noise has the density B^2 / (2 pi f), a walk q / (2 pi f)^2: they agree at f = 1 / T
    for q = 2 pi B^2 / T.

    Parameters
    ----------
    part : GyroSpec or AccelerometerSpec
    span : float
        T, s.

    Examples
    --------
    >>> from schuler.sensors import GRADES
    >>> instability_walk(GRADES["navigation-rlg"].gyro, 60.0) >= 0.0
    True
    """
    power = 2.0 * np.pi * part.by_axis("bias_instability") ** 2
    return power / min(max(span, 1.0), LONGEST_CYCLE)


def instrument_prior(layout: Layout, spec: ImuSpec | None) -> dict[str, float | Array]:
    """Return 1 sigma of each group of sensor errors before anything is measured.

    Parameters
    ----------
    layout : Layout
    spec : ImuSpec or None
        None is an instrument without errors: biases so small that they do not matter.

    Examples
    --------
    >>> layout = Layout(["phi", "velocity", "gyro_bias"])
    >>> sorted(instrument_prior(layout, spec))
    ['gyro_bias']
    """
    sigma: dict[str, float | Array] = {
        "gyro_bias": LEAST_GYRO_BIAS, "accelerometer_bias": LEAST_ACCELEROMETER_BIAS,
    }  # fmt: skip
    if spec is not None:
        gyro, accel = spec.gyro, spec.accelerometer
        sigma = {
            "gyro_bias": np.maximum(gyro.by_axis("bias"), LEAST_GYRO_BIAS),
            "accelerometer_bias": np.maximum(accel.by_axis("bias"), LEAST_ACCELEROMETER_BIAS),
            "gyro_markov": gyro.by_axis("gauss_markov"),
            "accelerometer_markov": accel.by_axis("gauss_markov"),
            "gyro_scale": gyro.by_axis("scale_factor"),
            "accelerometer_scale": accel.by_axis("scale_factor"),
        }  # fmt: skip
    return {name: each for name, each in sigma.items() if name in layout}


def transition(
    layout: Layout, noise: ProcessNoise, state: Array, cfg: Array, options: Array
) -> Array:
    """Return the transition (n, n) over the span that a kernel's state has gathered.

    Parameters
    ----------
    layout, noise
        The states.
    state, cfg, options : float64
        Arrays of the kernel (`schuler.kernels.ins_layout`).
    """
    from schuler.kernels.error_rates import fill_transition

    size = layout.padded
    phi, decay, rates = np.zeros((9, size)), np.zeros(size), np.zeros((9, size))
    dynamic = 9 if layout.at[ins_layout.POSITION] >= 0 else 6
    fill_transition(phi, decay, rates, noise.fade, state, layout.at, cfg, options, dynamic)
    out = np.diag(decay)
    out[:dynamic] = phi[:dynamic]
    return out[: layout.size, : layout.size]
