"""Alignment of samples as they come, with a state that can be saved and taken up again."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from schuler._version import __version__
from schuler.alignment.aligner import Aligner
from schuler.alignment.checkpoint import LARGEST_FILE, read_checkpoint, write_checkpoint
from schuler.alignment.method import Method
from schuler.alignment.methods import METHODS
from schuler.alignment.result import Alignment
from schuler.earth import Site
from schuler.errors import InputError
from schuler.io.reorder import Reorder
from schuler.record import ImuRecord, Intake
from schuler.sensors import ImuSpec

__all__ = ["LiveAligner"]

Sample = tuple[int, float, tuple[float, ...]]

FILLED = 8
"""Lost samples running that are interpolated."""


def fill(before: list[Sample], samples: list[Sample]) -> list[Sample]:
    """Return samples in order with short losses between them interpolated.

    Parameters
    ----------
    before : list of sample
        The last samples that were returned already, for the first loss.
    samples : list of sample
        Those that follow, in order.
    """
    known = [*before, *samples]
    out: list[Sample] = []
    for k in range(len(before), len(known)):
        missing = known[k][0] - known[k - 1][0] - 1 if k else 0
        if 0 < missing <= FILLED:
            near = known[max(0, k - 3) : k + 3]
            x = np.array([s[0] for s in near], np.float64)
            y = np.array([[s[1], *s[2]] for s in near])
            for number in range(known[k - 1][0] + 1, known[k][0]):
                # Lagrange's weights: exact for a quintic on six neighbours.
                weight = np.array([
                    np.prod([(number - b) / (a - b) for b in x if b != a]) for a in x
                ])  # fmt: skip
                row = weight @ y
                # Times jitter: on a straight line between its neighbours they still increase.
                (n0, t0, _), (n1, t1, _) = known[k - 1][:3], known[k][:3]
                time = t0 + (t1 - t0) * (number - n0) / (n1 - n0)
                out.append((number, time, tuple(map(float, row[1:]))))
        out.append(known[k])
    return out


class TakesSamples(Protocol):
    """What samples in order are given to."""

    @property
    def samples(self) -> int:
        """Samples taken so far."""

    def update(self, chunk: ImuRecord) -> Any:
        """Take samples that follow."""

    def solution(self) -> Alignment:
        """Return the alignment so far."""

    def arrays(self) -> dict[str, NDArray[np.float64]]:
        """Return the state."""

    def restore(self, arrays: dict[str, NDArray[np.float64]], name: str = "record") -> None:
        """Take up a state."""


class LiveAligner:
    """Take the samples of one stream in any order; give the alignment at any time.

    Up to `FILLED` lost samples running are interpolated by a quintic through their neighbours, as
    a held rate would leave the vehicle's sway in the attitude; longer losses are bridged as gaps of
    a record are. Repeated and late samples are left out, and those whose time does not follow that
    of the number before. What comes from a network or a port, where other senders, restarts and
    forged samples are possible, is for `LiveSession`.

    Parameters
    ----------
    site : Site
    kind : {"rates", "mean-rates", "increments"}
        What the values are.
    method : Method or str, optional
        A name of `METHODS`; a prefilter of it must stream (`Prefilter.streams`).
    spec : ImuSpec, str or path, optional
    depth : int
        Samples that are held while one is missing.
    max_gap : float
        Longest gap that is bridged, s.

    Raises
    ------
    InputError
        For an unknown method, or one that needs the whole record, or whose prefilter does.

    Examples
    --------
    >>> live = LiveAligner(site, "increments", spec=spec)
    >>> rows = zip(record.time, record.dtheta, record.dvel)
    >>> live.push((k, float(t), (*w, *f)) for k, (t, w, f) in enumerate(rows))
    >>> live.finish()
    >>> live.solution().headline()[:10]
    'heading 29'
    """

    largest_state = LARGEST_FILE

    def __init__(
        self,
        site: Site,
        kind: str = "increments",
        method: Method | str | None = None,
        spec: ImuSpec | str | Path | None = None,
        *,
        depth: int = 64,
        max_gap: float = 5.0,
    ) -> None:
        self.aligner = Aligner(site, method, spec)
        if self.aligner.method.needs == "samples":
            live = [name for name, method in METHODS.items() if method.needs == "sums"]
            raise InputError(
                f"the method {self.aligner.method} needs the whole record and cannot run live; "
                f"take one of {', '.join(live)}"
            )
        prefilter = self.aligner.method.prefilter
        if prefilter is not None and not prefilter.streams:
            raise InputError(
                f"the prefilter {prefilter} needs the whole record and cannot run live; one in "
                "blocks can: emd-velocity(block=100 s)"
            )
        self._name = method if isinstance(method, str) else str(self.aligner.method)
        self._begin(self.aligner, kind, depth, max_gap)

    def _begin(self, takes: TakesSamples, kind: str, depth: int, max_gap: float) -> None:
        """Begin with nothing, for what takes samples in order."""
        self._takes = takes
        self._max_gap = max_gap
        self.intake = Intake(kind, max_gap=max_gap, name="live")
        self.order = Reorder(depth)
        self._before: list[Sample] = []
        self._wrong_time = 0

    @property
    def samples(self) -> int:
        """Samples that were aligned so far."""
        return self._takes.samples

    @property
    def last_number(self) -> int | None:
        """Number of the next sample that is expected."""
        return self.order.expected

    def recent(self) -> list[Sample]:
        """Return the last samples in order and those that are held."""
        return [*self._before, *self.order.held.values()]

    def push(self, samples: Iterable[Sequence[Any]]) -> None:
        """Take samples as they came: number, time (s) and six values (SI, body axes) each.

        Raises
        ------
        InputError
            If a gap is too long, or a value is beyond any instrument.
        """
        self._take(self.order.push((s[0], s[1], s[2]) for s in samples))

    def finish(self) -> None:
        """Take what is still held: the stream has ended."""
        self._take(self.order.flush())
        rest = self.intake.close()
        if len(rest):
            self._takes.update(rest)

    def _take(self, came: list[Sample]) -> None:
        samples: list[Sample] = []
        last = self._before[-1][1] if self._before else float("-inf")
        for sample in came:
            if sample[1] > last:
                samples.append(sample)
                last = sample[1]
            else:
                self._wrong_time += 1
        if not samples:
            return
        filled = fill(self._before, samples)
        self._before = [*self._before, *filled][-3:]
        samples = filled
        time = np.array([s[1] for s in samples])
        chunk = self.intake.push(time, np.array([s[2] for s in samples]))
        if len(chunk):
            self._takes.update(chunk)

    def solution(self) -> Alignment:
        """Return the alignment so far.

        Raises
        ------
        InputError
            If there are too few samples yet.
        """
        return self._takes.solution()

    def counts(self) -> dict[str, int]:
        """Return what became of the samples."""
        return {
            "aligned": self.samples, "lost": self.order.lost, "repeated": self.order.repeated,
            "late": self.order.late, "held": len(self.order.held),
            "wrong_time": self._wrong_time,
        }  # fmt: skip

    # -- saving ------------------------------------------------------------------------

    def _meta(self) -> dict[str, Any]:
        site, spec = self.aligner.site, self.aligner.spec
        return {
            "schuler": __version__, "site": [
                site.lat, site.lon, site.height, site.gravity_sigma, site.deflection_sigma,
            ],
            "kind": self.intake.kind, "method": self._name,
            "spec": None if spec is None else spec.describe(),
        }  # fmt: skip

    def check_saved(self) -> None:
        """Refuse to save a state that would not be whole.

        Raises
        ------
        InputError
            If the method has a prefilter.
        """
        if self.aligner.method.prefilter is not None:
            raise InputError(
                "a saved state does not hold the samples that a prefilter is at work on: leave out "
                "the checkpoint or the prefilter"
            )

    def _check(self, arrays: Mapping[str, NDArray[np.float64]]) -> None:
        """Raise a `LayoutError` where saved arrays are not those of such an aligner."""
        from schuler.alignment.live_layout import check_state

        check_state(arrays, self.order.depth, self.intake.kind)

    def save(self, path: str | Path, **more: Any) -> None:
        """Write the state (npz), whole or not at all.

        Parameters
        ----------
        path : str or path
        **more
            What else belongs to the state; `load` returns it.

        Raises
        ------
        InputError
            If the file cannot be written, or the method has a prefilter.
        """
        self.check_saved()
        arrays = {**self._takes.arrays(), **self.intake.arrays()}
        for name, samples in (("held", list(self.order.held.values())), ("before", self._before)):
            rows = [[n, t, *v] for n, t, v in samples]
            arrays[name] = np.array(rows, np.float64).reshape(len(rows), 8)
        o = self.order
        arrays["order"] = np.array(
            [-1 if o.expected is None else o.expected, o.lost, o.repeated, o.late,
             self._wrong_time], np.float64,
        )  # fmt: skip
        write_checkpoint(path, {**self._meta(), "more": more}, arrays)

    def load(self, path: str | Path) -> dict[str, Any]:
        """Take up a state that was saved with the same site, method, specification and version.

        Returns
        -------
        dict
            What else was saved with it.

        Raises
        ------
        InputError
            If the file cannot be read, is damaged, or belongs to another alignment, saying what
            differs. Nothing was taken up then.
        """
        from schuler.alignment.live_layout import LayoutError

        self.check_saved()
        meta, arrays = read_checkpoint(path, self.largest_state)
        for key, value in json.loads(json.dumps(self._meta())).items():
            if meta.get(key) != value:
                raise InputError(
                    f"{path}: was saved with {key} = {str(meta.get(key))[:200]}, now it is "
                    f"{value}; start anew with another file, or say what was said before"
                )
        more = meta.get("more")
        try:
            self._check(arrays)
        except LayoutError as error:
            raise InputError(f"{path}: is damaged ({error})") from None
        if not isinstance(more, dict):
            raise InputError(f"{path}: is damaged (its description is not whole)")
        expected, lost, repeated, late, self._wrong_time = (int(v) for v in arrays["order"])
        held, self._before = (
            [(int(r[0]), float(r[1]), tuple(map(float, r[2:]))) for r in arrays[name]]
            for name in ("held", "before")
        )
        self.order = Reorder(
            self.order.depth,
            lost,
            repeated,
            late,
            None if expected < 0 else expected,
            {sample[0]: sample for sample in held},
        )
        self.intake.restore(arrays)
        self._takes.restore(arrays, name="live")
        return more
