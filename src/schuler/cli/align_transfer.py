"""Transfer alignment of ``schuler align``: its options, and its run."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from schuler.cli.aid_options import lever_of
from schuler.cli.align_moving import read_whole, say_alignment
from schuler.cli.common import gravity_known, open_file
from schuler.cli.parameters import InputFile, Number, Seconds
from schuler.errors import InputError

if TYPE_CHECKING:
    from schuler.alignment.transfer import Flexure, MasterNoise

__all__ = ["align_by_master", "transfer_options", "transfer_taken"]

_OWN = ("match", "mounting", "mounting_sigma", "master_sigma", "flexure", "then_free")
_SHARED = ("lever", "delay", "vibration")
_OTHERS = ("gnss", "odometer", "dvl", "dvl_frame", "dvl_lever", "gnss_sigma", "estimate", "zupt")


def transfer_options(function: Any) -> Any:
    """Add the options of a transfer alignment to a command."""
    options = [
        click.option(
            "--master", type=InputFile(), metavar="FILE",
            help="Align by a master on the same vehicle: t, lat, lon, height, ve, vn, vu, heading, "
            "pitch, roll.",
        ),
        click.option(
            "--match", metavar="MODE",
            help="With --master: of velocity, attitude, position, rate, with + "
            "(velocity+attitude).",
        ),
        click.option(
            "--mounting", metavar="auto|Y,P,R",
            help="Of the slave on the master: yaw clockwise, pitch, roll, deg.",
        ),
        click.option(
            "--mounting-sigma", type=Number(0.0, 90.0, unit="deg"), metavar="DEG",
            help="Of that: it is then estimated (0).",
        ),
        click.option(
            "--master-sigma", metavar="MRAD,M/S[,M]",
            help="1-sigma of the master's attitude, velocity and position (0.2,0.02,0.5).",
        ),
        click.option(
            "--flexure", metavar="MRAD[,S]",
            help="Of the structure between both: 1-sigma, and correlation time (0.5 s).",
        ),
        click.option(
            "--then-free", type=Seconds(above=0.0), metavar="TIME",
            help="Navigate on alone for so long, and compare with the master.",
        ),
    ]  # fmt: skip
    for option in reversed(options):
        function = option(function)
    return function


def transfer_taken(options: dict[str, Any]) -> dict[str, Any] | None:
    """Return the options of a transfer alignment, taken out of the command's; None without one.

    Raises
    ------
    InputError
        If one of them is given without a master, or beside another aid.
    """
    out = {key: options.pop(key) for key in ("master", *_OWN)}
    given = [key for key in _OWN if out[key] is not None]
    if out["master"] is None:
        if given:
            raise InputError(f"--{given[0].replace('_', '-')} goes with --master: give one")
        return None
    others = [key for key in _OTHERS if options[key] is not None]
    if others:
        raise InputError(
            f"--{others[0].replace('_', '-')} is of an alignment by other aids: leave it out "
            "beside --master"
        )
    out |= {key: options.pop(key) for key in _SHARED}
    for key in _OTHERS:
        options.pop(key)
    return out


def align_by_master(
    options: dict[str, Any], asked: dict[str, Any], spec: str | None, at: str,
    span: tuple[Any, Any], outputs: tuple[str | None, str | None], calibration_from: str | None,
    finished: Any,
) -> int:  # fmt: skip
    """Align a slave by its master and say what came of it; return the exit code.

    Parameters
    ----------
    options : dict
        Of the file.
    asked : dict
        As of `transfer_taken`.
    spec, at, span, outputs, calibration_from, finished
        As in `schuler.cli.align_moving.align_in_motion`.
    """
    from schuler.alignment.transfer import transfer
    from schuler.constants import DEG
    from schuler.io import read_trajectory
    from schuler.io.span import parse_record_time
    from schuler.sensors import load_spec

    gravity_known(options)
    place = [options.pop(key) for key in ("lat", "lon", "height")]
    if any(each is not None for each in place):
        raise InputError("the place is the master's: leave out --lat, --lon and --height")
    if asked["mounting_sigma"] is not None and asked["mounting"] in (None, "auto"):
        raise InputError("--mounting-sigma is that of a mounting: say --mounting Y,P,R")
    if asked["then_free"] is not None and at == "start":
        raise InputError("--then-free goes on from the end: leave out --at start")
    mounting, noise, bends = (
        _mounting(asked["mounting"]), _noise(asked["master_sigma"]), _flexure(asked["flexure"]),
    )  # fmt: skip
    lever = asked["lever"]
    master = read_trajectory(asked["master"])
    source, finish = open_file(options, None, load_spec(spec))
    stop = None if asked["then_free"] is not None else span[1]
    record = read_whole(source, stop, calibration_from)
    ends = []
    for value, label in zip(span, ("start", "stop"), strict=True):
        seconds, relative = (
            (None, False) if value is None else parse_record_time(value, label)
        )  # fmt: skip
        ends.append(None if seconds is None else seconds + (record.start if relative else 0.0))
    sigma = asked["mounting_sigma"]
    fix = transfer(
        record, master, match=asked["match"] or "velocity+attitude", span=(ends[0], ends[1]),
        spec=spec, mounting=mounting, mounting_sigma=None if sigma is None else sigma * DEG,
        lever=None if lever in (None, "auto") else lever_of(lever, "--lever"),
        delay=None if asked["delay"] in (None, "auto") else asked["delay"], noise=noise,
        flexure=bends, vibration=asked["vibration"], at=at, then_free=asked["then_free"],
    )  # fmt: skip
    return say_alignment(finished(fix, source, spec, calibration_from), outputs, finish)


def _mounting(text: str | None) -> Any:
    """Return the quaternion from the slave's body to the master's; None where it is to be found."""
    from schuler.attitude import euler_to_quat, heading_to_psi
    from schuler.constants import DEG

    if text in (None, "auto"):
        return None
    yaw, pitch, roll = (DEG * each for each in lever_of(text, "--mounting"))
    return euler_to_quat([float(heading_to_psi(yaw)), pitch, roll])


def _numbers(text: str, option: str, least: int, most: int, example: str) -> list[float]:
    try:
        out = [float(cell) for cell in text.split(",")]
    except ValueError:
        out = []
    if not least <= len(out) <= most or not all(0.0 < value < float("inf") for value in out):
        raise InputError(
            f"{option}: expected {least} to {most} positive numbers with commas, as {example}, "
            f"got '{text}'"
        )
    return out


def _noise(text: str | None) -> MasterNoise | None:
    from schuler.alignment.transfer import MasterNoise

    if text is None:
        return None
    attitude, velocity, *rest = _numbers(text, "--master-sigma", 2, 3, "0.2,0.02")
    return MasterNoise(1e-3 * attitude, velocity, *rest)


def _flexure(text: str | None) -> Flexure | None:
    from schuler.alignment.transfer import Flexure

    if text is None:
        return None
    sigma, *rest = _numbers(text, "--flexure", 1, 2, "1,0.5")
    return Flexure(1e-3 * sigma, rest[0] if rest else 0.5)
