"""The command ``schuler info``, which looks at a record."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from schuler.cli.command import echo, wants_text
from schuler.cli.common import (
    emit_json,
    file_options,
    json_option,
    open_file,
    progress,
    report_option,
    say_warnings,
    site_options,
    site_or_none,
)
from schuler.cli.many import ManyCommand
from schuler.errors import InputError

if TYPE_CHECKING:
    from schuler.io import Source
    from schuler.record import Summary

__all__ = ["command"]

_OF_A_RECORD = (
    "columns", "gyro", "accel", "axes", "rate", "array", "format", "imu_type", "mapping",
    "save_mapping", "start", "stop", "lat", "accel_file", "accel_topic", "variables",
)  # fmt: skip
"""Options that say what only a record of an IMU has."""


@click.command("info", cls=ManyCommand)
@file_options
@site_options
@click.option(
    "--kind",
    type=click.Choice(["record", "fixes", "speeds", "body-velocities", "headings", "heights"]),
    help="What FILE holds; else its content decides.",
)
@json_option("Write the summary as JSON (- : here); of several records a .jsonl.", ".jsonl")
@report_option("With several records: draw them beside one another.")
def command(**options: Any) -> None:
    """Summarise FILE: rate, jitter, gravity, Earth rate, noise, quiet and disturbed stretches.

    Units and axes that look wrong are said, with what would fit. Of GNSS fixes it says rate, gaps,
    quality, what heights are above, and how positions agree with velocities.

    \b
      schuler info truck.csv --gyro deg/s --accel g --axes FRD --lat 48.1
      schuler info car.pos
      schuler info records/ --lat 48.1 --report records.html
    """  # noqa: D301
    from schuler.io import aid_kind
    from schuler.record import Summariser

    json_to, kind = options.pop("json_to"), options.pop("kind")
    if options.pop("report_to") is not None:
        raise InputError("the report of info is of several records: name more, or a folder")
    if kind is None and not any(options[key] for key in _OF_A_RECORD):
        kind = aid_kind(options["file"])
    if kind not in (None, "record"):
        from schuler.cli.info_aid import aid_info

        given = [key for key in _OF_A_RECORD if options[key]]
        if given:
            raise InputError(f"--{given[0].replace('_', '-')} is for a record of an IMU")
        aid_info(options["file"], kind, options["topic"], json_to)
        return
    start, stop = options.pop("start"), options.pop("stop")
    source, finish = open_file(options)
    site = site_or_none(options, source)
    summariser = Summariser()
    with progress(source, source.chunks(start=start, stop=stop)) as chunks:
        for chunk in chunks:
            summariser.push(chunk)
    summary = summariser.summary()
    quality = source.quality
    warnings = list(quality.warnings()) if quality else []
    warnings += [*_moving(summary), *summary.hints(site, reading=source.reading)]
    warnings += source.contradictions
    if json_to is not None:
        data = {
            **summary.to_dict(site),
            "file": str(source.path),
            "format": source.format,
            "read_as": source.meaning,
            "assumed": list(source.assumed),
            "notes": list(source.notes),
            "contradictions": list(source.contradictions),
            "jitter_rms_s": quality.jitter_rms if quality else 0.0,
            "gaps": quality.gaps if quality else 0,
            "longest_gap_s": quality.longest_gap if quality else 0.0,
            "dropped_rows": quality.not_finite + quality.repeated if quality else 0,
            "warnings": warnings,
        }
        emit_json(data, json_to)
    if wants_text():
        _print(source, summary, site)
    finish(notes=False)
    say_warnings(warnings)


def _moving(summary: Summary) -> list[str]:
    """Say that a unit which moves all the time is no unit at rest."""
    if not summary.turned:
        return []
    return [
        "the unit turns or accelerates all the time: it is at rest nowhere, so gravity and the "
        "Earth's rate say little of its units and nothing of its axes"
    ]


def _print(source: Source, summary: Summary, site: Any) -> None:
    from schuler.constants import STANDARD_GRAVITY
    from schuler.units import time_text

    def _short(seconds: float) -> str:
        return f"{seconds:.6g}" if abs(seconds) < 1e6 else time_text(seconds)

    d: Any = summary.to_dict(site)
    q = source.quality
    time, noise = d["time"], d["noise"]
    gravity = "local gravity" if site is not None else "standard gravity"
    value = site.gravity if site is not None else STANDARD_GRAVITY
    rows = [
        ("file", f"{source.path} ({source.format})"),
        ("read as", source.meaning),
        *(("note", note) for note in source.notes),
        ("samples", f"{time['samples']}, {time_text(time['start'])} to {time_text(time['end'])} s "
                    f"({time['duration_s']:.6g} s)"),
        ("rate", f"{time['rate_hz']:.6g} Hz, jitter {1e3 * (q.jitter_rms if q else 0):.3g} ms rms"),
        ("mean |f|", f"{d['mean_force_norm_m_s2']:.6f} m/s^2 "
                     f"({1e6 * (d['mean_force_norm_m_s2'] / value - 1):+.0f} ppm of {gravity})"),
        ("|mean f|", f"{d['norm_of_mean_force_m_s2']:.6f} m/s^2 "
                     f"({1e6 * (d['norm_of_mean_force_m_s2'] / value - 1):+.0f} ppm)"),
        ("|mean w|", f"{d['mean_rate_norm_deg_h']:.4f} deg/h (the Earth turns at 15.0411)"),
        ("mean f", "  ".join(f"{v:+.5f}" for v in d["mean_force_m_s2"]) + " m/s^2 (x, y, z)"),
        ("mean w", "  ".join(f"{v:+.4f}" for v in d["mean_rate_deg_h"]) + " deg/h (x, y, z)"),
        ("noise", f"gyro {noise['gyro_deg_sqrt_h']:.3g} deg/sqrt(h), accelerometer "
                  f"{noise['accelerometer_ug_sqrt_hz']:.3g} ug/sqrt(Hz) (sample to sample, "
                  "rounding included)"),
        ("quiet", f"{d['quiet_s']:.6g} s of {time['duration_s']:.6g} s"),
        *(
            ("disturbed", f"{_short(s['start'])} to {_short(s['end'])} s")
            for s in d["stretches"] if s["disturbed"]
        ),
    ]  # fmt: skip
    seen = ""
    for name, text in rows:
        echo(f"{name if name != seen else '':>10}  {text}")
        seen = name
