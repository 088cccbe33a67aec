"""The readers of GNSS fixes by name, and which of them a file needs."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from schuler.errors import InputError
from schuler.io.gnss.table import GnssReader

__all__ = ["aid_reader", "gnss_readers", "head_of"]

_HEAD = 1 << 16


@cache
def gnss_readers() -> dict[str, GnssReader]:
    """Return the readers by name, in the order in which they are asked."""
    from schuler.io.gnss.nmea import NmeaReader
    from schuler.io.gnss.novatel import NovatelFixReader
    from schuler.io.gnss.psins import PsinsFixReader
    from schuler.io.gnss.ros import RosFixReader
    from schuler.io.gnss.text import KfGinsFixReader, NamedFixReader, RtklibReader
    from schuler.io.gnss.ubx import UbxReader
    from schuler.io.gnss.ulog import UlogFixReader

    # Marks at the very beginning first, then messages anywhere, then texts.
    kinds = (UlogFixReader, RosFixReader, PsinsFixReader, NovatelFixReader, UbxReader, NmeaReader,
             RtklibReader, NamedFixReader, KfGinsFixReader)  # fmt: skip
    return {kind.name: kind() for kind in kinds}


def head_of(path: Path) -> bytes:
    """Return the beginning of a file, or of the list of a ROS 2 bag's folder."""
    if path.is_dir():
        path = path / "metadata.yaml"
        if not path.is_file():
            raise InputError("is a folder without a ROS 2 bag")
    with path.open("rb") as file:
        return file.read(_HEAD)


def aid_reader(path: Path, head: bytes | None = None) -> GnssReader | None:
    """Return the reader of a file of fixes by its content; None where none knows it."""
    head = head_of(path) if head is None else head
    return next((reader for reader in gnss_readers().values() if reader.sniff(head)), None)
