"""What the options of aids say, for every command that takes aids."""

from __future__ import annotations

from typing import Any

import click

from schuler.cli.parameters import InputFile
from schuler.cli.path_output import triple
from schuler.errors import InputError, near

__all__ = [
    "BESIDE",
    "beside_options",
    "estimates_of",
    "gnss_height_option",
    "gnss_sigma_option",
    "lever_of",
    "read_beside",
    "sigmas_of",
]

_ESTIMATES = ("delay", "lever", "mount", "scale")


def lever_of(text: str | None, option: str) -> tuple[float, float, float]:
    """Return three numbers with commas; nothing is a lever arm of nothing."""
    return (0.0, 0.0, 0.0) if text is None else triple(text, option)


def gnss_sigma_option(otherwise: str) -> Any:
    """Return ``--gnss-sigma``, which counts where what is read does not say it itself."""
    return click.option(
        "--gnss-sigma", metavar="M,M/S",
        help=f"1-sigma of position and velocity, where {otherwise} (3,0.1).",
    )  # fmt: skip


def gnss_height_option(otherwise: str) -> Any:
    """Return ``--gnss-height``, which counts where what is read does not say it itself."""
    return click.option(
        "--gnss-height", type=click.Choice(["ellipsoid", "geoid"]),
        help=f"What heights are above, where {otherwise}.",
    )  # fmt: skip


def sigmas_of(text: str | None) -> tuple[float | None, float | None]:
    """Return 1-sigma of position and velocity, m and m/s."""
    if text is None:
        return None, None
    try:
        position, speed = (float(cell.strip().rstrip("m/s")) for cell in text.split(","))
    except ValueError:
        raise InputError(f"--gnss-sigma: expected two numbers as 3,0.1, got '{text}'") from None
    if not (position > 0.0 and speed > 0.0):
        raise InputError(f"--gnss-sigma: both must be positive, got '{text}'")
    return position, speed


def estimates_of(text: str | None) -> set[str]:
    """Return which of delay, lever, mount and scale are estimated."""
    wanted = {part.strip() for part in text.split(",")} if text else set()
    unknown = wanted - set(_ESTIMATES)
    if unknown:
        name = min(unknown)
        raise InputError(
            f"--estimate: '{name}'{near(name, _ESTIMATES)} is none of {', '.join(_ESTIMATES)}"
        )
    return wanted


BESIDE = ("height_file", "height_offset", "heading_file", "baseline")
"""Options of heights and headings beside fixes or speeds."""


def beside_options() -> list[Any]:
    """Return the options of heights and headings beside fixes or speeds."""
    return [
        click.option(
            "--height-file", type=InputFile(), metavar="FILE",
            help="Barometer or depth: time, and height, depth or pressure.",
        ),
        click.option(
            "--height-offset", metavar="M,S",
            help="1-sigma and correlation time of the offset of --height-file (100,3600).",
        ),
        click.option(
            "--heading-file", type=InputFile(), metavar="FILE",
            help="Two antennas or compass: time, heading; or NMEA with HDT.",
        ),
        click.option(
            "--baseline", metavar="X,Y,Z", help="Of --heading-file, body axes (0,1,0: forward)."
        ),
    ]  # fmt: skip


def _pair(text: str, option: str) -> tuple[float, float]:
    try:
        first, second = (float(cell) for cell in text.split(","))
    except ValueError:
        raise InputError(f"{option}: expected two numbers as 100,3600, got '{text}'") from None
    return first, second


def read_beside(aids: dict[str, Any], offsets: dict[str, float]) -> list[Any]:
    """Return the heights and headings that are given.

    Parameters
    ----------
    aids : dict
        With the options `BESIDE`.
    offsets : dict of str to float
        What is added to the times of "height" and "heading", s.

    Raises
    ------
    InputError
        For an option without its file, or a file that cannot be read.
    """
    from schuler.io import read_heading, read_height

    for option, file in (("baseline", "heading_file"), ("height_offset", "height_file")):
        if aids[option] is not None and aids[file] is None:
            raise InputError(
                f"--{option.replace('_', '-')} goes with --{file.replace('_', '-')}: give one"
            )
    out: list[Any] = []
    if aids["height_file"] is not None:
        sigma, time = _pair(aids["height_offset"] or "100,3600", "--height-offset")
        out.append(
            read_height(aids["height_file"], offset_sigma=sigma, offset_time=time,
                        offset=offsets.get("height", 0.0))
        )  # fmt: skip
    if aids["heading_file"] is not None:
        baseline = lever_of(aids["baseline"] or "0,1,0", "--baseline")
        out.append(
            read_heading(aids["heading_file"], baseline=baseline,
                         offset=offsets.get("heading", 0.0))
        )  # fmt: skip
    return out
