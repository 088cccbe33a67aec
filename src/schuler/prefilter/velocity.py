"""Empirical mode decomposition of the velocity, before an alignment with a velocity filter.

The force is integrated in the frame that the gyros hold. What gravity and the Earth's rotation
leave in that velocity over minutes is a polynomial of low order, which is put aside; a stationary
vehicle's own velocity is an oscillation about zero, which the decomposition sorts by time scale.
Modes up to the least energetic one are dropped, the polynomial is put back, and the differences are
the force again. A mode wrongly dropped is then an error of the velocity, and stays bounded; taken
from the force it would grow with time.

Sources: Yu, Zhang and Xia (equations 14 to 25) for the filter; Boudraa and Cexus (2007) for the
split. That the velocity is decomposed is not in them.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from schuler.attitude import rotate
from schuler.errors import InputError
from schuler.prefilter.base import Prefilter, even_interval, held_frame
from schuler.prefilter.emd import (
    ceemdan,
    check_clean,
    check_sifting,
    cleaned,
    decompose,
    split_index,
)
from schuler.prefilter.velocity_stream import VelocityEmdStream
from schuler.record import ImuRecord

__all__ = ["VelocityEmd"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class VelocityEmd(Prefilter):
    """Drop the modes of the velocity up to the least energetic one.

    The defaults are the stop and the split that the document prints.

    Parameters
    ----------
    threshold : float
        Of the stop rule: the part of a mode's power that a last sift takes away.
    first : bool
        Split at the first local minimum of the modes' energy instead of the least of all
        (`split_index`).
    ends : {"predict", "mirror", "linear", "pattern"}
        How extrema are continued beyond both ends (`decompose`); "pattern" is the document's.
    order : int
        Of the predictor of "pattern".
    clean : int or "gap"
        Singular components of the Hankel matrix of the velocity that are kept first, or those
        before the widest gap; 0 leaves the velocity as it is.
    window : float
        Rows of that matrix, s.
    trend : int
        Degree of the polynomial that is put aside.
    siftings : int
        Most siftings of a mode.
    ensemble : int
        Noises of an ensemble decomposition (`ceemdan`); 0 decomposes the velocity alone.
    noise : float
        Their standard deviation over that of the velocity.
    seed : int
        Of these noises.
    block : float
        Length of the blocks that are decomposed one by one, s; 0 decomposes the whole record. With
        blocks a record can be a stream (`VelocityEmdStream`).
    overlap : float
        Of two blocks, s, over which one passes into the next.

    Examples
    --------
    >>> smooth = VelocityEmd(siftings=20)(record.between(None, 20.0))
    >>> len(smooth)
    400
    """

    threshold: float = 0.25
    first: bool = False
    ends: str = "predict"
    order: int = 2
    clean: int | str = 0
    window: float = field(default=1.0, metadata={"unit": "time"})
    trend: int = 3
    siftings: int = 200
    ensemble: int = 0
    noise: float = 0.2
    seed: int = 0
    block: float = field(default=0.0, metadata={"unit": "time"})
    overlap: float = field(default=30.0, metadata={"unit": "time"})

    def __post_init__(self) -> None:
        check_sifting(self.ends, "standard-deviation", self.threshold, self.siftings, self.order)
        check_clean(self.clean)
        if not (0.0 < self.window < float("inf") and 0.0 < self.noise < float("inf")):
            raise InputError(
                f"window and noise must be positive, got {self.window} and {self.noise}"
            )
        if not 1 <= self.trend <= 9:
            raise InputError(f"trend is a degree of 1 to 9, got {self.trend}")
        if self.ensemble < 0 or self.seed < 0:
            raise InputError(
                f"ensemble and seed must be 0 or more, got {self.ensemble} and {self.seed}"
            )
        if not (self.block == 0.0 or 0.0 < 2.0 * self.overlap <= self.block < float("inf")):
            raise InputError(
                "block must be 0 (the whole record) or twice the overlap at least, got a block of "
                f"{self.block:g} s and an overlap of {self.overlap:g} s"
            )

    def modes(self, velocity: Array, interval: float, axis: int = 0) -> tuple[Array, Array]:
        """Return the modes of a velocity and what was put aside.

        Parameters
        ----------
        velocity : (n,) float64
            m/s, evenly sampled.
        interval : float
            s between samples.
        axis : int
            Which axis it is: each has noises of its own in an ensemble.

        Returns
        -------
        modes : (k + 1, n) float64
            Intrinsic mode functions, the fastest first, and the residual.
        trend : (n,) float64
            The polynomial.

        Examples
        --------
        >>> velocity = np.cumsum(record.dvel[:, 0])
        >>> modes, trend = sc.VelocityEmd(siftings=20).modes(velocity, 0.05)
        >>> bool(np.allclose(modes.sum(axis=0) + trend, velocity))
        True
        """
        basis = np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, len(velocity)), self.trend)
        coefficients = np.linalg.lstsq(basis, velocity, rcond=None)[0]
        trend = np.asarray(basis @ coefficients)
        rows = max(8, round(self.window / interval))
        rest = cleaned(velocity - trend, self.clean, rows)
        if self.ensemble:
            rng = np.random.default_rng([self.seed, axis])
            found = ceemdan(
                rest, rng, realisations=self.ensemble, noise=self.noise, ends=self.ends,
                order=self.order,
            )  # fmt: skip
        else:
            found = decompose(
                rest, ends=self.ends, threshold=self.threshold, siftings=self.siftings,
                order=self.order,
            )  # fmt: skip
        return found, trend

    def velocity(self, record: ImuRecord) -> tuple[Array, Array]:
        """Return the velocity integral (n + 1, 3), m/s, in the held frame, and that frame.

        The frame is quat_ib0_b (n, 4) at the middle of each sample.
        """
        turn = held_frame(record)
        steps = rotate(turn, record.dvel)
        return np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)]), turn

    def rebuilt(self, velocity: Array, interval: float) -> Array:
        """Return the velocity (n, 3), m/s, without the modes that are dropped.

        Examples
        --------
        >>> emd = sc.VelocityEmd(siftings=20)
        >>> steps = record.dvel[:200]
        >>> velocity = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
        >>> rebuilt = emd.rebuilt(velocity, 0.05)
        >>> bool(np.allclose(rebuilt - velocity, emd.correction(steps, 0.05)))
        True
        """

        def run(axis: int) -> Array:
            series = np.ascontiguousarray(velocity[:, axis])
            modes, trend = self.modes(series, interval, axis)
            return np.asarray(modes[split_index(modes, first=self.first) :].sum(axis=0) + trend)

        with ThreadPoolExecutor() as pool:
            return np.column_stack(list(pool.map(run, range(3))))

    def correction(self, steps: Array, interval: float) -> Array:
        """Return what is added to the velocity (n + 1, 3), m/s, of steps (n, 3) of a block.

        Examples
        --------
        >>> VelocityEmd(siftings=20).correction(np.zeros((200, 3)), 0.05).shape
        (201, 3)
        """
        velocity = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
        return np.asarray(self.rebuilt(velocity, interval) - velocity)

    def whole(self, record: ImuRecord) -> ImuRecord:
        """Return the record filtered as one block.

        Raises
        ------
        InputError
            For a record that is short or unevenly sampled.

        Examples
        --------
        >>> len(sc.VelocityEmd(siftings=20).whole(record.between(None, 20.0)))
        400
        """
        interval = even_interval(record)
        velocity, turn = self.velocity(record)
        steps = np.diff(self.rebuilt(velocity, interval), axis=0)
        return replace(record, dvel=rotate(turn * [1.0, -1.0, -1.0, -1.0], steps))

    def __call__(self, record: ImuRecord) -> ImuRecord:
        """Return the record with the force that the rebuilt velocity has.

        Raises
        ------
        InputError
            For a record that is short or unevenly sampled.
        """
        if not self.block:
            return self.whole(record)
        stream = self.stream()
        return ImuRecord.concatenate([stream.push(record), stream.close()], quality=record.quality)

    @property
    def streams(self) -> bool:
        """Whether the filter can take a record in chunks: with blocks it can."""
        return self.block > 0.0

    def stream(self) -> VelocityEmdStream:
        """Return a filter that takes chunks.

        Raises
        ------
        InputError
            Without a block.
        """
        if not self.block:
            raise InputError(
                "the decomposition of the velocity needs the whole record; in blocks it can run on "
                "a stream: emd-velocity(block=100 s)"
            )
        return VelocityEmdStream(self)
