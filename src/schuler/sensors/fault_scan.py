"""`scan_faults`: the parity test over a whole record, with its rates and delays said.

The gyros are taken to be sound at the start: the parity of that stretch gives their constant
disagreement (biases), which is taken off, and their noise. A fault that is there from the first
sample on is what `schuler.sensors.array_check` looks for.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler._result import Result
from schuler.constants import DEG_PER_HOUR
from schuler.errors import InputError
from schuler.sensors.array import SensorArray
from schuler.sensors.fault_monitor import FaultMonitor, Verdict
from schuler.sensors.parity import ParityTest, isolable, parity_matrix

if TYPE_CHECKING:
    pass

__all__ = ["FaultEvent", "FaultScan", "scan_faults"]

Array = NDArray[np.float64]

_MISS = 0.01
_LEAST_REFERENCE = 100
_LOOK_BACK = 400


@dataclass(frozen=True)
class FaultEvent:
    """What the test did at a window's end.

    Parameters
    ----------
    time : float
        s.
    action : {"detected", "excluded", "taken back"}
    gyro : int or None
        Counted from 1; None where the faulty one cannot be told.
    onset : float or None
        When the fault began, as the parity before the alarm has it, s.
    reason : str

    Examples
    --------
    >>> FaultEvent(30.0, "excluded", 3, 29.5, "its parity is 9.1 sigma").delay
    0.5
    """

    time: float
    action: str
    gyro: int | None
    onset: float | None
    reason: str

    @property
    def delay(self) -> float | None:
        """From the onset to the alarm, s."""
        return None if self.onset is None else self.time - self.onset


@dataclass(frozen=True, eq=False)
class FaultScan(Result):
    """The parity test of a record.

    Parameters
    ----------
    test : ParityTest
        With all gyros in use.
    interval : float
        Of a sample, s.
    reference : float
        Time at the start in which the gyros were taken to be sound, s.
    events : tuple of FaultEvent
    time, statistic : (windows,) float64
        End of each window, s, and its chi-square statistic with all gyros.
    working : tuple of int
        Gyros in use at the end, counted from 1.
    """

    test: ParityTest
    interval: float
    reference: float
    events: tuple[FaultEvent, ...]
    time: Array = field(repr=False)
    statistic: Array = field(repr=False)
    working: tuple[int, ...]

    @property
    def window(self) -> float:
        """Length of a window, s."""
        return self.test.window * self.interval

    def smallest_fault(self, gyro: int, miss: float = _MISS) -> float:
        """Return the step of gyro (from 1) that a window misses with a given chance, rad/s."""
        return self.test.smallest_fault(gyro - 1, miss) / self.interval

    def to_dict(self) -> dict[str, Any]:
        """Return the scan as JSON takes it (docs/array-faults.schema.json)."""
        test = self.test
        gyros = []
        for k in range(1, len(test.array) + 1):
            seen = float(np.linalg.norm(test.parity[:, k - 1])) > 1e-9
            step = self.smallest_fault(k) if seen else None
            delay = None
            if step is not None:
                delay = test.mean_delay(k - 1, step * self.interval) * self.interval
            gyros.append({
                "gyro": k,
                "smallest_fault_deg_h": None if step is None else step / DEG_PER_HOUR,
                "mean_delay_s": delay,
            })  # fmt: skip
        return {
            "schema": "schuler.array-faults/1",
            "array": test.array.name,
            "gyros": gyros,
            "isolable": isolable(test.array),
            "window_s": self.window,
            "reference_s": self.reference,
            "noise_deg_sqrt_h": float(np.rad2deg(test.sigma / np.sqrt(self.interval)) * 60.0),
            "false_alarm_rate": test.false_alarm,
            "false_alarms_per_hour": 3600.0 / self.window * test.false_alarm,
            "miss_rate": _MISS,
            "windows": len(self.time),
            "windows_above": int(np.sum(self.statistic > test.threshold)),
            "events": [
                {"time_s": e.time, "action": e.action, "gyro": e.gyro, "onset_s": e.onset,
                 "delay_s": e.delay, "reason": e.reason}
                for e in self.events
            ],
            "working": list(self.working),
        }  # fmt: skip

    def columns(self) -> dict[str, Any]:
        """Return a row to each event."""
        names = ("time_s", "action", "gyro", "onset_s", "delay_s", "reason")
        events = self.to_dict()["events"]
        return {name: [event[name] for event in events] for name in names}

    def __str__(self) -> str:
        data = self.to_dict()
        count = len(self.test.array)
        found = [e for e in self.events if e.action != "taken back"]
        word = "fault" if len(found) == 1 else "faults"
        lines = [
            f"{data['array']}: {len(found)} {word} in {data['windows']} windows of "
            f"{data['window_s']:g} s; in use at the end: {', '.join(map(str, self.working))} of "
            f"{count}",
            f"noise {data['noise_deg_sqrt_h']:.3g} deg/sqrt(h); false alarms "
            f"{data['false_alarm_rate']:g} a window, {data['false_alarms_per_hour']:.3g} an hour",
        ]
        if not data["isolable"]:
            lines.append(f"{count} gyros show that one is wrong, not which: isolation needs five")
        for each in data["gyros"]:
            if each["smallest_fault_deg_h"] is None:
                lines.append(f"gyro {each['gyro']}: does not show in the parity")
                continue
            lines.append(
                f"gyro {each['gyro']}: a step of {each['smallest_fault_deg_h']:.3g} deg/h is "
                f"missed in 1 of 100 windows, found after {each['mean_delay_s']:.3g} s on the mean"
            )
        for e in self.events:
            who = "one gyro" if e.gyro is None else f"gyro {e.gyro}"
            since = "" if e.onset is None else f", since {e.onset:g} s (delay {e.delay:.3g} s)"
            lines.append(f"{e.time:10.3f} s  {who} {e.action}{since}: {e.reason}")
        return "\n".join(lines)


def scan_faults(
    array: SensorArray, time: ArrayLike, dtheta: ArrayLike, interval: float, *,
    window: float = 1.0, false_alarm: float = 1e-4, reference: float = 60.0, heal: int = 10,
    sigma: float | None = None,
) -> FaultScan:  # fmt: skip
    """Run the parity test over a record: detect, isolate, exclude, take back.

    Parameters
    ----------
    array : SensorArray
        Four sensors or more; its known biases and scale factors are taken out first.
    time : (n,) array_like
        Ends of the samples, s.
    dtheta : (n, m) array_like
        Increments of each gyro, rad.
    interval : float
        Of a sample, s.
    window : float
        Time that is tested at once, s: long ones find small faults, late.
    false_alarm : float
        Chance that a window without a fault alarms.
    reference : float
        Time at the start in which the gyros are taken to be sound, s: their constant disagreement
        and their noise are from there.
    heal : int
        Windows in a row after which an excluded gyro is taken back.
    sigma : float, optional
        Noise of an increment, rad; from the reference where left out.

    Raises
    ------
    InputError
        For fewer than four sensors, columns that are not the array's, or too short a record.

    Examples
    --------
    >>> from schuler.sensors import named_array
    >>> array, rng = named_array("dodecahedron"), np.random.default_rng(1)
    >>> dtheta = 1e-6 * rng.standard_normal((4000, 6))
    >>> dtheta[3000:, 2] += 1e-5
    >>> scan = scan_faults(array, 0.01 * np.arange(4000), dtheta, 0.01, reference=20.0)
    >>> scan.events[0].gyro
    3
    """
    t, m = np.asarray(time, np.float64), np.asarray(dtheta, np.float64)
    if len(array) < 4:
        raise InputError(f"{array.name}: three gyros have no parity; faults need four or more")
    if m.ndim != 2 or m.shape[1] != len(array) or len(t) != len(m):
        raise InputError(
            f"expected increments of {len(array)} gyros with their times, got {m.shape} and "
            f"{len(t)} times"
        )
    if not (np.isfinite(m).all() and np.isfinite(t).all()):
        raise InputError("the gyros' increments and times must be finite numbers")
    if not interval > 0:
        raise InputError(f"a sample's interval must be positive, got {interval}")
    samples, rows = round(window / interval), round(reference / interval)
    if samples < 1:
        raise InputError(
            f"a window holds one sample or more: {window:g} s at {interval:g} s a sample"
        )
    if rows < _LEAST_REFERENCE or len(m) < rows + samples:
        raise InputError(
            f"the reference needs {_LEAST_REFERENCE} samples and a window after it: {rows} of "
            f"{len(m)} were asked for; say a shorter --reference or give a longer record"
        )
    known, scale = np.asarray(array.bias), np.asarray(array.scale)
    clean = (m - interval * known) / (1.0 + scale)
    parity = parity_matrix(array)
    # What the sound gyros disagree by: the part of their mean that no rate explains.
    clean = clean - parity.T @ (parity @ clean[:rows].mean(axis=0))
    if sigma is None:
        steps = np.diff(clean[:rows] @ parity.T, axis=0)
        sigma = float(np.sqrt(np.mean(steps**2) / 2.0))
        if not sigma > 0:
            raise InputError(
                "the gyros agree exactly over the reference, so that their noise is not known: "
                "say it (sigma), or is the record without noise?"
            )
    test = ParityTest(array, sigma, false_alarm, samples)
    monitor = FaultMonitor(test, heal)
    monitor.run(t, clean)
    events = tuple(_event(v, t, clean, test, interval) for v in monitor.verdicts)
    return FaultScan(
        test, interval, reference, events, t[samples - 1 :: samples][: len(m) // samples],
        test.statistic(clean), tuple(i + 1 for i in monitor.working),
    )  # fmt: skip


def _event(
    verdict: Verdict, time: Array, clean: Array, test: ParityTest, interval: float
) -> FaultEvent:
    gyro = None if verdict.sensor is None else verdict.sensor + 1
    onset = None
    if verdict.action != "taken back":
        end = int(np.searchsorted(time, verdict.time, side="right"))
        onset = _onset(time, clean, test, end, verdict.sensor, interval)
    return FaultEvent(verdict.time, verdict.action, gyro, onset, verdict.reason)


def _onset(
    time: Array, clean: Array, test: ParityTest, end: int, sensor: int | None, interval: float
) -> float:
    """Return the likeliest begin of a step that lasts until `end`."""
    begin = max(0, end - _LOOK_BACK * test.window)
    p = clean[begin:end] @ test.parity.T
    column = 0 if sensor is None else sensor
    unit = test.parity[:, column] / np.linalg.norm(test.parity[:, column])
    tail = np.cumsum((p @ unit)[::-1])[::-1]
    first = int(np.argmax(tail**2 / np.arange(len(tail), 0, -1)))
    return float(time[begin + first] - interval)
