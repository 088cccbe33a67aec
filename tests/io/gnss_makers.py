"""Files of GNSS fixes in each format, from one list of fixes, made without schuler's readers.

NMEA and UBX by the encoders of pynmeagps and pyubx2, NovAtel and ULog by `struct`, PSINS by SciPy,
bags by rosbags.
"""

from __future__ import annotations

import datetime as dt
import struct
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tests.io.makers import novatel_crc, novatel_frame, ulog_message

Array = NDArray[np.float64]

SEPARATION = 47.25
WEEK = 2391
#: Sunday of that week, seconds of the week
BEGIN = 100_000.0


def fixes(n: int = 20, rate: float = 2.0) -> dict[str, Array]:
    """Return fixes of a drive in a bend: t, lat, lon (deg), height (m), ve, vn, vu (m/s)."""
    t = np.arange(n) / rate
    course = 0.3 + 0.05 * t
    ve, vn, vu = 12.0 * np.sin(course), 12.0 * np.cos(course), np.full(n, 0.25)
    east = 12.0 / 0.05 * (np.cos(0.3) - np.cos(course))
    north = 12.0 / 0.05 * (np.sin(course) - np.sin(0.3))
    lat = 48.0 + np.degrees(north / 6_382_000.0)
    lon = -11.0 + np.degrees(east / (6_391_000.0 * np.cos(np.radians(48.0))))
    return {
        "t": t,
        "lat": lat,
        "lon": lon,
        "height": 500.0 + 0.25 * t,
        "ve": ve,
        "vn": vn,
        "vu": vu,
    }


def each(table: dict[str, Array]) -> list[dict[str, float]]:
    return [dict(zip(table, row, strict=True)) for row in zip(*table.values(), strict=True)]


def nmea(begin: float = BEGIN, sigma: bool = False, quality: int = 4) -> bytes:
    from pynmeagps import GET, NMEAMessage

    out = b""
    for f in each(fixes()):
        seconds = begin % 86400.0 + f["t"]
        when = (dt.datetime(2025, 11, 2) + dt.timedelta(seconds=seconds)).time()
        speed = float(np.hypot(f["ve"], f["vn"]))
        course = float(np.degrees(np.arctan2(f["ve"], f["vn"])) % 360.0)
        side = {"NS": "N" if f["lat"] > 0 else "S", "EW": "E" if f["lon"] > 0 else "W"}
        common = {"time": when, "lat": f["lat"], "lon": f["lon"], **side}
        out += NMEAMessage(
            "GN", "GGA", GET, **common, quality=quality, numSV=12, HDOP=0.9,
            alt=round(f["height"] - SEPARATION, 3), altUnit="M", sep=SEPARATION, sepUnit="M",
        ).serialize()  # fmt: skip
        out += NMEAMessage(
            "GN", "RMC", GET, **common, status="A", spd=round(speed * 3600 / 1852, 4),
            cog=round(course, 3), date=dt.date(2025, 11, 2), posMode="A",
        ).serialize()  # fmt: skip
        out += NMEAMessage("GN", "HDT", GET, headingT=round(course, 3), headingTu="T").serialize()
        if sigma:
            out += NMEAMessage("GN", "GST", GET, time=when, rangeRms=1.0, stdMajor=0.3,
                               stdMinor=0.2, orient=10.0, stdLat=0.3, stdLong=0.2,
                               stdAlt=0.6).serialize()  # fmt: skip
    return out


def ubx(**changes: Any) -> bytes:
    from pyubx2 import GET, UBXMessage

    out = b""
    for f in each(fixes()):
        said = {
            "iTOW": round(1e3 * (BEGIN + f["t"])), "year": 2025, "month": 11, "day": 3,
            "validDate": 1, "validTime": 1, "fixType": 3, "gnssFixOk": 1, "carrSoln": 2,
            "lat": f["lat"], "lon": f["lon"], "height": round(1e3 * f["height"]),
            "hMSL": round(1e3 * (f["height"] - SEPARATION)), "hAcc": 140, "vAcc": 210, "sAcc": 55,
            "velN": round(1e3 * f["vn"]), "velE": round(1e3 * f["ve"]),
            "velD": round(-1e3 * f["vu"]), **changes,
        }  # fmt: skip
        out += UBXMessage("NAV", "NAV-PVT", GET, **said).serialize()
    return out


