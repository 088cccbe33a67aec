"""Messages of ROS in bytes: NavSatFix, TwistStamped, TwistWithCovarianceStamped and Odometry.

A message begins with a stamp and the name of its frame; what follows are numbers of fixed width.
ROS 1 packs them and has a sequence number before the stamp; ROS 2 has the byte order of CDR first,
and puts a number of n bytes at a multiple of n, counted after the order.
"""

from __future__ import annotations

import struct

from schuler.errors import InputError

__all__ = ["NAV_SAT_FIX", "ODOMETRY", "TWISTS", "decoded", "short_type"]

NAV_SAT_FIX = "sensor_msgs/NavSatFix"
ODOMETRY = "nav_msgs/Odometry"
TWISTS = ("geometry_msgs/TwistStamped", "geometry_msgs/TwistWithCovarianceStamped")

#: what follows the header: struct codes, "s" a text
_LAYOUTS = {
    NAV_SAT_FIX: "bH" + 3 * "d" + 9 * "d" + "B",
    TWISTS[0]: 6 * "d",
    TWISTS[1]: 6 * "d" + 36 * "d",
    ODOMETRY: "s" + 7 * "d" + 36 * "d" + 6 * "d" + 36 * "d",
}
_PLAIN = (b"\0\0", b"\0\1")


def short_type(name: str) -> str:
    """Return a type's name as ROS 1 has it: ``sensor_msgs/NavSatFix``."""
    return name.replace("/msg/", "/")


def decoded(data: bytes, kind: str, ros1: bool) -> tuple[float, str, list[float]]:
    """Return the stamp (s), the frame's name, and the numbers that follow.

    Parameters
    ----------
    data : bytes
    kind : str
        One of the types above.
    ros1 : bool

    Raises
    ------
    InputError
        If the message is too short or serialised in another way.
    """
    if not ros1 and bytes(data[:2]) not in _PLAIN:
        raise InputError(
            f"a message of {kind} is serialised as {bytes(data[:2]).hex()}, where plain CDR (0000 "
            "or 0001) is understood"
        )
    order = "<" if ros1 or data[1] == 1 else ">"
    origin = 0 if ros1 else 4
    at = 4
    try:
        seconds, nanoseconds, length = struct.unpack_from(f"{order}III", data, at)
        at += 12
        frame = bytes(data[at : at + length])
        at += length
        numbers: list[float] = []
        for code in _LAYOUTS[kind]:
            if code == "s":
                at = at if ros1 else origin + -(-(at - origin) // 4) * 4
                (length,) = struct.unpack_from(f"{order}I", data, at)
                at += 4 + length
                continue
            width = struct.calcsize(code)
            at = at if ros1 else origin + -(-(at - origin) // width) * width
            numbers += struct.unpack_from(order + code, data, at)
            at += width
    except struct.error:
        raise InputError(f"a message of {len(data)} bytes is too short for {kind}") from None
    name = frame.split(b"\0")[0].decode("utf-8", "replace")
    return seconds + 1e-9 * nanoseconds, name, numbers
