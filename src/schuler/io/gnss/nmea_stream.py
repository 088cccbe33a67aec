r"""NMEA sentences as they come, from a network, a port or a pipe, to fixes one by one.

A fix is what the sentences of one instant say. It is whole when the kinds of sentences have come
that the two instants before had, or when one of a later instant comes. Sentences of other kinds are
passed over; damaged ones are counted by reason.
"""

from __future__ import annotations

import re
from collections import Counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler.aiding.fix_rows import fix_row, is_possible
from schuler.errors import InputError
from schuler.io.aiding import fix_heights, fix_noise, quality_scales
from schuler.io.gnss.nmea import SENTENCE, SLOW, need_pynmeagps, parsed, sound
from schuler.io.gnss.table import FixTable

__all__ = ["REASONS", "NmeaStream", "apart"]

Array = NDArray[np.float64]

#: why a sentence or a fix was left out -> in words
REASONS = {
    "aid_checksum": "sentences with a wrong checksum",
    "aid_malformed": "sentences that cannot be decoded",
    "no_fix": "instants without a fix",
    "no_place": "fixes that are no place on Earth, or faster than a vehicle",
    "no_height": "fixes whose height above the ellipsoid is not known",
}

_LONGEST = 1024
"""Bytes that may begin a line without ending it."""

_ANY = re.compile(rb"\$[A-Z]{2}[A-Z]{3},[ -#%-)+-~]{0,120}\*[0-9A-Fa-f]{2}\r?\n?")
_BEGUN = re.compile(rb"\$(?:[A-Z]{0,5}|[A-Z]{5},[ -#%-)+-~]{0,120}(?:\*[0-9A-Fa-f]{0,2}\r?)?)\Z")
_WANTED = re.compile(rb"\$[A-Z]{2}(?:GGA|RMC|VTG|GST),")
_KINDS = (b"GGA", b"RMC", b"VTG", b"GST")