def novatel_binary(kind: str = "BEST", status: int = 0, position: int = 50) -> bytes:
    out = b""
    for f in each(fixes()):
        t = BEGIN + f["t"]
        speed, course = np.hypot(f["ve"], f["vn"]), np.degrees(np.arctan2(f["ve"], f["vn"])) % 360
        sea = f["height"] - SEPARATION
        if kind == "BEST":
            body = struct.pack(
                "<II3dfI3f4s2f8B", status, position, f["lat"], f["lon"], sea, SEPARATION, 61, 0.3,
                0.2, 0.6, b"0   ", 0.0, 0.0, *[9] * 8,
            )  # fmt: skip
            out += novatel_frame(42, body, False, WEEK, t)
            body = struct.pack("<II2f3df", status, 8, 0.05, 0.0, speed, course, f["vu"], 0.0)
            out += novatel_frame(99, body, False, WEEK, t)
        elif kind == "INSPVAS":
            body = struct.pack("<Id9dI", WEEK, t, f["lat"], f["lon"], f["height"], f["vn"],
                               f["ve"], f["vu"], 0.0, 0.0, course, 3)  # fmt: skip
            out += novatel_frame(508, body, True, WEEK, t)
        else:
            body = struct.pack(
                "<II3df6d9fIH", 3, 56, f["lat"], f["lon"], sea, SEPARATION, f["vn"], f["ve"],
                f["vu"], 0.0, 0.0, course, 0.3, 0.2, 0.6, 0.03, 0.02, 0.05, 0.1, 0.1, 0.1, 3, 0,
            )  # fmt: skip
            out += novatel_frame(1465, body, False, WEEK, t)
    return out


def novatel_ascii() -> bytes:
    out = b""
    for f in each(fixes()):
        head = f"COM1,0,60.0,FINESTEERING,{WEEK},{BEGIN + f['t']:.3f},00000000,0dc5,16809"
        speed, course = np.hypot(f["ve"], f["vn"]), np.degrees(np.arctan2(f["ve"], f["vn"])) % 360
        for body in (
            f"BESTPOSA,{head};SOL_COMPUTED,NARROW_INT,{f['lat']:.11f},{f['lon']:.11f},"
            f"{f['height'] - SEPARATION:.4f},{SEPARATION:.4f},WGS84,0.3000,0.2000,0.6000,"
            '"0",0.000,0.000,12,12,12,11,00,01,00,33',
            f"BESTVELA,{head};SOL_COMPUTED,DOPPLER_VELOCITY,0.050,0.000,{speed:.4f},{course:.6f},"
            f"{f['vu']:.4f},0.0",
        ):
            out += b"#" + body.encode() + b"*%08x\r\n" % novatel_crc(body.encode())
    return out


def psins(folder: Path, columns: int = 7) -> Path:
    from scipy.io import savemat

    f = fixes()
    velocity = [f["ve"], f["vn"], f["vu"]] if columns == 7 else []
    table = np.column_stack(
        [*velocity, np.radians(f["lat"]), np.radians(f["lon"]), f["height"], BEGIN + f["t"]]
    )
    savemat(folder / "a.mat", {"gps": table})
    return folder / "a.mat"


_OLD = (
    "uint64_t timestamp;uint64_t time_utc_usec;int32_t lat;int32_t lon;int32_t alt;"
    "int32_t alt_ellipsoid;float s_variance_m_s;float eph;float epv;float vel_n_m_s;"
    "float vel_e_m_s;float vel_d_m_s;uint8_t fix_type;uint8_t satellites_used;"
)
_NEW = (
    "uint64_t timestamp;double latitude_deg;double longitude_deg;double altitude_msl_m;"
    "double altitude_ellipsoid_m;float s_variance_m_s;float eph;float epv;float vel_n_m_s;"
    "float vel_e_m_s;float vel_d_m_s;uint8_t fix_type;"
)


def ulog(new: bool = False, name: str = "vehicle_gps_position", fix: int = 6) -> bytes:
    out = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0) + ulog_message("B", bytes(40))
    out += ulog_message("F", f"{name}:{_NEW if new else _OLD}".encode())
    out += ulog_message("A", struct.pack("<BH", 0, 0) + name.encode())
    for f in each(fixes()):
        stamp, sea = round(1e6 * (20.0 + f["t"])), f["height"] - SEPARATION
        spread = 0.055, 0.2, 0.6, f["vn"], f["ve"], -f["vu"]
        if new:
            body = struct.pack("<Q4d6fB", stamp, f["lat"], f["lon"], sea, f["height"], *spread, fix)
        else:
            place = [round(1e7 * f["lat"]), round(1e7 * f["lon"])]
            body = struct.pack("<QQ4i6fBB", stamp, 0, *place, round(1e3 * sea),
                               round(1e3 * f["height"]), *spread, fix, 12)  # fmt: skip
        out += ulog_message("D", struct.pack("<H", 0) + body)
    return out


