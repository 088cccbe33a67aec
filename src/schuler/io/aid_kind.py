"""Whether a file holds an aid and no record of an IMU, told by its content."""

from __future__ import annotations

import gzip
import zlib
from pathlib import Path

from schuler.errors import InputError
from schuler.io.aid_files import local_file
from schuler.io.gnss import aid_reader
from schuler.io.gnss.registry import head_of
from schuler.io.named_table import column_names, first_names
from schuler.io.spool import GZIP, is_pipe

__all__ = ["AID_KINDS", "aid_kind"]

AID_KINDS = ("fixes", "speeds", "body-velocities", "headings", "heights")
"""What a file may hold beside the samples of an IMU."""

_TIMES = {"t", "time", "timestamp", "seconds", "gpst", "sow", "tow"}
#: kind -> names of which a table of it has one, or all of a tuple
_MARKS: dict[str, tuple[str | tuple[str, ...], ...]] = {
    "body-velocities": (("vx", "vy", "vz"), ("dvlx", "dvly", "dvlz")),
    "speeds": (
        "speed",
        "odometer",
        "wheelspeed",
        "canspeed",
        "forwardspeed",
        "pulses",
        "pulsecount",
        "odometerdistance",
        ("rl", "rr"),
        ("wheelspeedrl", "wheelspeedrr"),
        ("wheelrl", "wheelrr"),
    ),
    "headings": ("heading", "hdt", "azimuth", "compass", "trueheading"),
    "heights": ("height", "altitude", "alt", "depth", "pressure", "baroheight", "baroaltitude"),
}
_ATTITUDE = {"pitch", "roll", "yaw", "qw"}
_OF_A_RECORD = ("g", "w", "gyr", "gx", "wx", "acc", "ax", "angular", "linear", "omega", "f")


def aid_kind(path: str | Path) -> str | None:
    """Return which of `AID_KINDS` a file holds; None for a record, or what is not known here.

    Parameters
    ----------
    path : str or Path
        A pipe is never looked at: what is taken from it is gone.

    Examples
    --------
    >>> aid_kind("gnss.csv"), aid_kind("imu.csv")
    ('fixes', None)
    """
    path = Path(path)
    if str(path) == "-" or is_pipe(path):
        return None
    try:
        packed = _packed_head(path)
        if packed is not None and aid_reader(path, packed) is None and _text_kind(packed) is None:
            # Not unpacked for nothing.
            return None
        with local_file(path) as there:
            head = head_of(there)
            reader = aid_reader(there, head)
            if reader is not None and reader.name != "table":
                return "fixes" if reader.alone(there) else None
            names = column_names(there) if head.startswith(b"PAR1") else first_names(head)
            if reader is not None and reader.alone(there):
                return "fixes"
            return _named(set(names))
    except (InputError, OSError):
        # What is damaged is said by whoever reads it.
        return None


def _packed_head(path: Path) -> bytes | None:
    """Return the beginning of what is in a gzip file; None of any other."""
    if not path.is_file():
        return None
    with path.open("rb") as file:
        if file.read(2) != GZIP:
            return None
    try:
        with gzip.open(path, "rb") as file:
            return file.read(1 << 16)
    except (OSError, EOFError, zlib.error):
        return b""


def _text_kind(head: bytes) -> str | None:
    return _named(set(first_names(head)))


def _named(names: set[str]) -> str | None:
    """Return the kind of a table by the names of its columns."""
    if not names & _TIMES or names & {"lat", "latitude", *_ATTITUDE}:
        return None
    axes = {stem + axis for stem in _OF_A_RECORD for axis in "xyz"}
    if names & axes or any(name.startswith(("gyr", "acc", "imu")) for name in names):
        return None
    for kind, marks in _MARKS.items():
        for mark in marks:
            if names >= ({mark} if isinstance(mark, str) else set(mark)):
                return kind
    return None
