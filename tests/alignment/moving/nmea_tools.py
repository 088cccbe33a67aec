"""NMEA of simulated fixes, and frames of a simulated drive, as live senders send them."""

from __future__ import annotations

import numpy as np

from schuler.aiding import GnssFixes
from schuler.constants import DEG
from schuler.io.packets import encode_frame

UTC_DAY = 1_700_006_400.0
"""A midnight in UTC, s since 1970."""

_KNOT = 1852.0 / 3600.0


def sentence(body: str) -> bytes:
    """Return a sentence with its checksum and line end."""
    total = 0
    for byte in body.encode():
        total ^= byte
    return f"${body}*{total:02X}\r\n".encode()


def _clock(time: float) -> str:
    # Hundredths of a second, rounded once, so that 59.999 is no 60.00.
    whole = round(100.0 * (time % 86400.0))
    return f"{whole // 360000:02d}{whole // 6000 % 60:02d}{whole % 6000 / 100.0:05.2f}"


def _angle(value: float, digits: int, marks: str) -> str:
    size = abs(value) / DEG
    degrees = int(size)
    minutes = f"{60.0 * (size - degrees):011.8f}"
    return f"{degrees:0{digits}d}{minutes},{marks[int(value < 0.0)]}"


def gga(time: float, lat: float, lon: float, height: float, quality: int = 1) -> bytes:
    """Return the position of an instant; its height is above the ellipsoid 40 m below the geoid."""
    return sentence(
        f"GPGGA,{_clock(time)},{_angle(lat, 2, 'NS')},{_angle(lon, 3, 'EW')},{quality},10,0.9,"
        f"{height - 40.0:.4f},M,40.0,M,,"
    )


def rmc(time: float, lat: float, lon: float, v_n) -> bytes:
    """Return speed and course of an instant."""
    speed = float(np.hypot(v_n[0], v_n[1])) / _KNOT
    course = float(np.arctan2(v_n[0], v_n[1])) / DEG % 360.0
    return sentence(
        f"GPRMC,{_clock(time)},A,{_angle(lat, 2, 'NS')},{_angle(lon, 3, 'EW')},{speed:.5f},"
        f"{course:.5f},141123,,,A"
    )


def sentences(gnss: GnssFixes, shift: float = 0.0) -> list[tuple[float, bytes]]:
    """Return the instants of fixes, and the sentences of each, times in UTC of the day."""
    v_n = np.asarray(gnss.v_n)
    rows = zip(
        np.asarray(gnss.time), np.asarray(gnss.lat), np.asarray(gnss.lon), np.asarray(gnss.height),
        v_n, strict=True,
    )  # fmt: skip
    return [
        (float(t), gga(t + shift, lat, lon, h) + rmc(t + shift, lat, lon, v))
        for t, lat, lon, h, v in rows
    ]


def frames(record, shift: float = 0.0, **options) -> list[tuple[float, bytes]]:
    """Return the ends of samples, and the frame of each."""
    rows = zip(record.time, record.dtheta, record.dvel, strict=True)
    return [
        (float(t), encode_frame(k, float(t) + shift, [*w, *f], "increments", **options))
        for k, (t, w, f) in enumerate(rows)
    ]


def in_turn(samples, fixes, late: float = 0.2) -> list[tuple[bool, bytes]]:
    """Return both in the order in which they arrive: fixes some time after their samples."""
    every = [(t, False, data) for t, data in samples] + [(t + late, True, d) for t, d in fixes]
    return [(second, data) for _, second, data in sorted(every, key=lambda each: each[:2])]
