"""Trajectories as tracks for maps: GPX and KML.

Both need longitudes within 180 degrees, and programs draw a line from one point to the next: a
track is cut where it crosses the date line. Their times are UTC, which a trajectory does not know:
a track has them where the Unix time of the trajectory's zero is given. Heights are above the
ellipsoid, and the files say so.
"""

from __future__ import annotations

from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from html import escape
from itertools import pairwise
from typing import Any

import numpy as np

from schuler.constants import DEG
from schuler.errors import InputError, installed
from schuler.trajectory import Trajectory

__all__ = ["gpx_library", "gpx_text", "kml_text"]

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_TEXT = "Heights are in metres above the WGS-84 ellipsoid, not above the sea."

_KML = """<?xml version="1.0" encoding="UTF-8"?>
<kml xmlns="http://www.opengis.net/kml/2.2">
<Document>
<name>{name}</name>
<description>{text}</description>
<Placemark>
<name>{name}</name>
<Style><LineStyle><color>ffb27200</color><width>3</width></LineStyle></Style>
<MultiGeometry>
{lines}</MultiGeometry>
</Placemark>
</Document>
</kml>
"""


def _parts(trajectory: Trajectory) -> Iterator[slice]:
    """Give the rows between two crossings of the date line."""
    cuts = np.flatnonzero(np.abs(np.diff(trajectory.lon)) > np.pi) + 1
    edges = [0, *cuts.tolist(), len(trajectory)]
    for begin, end in pairwise(edges):
        yield slice(begin, end)


def _points(trajectory: Trajectory, part: slice) -> list[list[float]]:
    """Return latitude, longitude (deg) and height (m) of some rows."""
    columns = trajectory.lat[part] / DEG, trajectory.lon[part] / DEG, trajectory.height[part]
    rows: list[list[float]] = np.column_stack(columns).tolist()
    return rows


def gpx_library() -> Any:
    """Return gpxpy's module of GPX's elements.

    Raises
    ------
    InputError
        If it is not installed.
    """
    with installed("GPX needs gpxpy", "gpx", InputError):
        from gpxpy import gpx
    return gpx


def gpx_text(trajectory: Trajectory, utc: float | None = None) -> str:
    """Return a trajectory as GPX 1.1: one track, a segment to each side of the date line.

    Parameters
    ----------
    trajectory : Trajectory
    utc : float, optional
        Unix time at which the trajectory's time is zero, s.
    """
    gpx = gpx_library()
    document = gpx.GPX()
    document.creator, document.description = "schuler", _TEXT
    track = gpx.GPXTrack(name=trajectory.name)
    for part in _parts(trajectory):
        stamps = [None] * len(trajectory.time[part]) if utc is None else [
            _EPOCH + timedelta(seconds=t) for t in (utc + trajectory.time[part]).tolist()
        ]  # fmt: skip
        points = [
            gpx.GPXTrackPoint(*row, time=stamp)
            for row, stamp in zip(_points(trajectory, part), stamps, strict=True)
        ]
        track.segments.append(gpx.GPXTrackSegment(points))
    document.tracks.append(track)
    return str(document.to_xml(version="1.1"))


def kml_text(trajectory: Trajectory) -> str:
    """Return a trajectory as KML 2.2: lines on the ground.

    KML's heights are above the sea, so a line at heights above the ellipsoid would lie beside the
    road; the heights are in the coordinates all the same.
    """
    lines = []
    for part in _parts(trajectory):
        points = "\n".join(
            f"{lon:.9f},{lat:.9f},{height:.4f}" for lat, lon, height in _points(trajectory, part)
        )
        lines.append(
            "<LineString><tessellate>1</tessellate><altitudeMode>clampToGround</altitudeMode>"
            f"<coordinates>\n{points}\n</coordinates></LineString>\n"
        )
    return _KML.format(name=escape(trajectory.name, quote=False), text=_TEXT, lines="".join(lines))