FIX, TWIST, ODOMETRY = ("sensor_msgs/msg/NavSatFix", "geometry_msgs/msg/TwistStamped",
                        "nav_msgs/msg/Odometry")  # fmt: skip


def bag(folder: Path, kind: str = "ros1", frame: str = "gps", speeds: bool = True) -> Path:
    """Write a bag with fixes, their velocity, and odometry forward, left, up."""
    from rosbags import rosbag1, rosbag2
    from rosbags.typesys import Stores, get_typestore

    ros1 = kind == "ros1"
    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
    path = folder / ("a.bag" if ros1 else "bag")
    if ros1:
        writer: Any = rosbag1.Writer(path)
    else:
        plugin = getattr(rosbag2.StoragePlugin, "MCAP" if kind == "mcap" else "SQLITE3")
        writer = rosbag2.Writer(path, version=9, storage_plugin=plugin)
    t = store.types
    pack = store.serialize_ros1 if ros1 else store.serialize_cdr

    def header(seconds: float, name: str) -> Any:
        stamp = round(1e9 * seconds)
        more = {"seq": 3} if ros1 else {}
        time = t["builtin_interfaces/msg/Time"](stamp // 10**9, stamp % 10**9)
        return t["std_msgs/msg/Header"](stamp=time, frame_id=name, **more)

    vector = t["geometry_msgs/msg/Vector3"]
    with writer:
        names = [("/fix", FIX), *([("/vel", TWIST), ("/odom", ODOMETRY)] if speeds else [])]
        lines = {n: writer.add_connection(n, k, typestore=store) for n, k in names}
        for f in each(fixes()):
            when = 1.7e9 + f["t"]
            cov = np.diag([0.04, 0.09, 0.36]).ravel()
            status = t["sensor_msgs/msg/NavSatStatus"](status=2, service=1)
            fix = t[FIX](header(when, frame), status, f["lat"], f["lon"], f["height"], cov, 2)
            writer.write(lines["/fix"], round(1e9 * when), pack(fix, FIX))
            if not speeds:
                continue
            zero = vector(0.0, 0.0, 0.0)
            twist = t["geometry_msgs/msg/Twist"](vector(f["ve"], f["vn"], f["vu"]), zero)
            message = t[TWIST](header(when + 0.005, frame), twist)
            writer.write(lines["/vel"], round(1e9 * when), pack(message, TWIST))
            point = t["geometry_msgs/msg/Point"](1.0, 2.0, 3.0)
            turn = t["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
            pose = t["geometry_msgs/msg/PoseWithCovariance"](
                t["geometry_msgs/msg/Pose"](point, turn), np.zeros(36)
            )
            body = t["geometry_msgs/msg/Twist"](vector(12.0, -0.5, 0.25), zero)
            moved = t["geometry_msgs/msg/TwistWithCovariance"](body, np.zeros(36))
            message = t[ODOMETRY](header(when, "odom"), "base_link", pose, moved)
            writer.write(lines["/odom"], round(1e9 * when), pack(message, ODOMETRY))
    return path if ros1 else next(path.glob("*.mcap" if kind == "mcap" else "*.db3"))


def csv(names: str = "time [s],lat [deg],lon [deg],height [m],ve,vn,vu") -> bytes:
    f = fixes()
    rows = np.column_stack([f["t"] + BEGIN, *(f[k] for k in ("lat", "lon", "height", "ve", "vn",
                                                             "vu"))])  # fmt: skip
    return (names + "\n" + "".join(",".join(f"{x:.10f}" for x in r) + "\n" for r in rows)).encode()


def rtklib() -> bytes:
    head = (
        "% (lat/lon/height=WGS84/ellipsoidal,Q=1:fix,2:float,3:sbas,4:dgps,5:single,6:ppp)\n"
        "%  GPST          latitude(deg) longitude(deg)  height(m)   Q  ns   sdn(m)   sde(m)   "
        "sdu(m)  sdne(m)  sdeu(m)  sdun(m) age(s)  ratio\n"
    )
    rows = "".join(
        f"{WEEK} {BEGIN + f['t']:.3f} {f['lat']:.9f} {f['lon']:.9f} {f['height']:.4f} 1 12 0.3 0.2 "
        "0.6 0 0 0 0.0 9.0\n"
        for f in each(fixes())
    )
    return (head + rows).encode()


def kfgins() -> bytes:
    return "".join(
        f"{BEGIN + f['t']:.3f} {f['lat']:.10f} {f['lon']:.10f} {f['height']:.4f} 0.3 0.2 0.6 "
        f"{f['vn']:.6f} {f['ve']:.6f} {-f['vu']:.4f} 0.1 0.1 0.1\n"
        for f in each(fixes())
    ).encode()
