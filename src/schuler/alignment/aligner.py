"""`Aligner`: chunks in, an alignment out at any time."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from schuler._blas import with_one_blas_thread
from schuler.alignment.conclusion import conclude
from schuler.alignment.filtered import Filtered
from schuler.alignment.history import History
from schuler.alignment.method import Estimate, Method, Problem
from schuler.alignment.methods import parse_method
from schuler.alignment.result import Alignment
from schuler.alignment.stationary.optimal import Linearisation
from schuler.earth import Site
from schuler.errors import InputError, expect
from schuler.kernels.states import TrackerState
from schuler.record import ImuRecord, Reading, Summariser, Summary
from schuler.sensors import ImuSpec, SensorArray, load_array, load_spec

__all__ = ["HOW_RECORD", "Aligner"]

Array = NDArray[np.float64]

POLE = 89.0
"""Latitude (deg) beyond which the Earth's rotation has too little level part for a heading."""

HOW_RECORD = "read a file with schuler.read, a table with schuler.io.from_pandas"
HOW_SITE = "say schuler.Site(lat, lon, height)"


@dataclass(eq=False)
class _Pass:
    """What comes of the samples whatever the method is, kept until more of them come."""

    sums: tuple[History, Summary] | None = None
    filtered: Aligner | None = None


