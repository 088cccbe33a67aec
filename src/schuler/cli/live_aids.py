"""What ``schuler live`` takes beside the samples of a vehicle that moves: options and session."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from schuler.cli.aid_options import (
    estimates_of,
    gnss_height_option,
    gnss_sigma_option,
    lever_of,
    sigmas_of,
)
from schuler.cli.parameters import Count, Number, Seconds
from schuler.errors import InputError

if TYPE_CHECKING:
    from schuler.alignment.moving.live import MovingLiveSession
    from schuler.alignment.session import LiveSession
    from schuler.io.live_sources import Chunk, LiveSource

__all__ = [
    "MAX_GAP",
    "aid_counts",
    "feed_aids",
    "live_aid_options",
    "live_aids_taken",
    "mixed",
    "moving_session",
    "opened",
]

_KEYS = (
    "gnss_from", "gnss_baud", "imu_time", "leap_seconds", "arrival_error", "latency", "keep",
    "lever", "delay", "estimate", "gnss_sigma", "gnss_height", "vibration",
)  # fmt: skip

MAX_GAP = 0.5
"""Longest gap that is bridged in motion, s: the motion in a longer one is not measured."""

_AT_REST = ("lat", "lon", "height", "gravity", "method", "prefilter")


def live_aid_options(function: Any) -> Any:
    """Add the options of a live alignment in motion to a command."""
    options = [
        click.option(
            "--gnss", metavar="SOURCE",
            help="Align in motion by NMEA of udp:PORT, serial:DEVICE or -; SOURCE itself if mixed.",
        ),
        click.option(
            "--gnss-from", metavar="ADDRESS[:PORT]", help="Take NMEA of this sender only."
        ),
        click.option("--gnss-baud", type=Count(50, 10_000_000), help="Of its port (9600)."),
        click.option(
            "--imu-time", type=click.Choice(["utc", "gps", "arrival"]),
            help="What the samples' times are; a fix has UTC. Needed with --gnss.",
        ),
        click.option(
            "--leap-seconds", type=Number(0.0, 60.0),
            help="With --imu-time gps: GPS time less UTC (18 since 2017).",
        ),
        click.option(
            "--arrival-error", type=Seconds(above=0.0),
            help="With --imu-time arrival: 1-sigma of how long a fix takes to come.",
        ),
        click.option("--latency", type=Seconds(0.0), help="How late a fix may come (1s)."),
        click.option(
            "--keep", type=Seconds(above=0.0),
            help="Samples over which passes run back and forth (300s).",
        ),
        click.option("--lever", metavar="X,Y,Z", help="From IMU to antenna, m (body axes)."),
        click.option(
            "--delay", type=Number(-10.0, 10.0, unit="s"),
            help="A fix stamped t is valid at t - S.",
        ),
        click.option("--estimate", metavar="LIST", help="Of delay, lever, with commas."),
        gnss_sigma_option("no sentence has it"),
        gnss_height_option("a sentence has no height of the geoid"),
        click.option(
            "--vibration", type=Number(0.0, 10.0), metavar="M/S/SQRT(S)",
            help="Least velocity random walk on the vehicle (as the samples show it).",
        ),
    ]  # fmt: skip
    for option in reversed(options):
        function = option(function)
    return function


def feed_aids(session: LiveSession, chunk: Chunk) -> None:
    """Give bytes of NMEA to a session."""
    from schuler.alignment.moving.live import MovingLiveSession

    assert isinstance(session, MovingLiveSession)
    session.feed_aid(chunk.data, chunk.address, chunk.arrived)


def aid_counts(session: LiveSession) -> dict[str, Any]:
    """Return what JSON says of the fixes that came; nothing of an alignment at rest."""
    from schuler.alignment.moving.live import MovingLiveSession

    if not isinstance(session, MovingLiveSession):
        return {}
    return {"aid_counts": session.aid_counts()}


def live_aids_taken(options: dict[str, Any]) -> dict[str, Any] | None:
    """Return the options of a live alignment in motion, taken out of the command's; None at rest.

    Raises
    ------
    InputError
        If one of them is given without a source of fixes, or one of an alignment at rest with it.
    """
    out = {key: options.pop(key) for key in _KEYS}
    out["gnss"] = options.pop("gnss")
    if out["gnss"] is None:
        given = [key for key in _KEYS if out[key] is not None]
        if given:
            raise InputError(
                f"--{given[0].replace('_', '-')} is for a live alignment in motion: say --gnss"
            )
        return None
    rest = [key for key in _AT_REST if options.get(key) is not None]
    if rest:
        raise InputError(
            f"--{rest[0]} is of an alignment at rest: the fixes of --gnss say where the vehicle "
            "is; leave it out"
        )
    if out["imu_time"] is None:
        raise InputError(
            "fixes have UTC of the day: say what the samples' times are, --imu-time utc (of the "
            "day or since 1970), --imu-time gps --leap-seconds 18, or --imu-time arrival "
            "--arrival-error 50ms"
        )
    return out


def mixed(source: str, gnss: str) -> bool:
    """Say whether samples and fixes come from one source; of port 0 each has its own."""
    return source == gnss and not source.endswith(":0")


def opened(source: str, baud: int, aids: dict[str, Any] | None) -> LiveSource:
    """Return the source of samples, and of fixes where they have one of their own.

    Raises
    ------
    InputError
        If one of them is no source, or cannot be opened.
    """
    from schuler.io.live_sources import in_threads, open_live_source

    stream = open_live_source(source, baud)
    if aids is None:
        return stream
    if mixed(source, aids["gnss"]):
        return in_threads(stream)
    try:
        other = open_live_source(aids["gnss"], aids["gnss_baud"] or 9600)
    except InputError:
        stream.close()
        raise
    return in_threads(stream, other)


def moving_session(
    options: dict[str, Any], aids: dict[str, Any], key: bytes | None, sender: str | None
) -> MovingLiveSession:
    """Return the session of a live alignment in motion.

    Parameters
    ----------
    options, aids : dict
        Of the command, and as of `live_aids_taken`.
    key : bytes or None
    sender : str or None

    Raises
    ------
    InputError
        For options that contradict each other.
    """
    from schuler.aiding.fix_rows import FixSetting
    from schuler.aiding.stream_clock import StreamClock
    from schuler.alignment.moving.live import LiveAids, MovingLiveSession
    from schuler.alignment.moving.stream_setting import StreamSetting
    from schuler.io.live_sources import check_sender

    wanted = estimates_of(aids["estimate"])
    if wanted - {"delay", "lever"}:
        raise InputError("--estimate takes delay and lever, of --gnss")
    only = None
    if aids["gnss_from"] is not None:
        only = check_sender(aids["gnss_from"], aids["gnss"], "--gnss-from")
    sigma, v_sigma = sigmas_of(aids["gnss_sigma"])
    antenna = FixSetting(
        lever_of(aids["lever"], "--lever"), aids["delay"] or 0.0, tuple(sorted(wanted))
    )
    given = {name: aids[name] for name in ("latency", "keep") if aids[name] is not None}
    setting = StreamSetting(options["spec"], antenna, vibration=aids["vibration"], **given)
    clock = StreamClock(aids["imu_time"], aids["leap_seconds"], aids["arrival_error"])
    live = LiveAids(
        clock, setting, sigma, v_sigma, aids["gnss_height"],
        mixed=mixed(options["source"], aids["gnss"]), only=only,
    )  # fmt: skip
    return MovingLiveSession(
        live, options["kind"], depth=options["depth"], max_gap=options["max_gap"], key=key,
        only=sender, checkpoint=options["checkpoint"], cold_start=options["cold_start"],
    )  # fmt: skip