class NmeaStream:
    r"""Bytes or datagrams in, fixes out.

    Parameters
    ----------
    sigma, v_sigma : float, optional
        1-sigma of position (m) and velocity (m/s) where no sentence says it; 3 and 0.1. That of a
        position is of the best quality that came, as in `read_gnss`.
    height : {"ellipsoid", "geoid"}, optional
        What heights are above, where a sentence has no separation of geoid and ellipsoid.

    Raises
    ------
    InputError
        If pynmeagps is missing.

    Examples
    --------
    >>> stream = NmeaStream()
    >>> stream.feed(b"$GPGGA,no,sentence*00\r\n"), stream.counts["aid_checksum"]
    ([], 1)
    """

    def __init__(
        self, sigma: float | None = None, v_sigma: float | None = None, height: str | None = None
    ) -> None:
        need_pynmeagps()
        self._sigma, self._v_sigma, self._height = sigma, v_sigma, height
        self.counts: Counter[str] = Counter()
        self._rest = b""
        self._now: dict[str, Any] = {}
        self._seen: set[bytes] = set()
        self._before: set[bytes] = set()
        self._usual: set[bytes] = set()
        self._given = True
        self._best = np.inf

    def feed(self, data: bytes) -> list[Array]:
        """Return the fixes that are whole with these bytes of a stream.

        Returns
        -------
        list of (14,) float64
            As `schuler.aiding.fix_rows`; the time is that of the UTC day.
        """
        *lines, self._rest = (self._rest + data).split(b"\n")
        if len(self._rest) > _LONGEST:
            self.counts["aid_malformed"] += 1
            self._rest = self._rest[-2:]
        return self._taken(lines)

    def datagram(self, data: bytes) -> list[Array]:
        """Return the fixes that are whole with a datagram, whose last line may have no end."""
        return self._taken(data.split(b"\n"))

    def finish(self) -> list[Array]:
        """Return the fix that nothing has shown to be whole: the stream has ended."""
        rest, self._rest = self._rest, b""
        return [*self._taken([rest]), *self._given_now()]

    def describe(self) -> dict[str, Any]:
        """Return what a later stream, made alike, needs to resume, for JSON."""
        return {
            "rest": self._rest.decode("latin-1"), "now": self._now, "given": self._given,
            "kinds": [
                sorted(kind.decode() for kind in kinds)
                for kinds in (self._seen, self._before, self._usual)
            ],
            "counts": dict(self.counts), "best": None if np.isinf(self._best) else self._best,
        }  # fmt: skip

    def resume(self, said: Any) -> None:
        """Resume where the stream was that described itself so.

        Raises
        ------
        InputError
            If it is no such description.
        """
        try:
            now = {str(name): _number(value) for name, value in said["now"].items()}
            kinds = [{str(kind).encode() for kind in each} for each in said["kinds"]]
            counts = Counter({str(name): int(n) for name, n in said["counts"].items()})
            rest, given = str(said["rest"]).encode("latin-1"), bool(said["given"])
            self._seen, self._before, self._usual = kinds
            self._best = np.inf if said["best"] is None else float(said["best"])
        except (KeyError, TypeError, ValueError, AttributeError):
            raise InputError("the saved state of a stream of fixes is damaged") from None
        self._now, self.counts, self._rest, self._given = now, counts, rest, given

    def _taken(self, lines: list[bytes]) -> list[Array]:
        out: list[Array] = []
        for line in lines:
            if not _WANTED.search(line):
                continue
            match = SENTENCE.search(line)
            if match is None or not sound(match[0]):
                self.counts["aid_checksum"] += 1
                continue
            found = parsed(match[0], match[1])
            if found is None:
                self.counts["aid_malformed"] += 1
                continue
            if found[0] is not None and match[1] in _KINDS:
                out += self._sentence(match[1], found[0])
        return out

    def _sentence(self, kind: bytes, said: dict[str, Any]) -> list[Array]:
        out: list[Array] = []
        time = said.pop("t", None)
        if time is not None and time != self._now.get("t"):
            out += self._given_now()
            # One that was lost once is waited for, once more.
            self._usual = self._seen | self._before
            self._before, self._seen = self._seen, set()
            self._now, self._given = {"t": time}, False
        if not self._now:
            return out
        self._seen.add(kind)
        for name, value in said.items():
            # RMC goes before VTG, which a receiver may send late.
            self._now.setdefault(name, value)
        if self._usual and self._usual <= self._seen:
            out += self._given_now()
        return out

    def _given_now(self) -> list[Array]:
        """Return the fix of the instant, once."""
        if self._given:
            return []
        self._given = True
        now = self._now
        if "lat" not in now or not now["quality"] or now["lat"] is None or now["lon"] is None:
            self.counts["no_fix"] += 1
            return []
        row = self._row(now)
        return [] if row is None else [row]

    def _row(self, now: dict[str, Any]) -> Array | None:
        speed, course = now.get("speed"), now.get("course")
        if speed is not None and course is None and speed < SLOW:
            course = 0.0
        said = {name: now.get(name) for name in ("t", "lat", "lon", "height", "quality")}
        if speed is not None and course is not None:
            said |= {"speed": speed, "course": course}
        if all(now.get(name) not in (None, "") for name in ("sde", "sdn", "sdu")):
            said |= {name: now[name] for name in ("sde", "sdn", "sdu")}
        if now.get("separation") not in (None, ""):
            said["separation"] = now["separation"]
        if said["height"] in (None, ""):
            self.counts["no_height"] += 1
            return None
        columns = {name: np.array([value], np.float64) for name, value in said.items()}
        table = FixTable(columns, "utc-day", above="geoid")
        try:
            height, _ = fix_heights(table, self._height)
        except InputError:
            self.counts["no_height"] += 1
            return None
        self._best = min(self._best, float(quality_scales([now["quality"]])[0]))
        spread, v_n, v_spread = fix_noise(table, self._sigma, self._v_sigma, self._best)
        place = [now["lat"], now["lon"], float(height[0])]
        row = fix_row(
            float(now["t"]), place, spread[0], None if v_n is None else v_n[0], v_spread[0],
            float(now["quality"]),
        )  # fmt: skip
        if not is_possible(row):
            self.counts["no_place"] += 1
            return None
        return row


def _number(value: Any) -> float | None:
    return None if value in (None, "") else float(value)


def apart(data: bytes) -> tuple[list[tuple[bool, bytes]], bytes]:
    r"""Return the sentences of a stream of both apart from the bytes of samples.

    Parameters
    ----------
    data : bytes

    Returns
    -------
    list of (bool, bytes)
        Whether they are sentences, and the bytes, in order.
    bytes
        What may become a sentence with the bytes that follow.

    Examples
    --------
    >>> apart(b"7,0.1,0,0,0,0,0,9.8\n$GPGGA,,*00\r\n8,0.2")
    ([(False, b'7,0.1,0,0,0,0,0,9.8\n'), (True, b'$GPGGA,,*00\r\n'), (False, b'8,0.2')], b'')
    """
    out: list[tuple[bool, bytes]] = []
    at = 0
    for match in _ANY.finditer(data):
        if match.end() == len(data) and not match[0].endswith(b"\n"):
            # Its line end may be still to come.
            break
        if match.start() > at:
            out.append((False, data[at : match.start()]))
        out.append((True, match[0]))
        at = match.end()
    begun = _BEGUN.search(data, at)
    end = len(data) if begun is None else begun.start()
    if end > at:
        out.append((False, data[at:end]))
    return out, data[end:]