class Aligner:
    """Align a stream: `update` with chunks, `solution` whenever it is wanted.

    Memory is constant for any length, unless a method that needs the samples (`Method.needs`) or a
    prefilter that does not stream (`Prefilter.streams`) keeps the record. Any chunking gives the
    same bits.

    Parameters
    ----------
    site : Site
        Latitude and height; the longitude is not needed.
    method : Method or str, optional
        `Auto()` by default; see `METHODS`.
    spec : ImuSpec, str or path, optional
        The instrument: a grade, a TOML file or an `ImuSpec`.
    at : {"end", "start"}
        The instant of the attitude.
    array : SensorArray or str, optional
        Geometry of redundant gyros: records then have a column for each. The specification stays
        that of the fused triad.
    reading : Reading, optional
        How the values were read, so that no hint is given that cannot be true.

    Attributes
    ----------
    latitude_known : bool
        Set it to False where the site's was found in the same record: the Earth's rate is then not
        held against it.
    name : str
        Of the record.
    said : list of str
        What the quality of its samples warns of.

    Raises
    ------
    InputError
        For an unknown method or specification, or a site too near a pole.

    Examples
    --------
    >>> aligner = sc.Aligner(site, spec=spec)
    >>> for chunk in (record.between(None, 30.0), record.between(30.0, None)):
    ...     aligner = aligner.update(chunk)
    >>> aligner.solution().headline()[:11]
    'heading 29.'
    """

    def __init__(
        self,
        site: Site,
        method: Method | str | None = None,
        spec: ImuSpec | str | Path | None = None,
        *,
        at: str = "end",
        array: SensorArray | str | None = None,
        reading: Reading | None = None,
    ) -> None:
        from schuler.kernels import tracking

        expect(site, Site, "site", HOW_SITE)
        if abs(site.lat) > POLE:
            raise InputError(
                f"latitude {site.lat:g} deg is within {90 - POLE:g} deg of a pole: heading cannot "
                "be found from the Earth's rotation there"
            )
        if at not in ("start", "end"):
            raise InputError(f"at must be start or end, got '{at}'")
        self.site = site
        self.method = parse_method(method)
        self.spec = load_spec(spec)
        self.at = at
        self.array = None if array is None else load_array(array)
        self.reading = reading
        self.latitude_known = True
        self._tracking = tracking
        self._state = TrackerState.begin()
        self._nodes = np.zeros((tracking.NODE_CAPACITY, tracking.ROW))
        self._subsamples = 0
        self._flags = (1.0, 1.0)
        self._tail = (np.empty(0), np.empty(0))
        self._summariser = Summariser()
        self._held: list[ImuRecord] = []
        self.name = "record"
        self.said: list[str] = []
        self._sampling_faults = False
        self._pass = _Pass()
        self._filtered: Filtered | None = None
        if self.method.prefilter is not None:
            plain = Aligner(
                site, self.method.with_prefilter(None), self.spec, at=at, reading=reading
            )
            self._filtered = Filtered(self.method.prefilter.at(site.gravity), plain)

    def fresh(self) -> Aligner:
        """Return an aligner that was made alike and has taken nothing."""
        return Aligner(
            self.site, self.method, self.spec, at=self.at, array=self.array, reading=self.reading
        )

    def branch(self) -> Aligner:
        """Return an aligner that has taken the same samples and continues by itself."""
        assert self._filtered is None
        other = copy(self)
        other._state = TrackerState(self._state.data.copy())
        other._nodes = self._nodes.copy()
        other._summariser = self._summariser.copy()
        other._held = list(self._held)
        other._pass = _Pass()
        return other

    @property
    def samples(self) -> int:
        """Samples taken so far."""
        return int(self._state.samples) if self._filtered is None else self._filtered.samples

    def update(self, chunk: ImuRecord) -> Aligner:
        """Take a chunk that follows the last one; return self.

        Raises
        ------
        InputError
            If the chunk has not three gyros and three accelerometers, or does not follow.
        """
        expect(chunk, ImuRecord, "record", HOW_RECORD)
        if not len(chunk):
            return self
        self._pass = _Pass()
        if self.array is not None:
            chunk = self.array.fuse(chunk)
        if chunk.dtheta.shape[1] != 3 or chunk.dvel.shape[1] != 3:
            raise InputError(
                "an alignment needs three gyros and three accelerometers, got "
                f"{chunk.dtheta.shape[1]} and {chunk.dvel.shape[1]}; of more gyros, name the "
                "array's geometry"
            )
        if len(self._tail[0]) and chunk.time[0] <= self._tail[0][-1]:
            raise InputError(
                f"a chunk starts at t = {chunk.time[0]:.9g} s, not after the last sample "
                f"({self._tail[0][-1]:.9g} s)"
            )
        if self._filtered is not None:
            self._filtered.push(chunk)
            self._tail = (chunk.time[-1:], chunk.dt[-1:])
            return self
        if self.method.needs == "samples":
            self._held.append(chunk)
        if not self._subsamples:
            self._open(chunk)
        self._tracking.track(
            self._state.data, self._nodes, self._subsamples, *self._flags,
            chunk.time, chunk.dt, chunk.dtheta, chunk.dvel,
        )  # fmt: skip
        self._summariser.push(chunk)
        last = (np.concatenate([a, b[-4:]])[-4:] for a, b in zip(
            self._tail, (chunk.time, chunk.dt), strict=True
        ))  # fmt: skip
        self._tail = (next(last), next(last))
        if chunk.quality is not None:
            self.said = chunk.quality.warnings()
            self._sampling_faults = chunk.quality.sampling_faults
        return self

    def _open(self, chunk: ImuRecord) -> None:
        self.name = chunk.name
        # A corrected increment leaves nothing for several samples to correct.
        self._flags = (float(not chunk.coning_corrected), float(not chunk.sculling_corrected))
        wanted = self.method.wanted_subsamples
        if wanted is None:
            # By the first interval alone, so that chunking cannot matter.
            rate = 1.0 / float(chunk.dt[0])
            wanted = 1 + (rate >= 400) + (rate >= 1000) + (rate >= 2000)
            if chunk.coning_corrected and chunk.sculling_corrected:
                wanted = 1
        self._subsamples = int(wanted)

    def arrays(self) -> dict[str, Array]:
        """Return all that a later aligner needs to resume in this one's place."""
        return {
            "tracker": self._state.data.copy(),
            "tracker_nodes": self._nodes[: int(self._state.nodes)].copy(),
            "tracker_tail": np.stack(self._tail),
            "tracker_setting": np.array([self._subsamples, *self._flags, self._sampling_faults]),
            **self._summariser.arrays(),
        }

    def restore(
        self, arrays: dict[str, Array], name: str = "record", said: Sequence[str] = ()
    ) -> None:
        """Go on in the place of the aligner that gave the arrays, made alike.

        Parameters
        ----------
        arrays : dict of str to array
        name : str
            Of the record.
        said : sequence of str
            Of its samples: what its quality warns of.

        Raises
        ------
        InputError
            If the arrays are not those of this version's aligner, or contradict one another.

        Examples
        --------
        >>> one = sc.Aligner(site, spec=spec).update(record.between(None, 30.0))
        >>> other = one.fresh()
        >>> other.restore(one.arrays())
        >>> other.update(record.after(30.0)).solution().headline()[:10]
        'heading 29'
        """
        from schuler.kernels.layout import LayoutError
        from schuler.kernels.tracker_layout import check_aligner

        try:
            check_aligner(arrays)
        except LayoutError as error:
            raise InputError(f"the saved state of an aligner is damaged: {error}") from None
        nodes = arrays["tracker_nodes"]
        self._state = TrackerState(arrays["tracker"].copy())
        self._nodes[: len(nodes)] = nodes
        self._tail = (arrays["tracker_tail"][0], arrays["tracker_tail"][1])
        setting = arrays["tracker_setting"]
        self._subsamples, self._flags = int(setting[0]), (float(setting[1]), float(setting[2]))
        self._sampling_faults = bool(setting[3])
        self.name, self.said = name, list(said)
        self._summariser.restore(arrays)
        self._pass = _Pass()

    def history(self) -> History:
        """Return the pass so far, with the samples that wait for a full update worked in."""
        return History.with_waiting(
            self._state, self._nodes, self._flags, self._tail,
            sampling_faults=self._sampling_faults,
        )  # fmt: skip

    def estimate(
        self, h: History, spec: ImuSpec | None, about: Linearisation | None = None,
        site: Site | None = None,
    ) -> Estimate:  # fmt: skip
        """Return the method's estimate of a history, about something else where that is given.

        Examples
        --------
        >>> aligner = sc.Aligner(site, spec=spec).update(record)
        >>> aligner.estimate(aligner.history(), aligner.spec).attitude.shape
        (3, 3)
        """
        return self.method.solve(
            Problem(
                h, site or self.site, spec, self.at == "end", about,
                lambda: ImuRecord.concatenate(self._held),
            )
        )  # fmt: skip

    def prepared(self) -> Aligner:
        """Filter and track what has been taken, so that a solution only has to solve; return self.

        Raises
        ------
        InputError
            If there are no samples, or the prefilter refuses them.
        """
        if not self.samples:
            raise InputError("the record has no samples to align")
        if self._filtered is None:
            if self._pass.sums is None:
                self._pass.sums = self.history(), self._summariser.summary()
        elif self._pass.filtered is None:
            self._pass.filtered = self._filtered.prepared()
        return self

    def shares_pass(self, method: Method) -> bool:
        """Say whether another method needs of the samples what this one's does."""
        own = self.method
        return (method.prefilter, method.wanted_subsamples, method.needs) == (
            own.prefilter, own.wanted_subsamples, own.needs
        )  # fmt: skip

    def solution_by(self, method: Method, at: str) -> Alignment:
        """Return the alignment of the same samples by another method (`shares_pass`).

        Raises
        ------
        InputError
            See `solution`.

        Examples
        --------
        >>> aligner = sc.Aligner(site, "centred", spec).update(record).branch().prepared()
        >>> aligner.shares_pass(sc.Analytic())
        True
        >>> str(aligner.solution_by(sc.Analytic(), "end").method)
        'analytic'
        """
        assert self.shares_pass(method)
        other = copy(self)
        other.method, other.at = method, at
        return other.solution()

    @with_one_blas_thread
    def solution(self) -> Alignment:
        """Return the alignment of all that has been taken.

        Raises
        ------
        InputError
            If there are too few samples, the vectors do not fix an attitude, or the force is not
            gravity by far (a wrong unit, named).
        """
        self.prepared()
        prefilter = self.method.prefilter
        if prefilter is not None:
            assert self._pass.filtered is not None
            fix = self._pass.filtered.solution_by(self.method.with_prefilter(None), self.at)
            return replace(fix, method=fix.method.with_prefilter(prefilter))
        assert self._pass.sums is not None
        h, summary = self._pass.sums
        gyro_bias = self.spec.gyro.bias if self.spec else 0.0
        hints = summary.hints(self.site, gyro_bias, self.reading)
        ratio = summary.steady_force(self.site.gravity) / self.site.gravity
        if hints and not 0.9 < ratio < 1.1:
            raise InputError(f"{self.name}: {hints[0]} (an alignment needs the force at rest)")
        found = self.estimate(h, self.spec)
        return conclude(self, h, summary, found, hints, float(self._tail[0][-1]))
