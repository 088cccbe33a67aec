"""Which way a file's axes point, and how they become x right, y forward, z up (RFU).

Two spellings mean the same:

letters
    where the file's x, y and z point: ``"FRD"`` is x forward, y right, z down. One letter of each
    pair R/L, F/B, U/D.
signed axes
    what right, forward and up are in the file's axes: ``"y,x,-z"`` (or ``"+y+x-z"``) is
    right = y, forward = x, up = -z, which is FRD again.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from schuler.errors import InputError

__all__ = ["RFU", "Axes", "parse_axes"]

_LETTERS = {"R": (0, 1), "L": (0, -1), "F": (1, 1), "B": (1, -1), "U": (2, 1), "D": (2, -1)}
_OF_THE_EARTH = {
    "NED": ("FRD", "forward, y right, z down"), "ENU": ("RFU", "right, y forward, z up"),
    "NWU": ("FLU", "forward, y left, z up"), "SEU": ("BRU", "backward, y right, z up"),
}  # fmt: skip
"""Frames that are named in the place of axes: what the instrument's would be, by their likeness."""

_SIGNED = re.compile(r"\s*([+-]?)\s*([xyz])\s*,?", re.IGNORECASE)


@dataclass(frozen=True)
class Axes:
    """A signed axis permutation: body component j is ``sign[j]`` times file component ``take[j]``.

    Parameters
    ----------
    take : tuple of three int
        File axis (0 x, 1 y, 2 z) from which right, forward and up are taken.
    sign : tuple of three int
        +1 or -1.
    name : str
        The letters, as ``"FRD"``.
    """

    take: tuple[int, int, int]
    sign: tuple[int, int, int]
    name: str

    def matrix(self) -> list[list[float]]:
        """Return the matrix that turns file components into right, forward, up."""
        return [
            [float(s) if axis == k else 0.0 for axis in range(3)]
            for k, s in zip(self.take, self.sign, strict=True)
        ]


RFU = Axes((0, 1, 2), (1, 1, 1), "RFU")


def parse_axes(text: str) -> Axes:
    """Read ``"FRD"`` or ``"y,x,-z"``; the module's docstring says what they mean.

    Raises
    ------
    InputError
        If it is neither spelling, names an axis twice, or is left-handed.
    """
    plain = text.strip().upper()
    if len(plain) == 3 and set(plain) <= set(_LETTERS):
        pairs = [_LETTERS[letter] for letter in plain]
        if len({body for body, _ in pairs}) != 3:
            raise InputError(
                f"axes '{text}': each of the pairs R/L, F/B and U/D must be named once, as in FRD"
            )
        take, sign = [0, 0, 0], [1, 1, 1]
        for file_axis, (body, s) in enumerate(pairs):
            take[body], sign[body] = file_axis, s
    else:
        terms = _SIGNED.findall(text)
        whole = "".join(m.group(0) for m in _SIGNED.finditer(text))
        if len(terms) != 3 or whole.strip() != text.strip() or text.rstrip().endswith(","):
            frame = _OF_THE_EARTH.get(plain)
            if frame is not None:
                raise InputError(
                    f"axes '{text}' are those of the Earth (north, east, up); the instrument's "
                    f"own are meant: {frame[0]} if x points {frame[1]}"
                )
            raise InputError(
                f"axes '{text}' are not understood: say where the file's x, y, z point with three "
                "letters of R/L, F/B, U/D (FRD is x forward, y right, z down), or what right, "
                "forward, up are in the file's axes, as y,x,-z"
            )
        take = ["xyz".index(axis.lower()) for _, axis in terms]
        sign = [-1 if s == "-" else 1 for s, _ in terms]
        if len(set(take)) != 3:
            raise InputError(f"axes '{text}': each of x, y and z must be named once, as in y,x,-z")
    if _parity(take) * sign[0] * sign[1] * sign[2] < 0:
        raise InputError(
            f"axes '{text}' are left-handed, which no rotation can turn into right-forward-up: "
            "check the sign of one axis"
        )
    letters = [""] * 3
    for body in range(3):
        letters[take[body]] = ("RFU" if sign[body] > 0 else "LBD")[body]
    return Axes(
        (take[0], take[1], take[2]), (sign[0], sign[1], sign[2]), "".join(letters)
    )  # fmt: skip


def _parity(p: list[int]) -> int:
    return 1 if (p[0], p[1], p[2]) in ((0, 1, 2), (1, 2, 0), (2, 0, 1)) else -1
