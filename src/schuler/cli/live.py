"""The command ``schuler live``, samples from UDP, a serial port or standard input."""

from __future__ import annotations

import json
import sys
import time as clock
from collections.abc import Iterator
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from schuler.cli.command import Command, echo
from schuler.cli.common import say_warnings, site_options, site_or_none
from schuler.cli.completion import methods, specs
from schuler.cli.parameters import Count, InputFile, OutputFile, Seconds
from schuler.errors import InputError, SchulerError

if TYPE_CHECKING:
    from schuler.align import Alignment, LiveAligner

__all__ = ["command"]

_STEP = 0.1
"""Longest wait for data before the screen is looked after, s."""


@click.command("live", cls=Command)
@click.argument("source")
@site_options
@click.option(
    "--kind",
    type=click.Choice(["rates", "mean-rates", "increments"]),
    default="increments",
    show_default=True,
    help="What the values of CSV lines are; binary frames say it themselves.",
)
@click.option(
    "--method",
    metavar="NAME",
    shell_complete=methods,
    help="As of schuler align; not the Kalman filters.",
)
@click.option(
    "--spec", type=InputFile(), metavar="GRADE|TOML", shell_complete=specs, help="The instrument."
)
@click.option(
    "--baud",
    type=Count(50, 10_000_000),
    default=115200,
    show_default=True,
    help="Of a serial port.",
)
@click.option(
    "--depth",
    type=Count(4, 65_536),
    default=64,
    show_default=True,
    help="Samples held while one is missing.",
)
@click.option("--max-gap", type=Seconds(0.0), default=5.0, help="Longest gap that is bridged.")
@click.option("--every", type=Seconds(above=0.0), default=1.0, help="Time between solutions.")
@click.option("--idle", type=Seconds(0.0), help="End after so long without data.")
@click.option(
    "--checkpoint",
    type=OutputFile(),
    metavar="FILE",
    help="Save the state here, and go on from it.",
)
@click.option("--json", "json_to", is_flag=True, help="One JSON object a line on standard output.")
def command(**options: Any) -> None:
    """Align samples as they come from SOURCE: udp:PORT, udp:HOST:PORT, serial:DEVICE or -.

    Samples are frames of 68 bytes or CSV lines (number, time, gyro x y z, accelerometer x y z, in
    SI and right-forward-up axes); lost, repeated and shuffled ones do no harm. Ctrl-C ends with
    the result.

    \b
      schuler live udp:5005 --lat 34.2 --spec navigation-fog --checkpoint north.npz
      cat /dev/ttyUSB0 | schuler live - --lat 34.2 --kind rates --json
    """  # noqa: D301
    from schuler.align import LiveAligner
    from schuler.io.packets import PacketParser

    site = site_or_none(options)
    if site is None:
        raise InputError("the latitude is needed to find north: say --lat (and --height)")
    checkpoint, every, idle = options["checkpoint"], options["every"], options["idle"]

    def make(kind: str) -> LiveAligner:
        made = LiveAligner(
            site, kind, options["method"], options["spec"], depth=options["depth"],
            max_gap=options["max_gap"],
        )  # fmt: skip
        if checkpoint is not None and Path(checkpoint).exists():
            made.load(checkpoint)
        return made

    aligner: LiveAligner | None = None
    parser = PacketParser()
    last, fix = clock.monotonic(), None
    screen = _Screen() if sys.stdout.isatty() and not options["json_to"] else None
    with screen or nullcontext(), _open(options["source"], options["baud"]) as stream:
        try:
            for data in _until_idle(stream, idle):
                samples = parser.feed(data)
                if samples:
                    if aligner is None:
                        aligner = make(parser.kind or options["kind"])
                    aligner.push(samples)
                now = clock.monotonic()
                if aligner is None or now - last < every:
                    continue
                last = now
                fix = _solve(aligner, fix)
                _show(aligner, parser.damaged, fix, screen, options["json_to"])
                if checkpoint is not None:
                    aligner.save(checkpoint)
        except KeyboardInterrupt:
            # The way to end: the result so far is wanted.
            pass
    if aligner is None:
        raise InputError(f"{options['source']}: no sample came")
    # What is held is not aligned yet: a restart takes it from here.
    if checkpoint is not None:
        aligner.save(checkpoint)
    aligner.finish()
    fix = aligner.solution()
    if options["json_to"]:
        _show(aligner, parser.damaged, fix, None, True)
    else:
        echo(str(fix))
        counts = {**aligner.counts(), "damaged": parser.damaged}
        echo(", ".join(f"{value} {name}" for name, value in counts.items()))
        say_warnings(fix.warnings)


def _solve(aligner: LiveAligner, before: Alignment | None) -> Alignment | None:
    try:
        return aligner.solution()
    except InputError:
        # Too few samples yet, or (for seconds only) no attitude in them.
        if aligner.samples > 10_000:
            raise
        return before


def _show(
    aligner: LiveAligner, damaged: int, fix: Alignment | None, screen: _Screen | None, lines: bool
) -> None:
    counts = {**aligner.counts(), "damaged": damaged}
    if lines:
        if fix is not None:
            data = {**fix.to_dict(), "schema": "schuler.live/1", "counts": counts}
            click.echo(json.dumps(data, allow_nan=False))
            sys.stdout.flush()
    elif screen is not None:
        screen.show(fix, counts)


class _Screen(AbstractContextManager["_Screen"]):
    """Heading, sigma and their way there, redrawn in place."""

    def __init__(self) -> None:
        from rich.live import Live

        self._live = Live(refresh_per_second=4, transient=True)
        self._way: list[float] = []

    def __enter__(self) -> _Screen:
        self._live.__enter__()
        return self

    def __exit__(self, *exc: Any) -> None:
        self._live.__exit__(*exc)

    def show(self, fix: Alignment | None, counts: dict[str, int]) -> None:
        """Draw the state of affairs."""
        from rich.panel import Panel
        from rich.text import Text

        text = Text()
        if fix is None:
            text.append("waiting for enough samples\n", style="dim")
        else:
            self._way = [*self._way[-59:], fix.heading_deg]
            text.append(f"heading {fix.heading_deg:9.4f} deg ± {fix.sigma_arcmin[2]:.3g}'\n",
                        style="bold")  # fmt: skip
            text.append(
                f"pitch {fix.pitch_deg:.4f} deg   roll {fix.roll_deg:.4f} deg   "
                f"{fix.duration:.1f} s\n"
            )
            text.append(_bars(self._way) + "\n", style="blue")
        text.append(", ".join(f"{value} {name}" for name, value in counts.items()), style="dim")
        self._live.update(Panel(text, title="schuler live"))


def _bars(values: list[float]) -> str:
    """Return the last values as a line of blocks, about the last one."""
    off = [(v - values[-1] + 180.0) % 360.0 - 180.0 for v in values]
    low, high = min(off), max(off)
    if high - low < 1e-9:
        return "▄" * len(off)
    return "".join("▁▂▃▄▅▆▇█"[int(7.999 * (v - low) / (high - low))] for v in off)


def _until_idle(stream: Iterator[bytes], idle: float | None) -> Iterator[bytes]:
    """Pass data on, and nothing at times; end after `idle` seconds without data."""
    last = clock.monotonic()
    for data in stream:
        now = clock.monotonic()
        if data:
            last = now
        elif idle is not None and now - last > idle:
            return
        yield data


class _Stream(AbstractContextManager[Iterator[bytes]]):
    def __init__(self, chunks: Iterator[bytes], close: Any) -> None:
        self._chunks, self._close = chunks, close

    def __enter__(self) -> Iterator[bytes]:
        return self._chunks

    def __exit__(self, *_: Any) -> None:
        self._close()


def _open(source: str, baud: int) -> AbstractContextManager[Iterator[bytes]]:
    if source == "-":
        return _Stream(_piped(), lambda: None)
    kind, _, rest = source.partition(":")
    if kind == "udp" and rest:
        return _udp(rest)
    if kind == "serial" and rest:
        return _serial(rest, baud)
    raise InputError(
        f"'{source}': a live source is udp:PORT, udp:HOST:PORT, serial:DEVICE or - (standard input)"
    )


def _piped() -> Iterator[bytes]:
    from schuler.io.flow import readable

    file = sys.stdin.buffer
    while True:
        if not readable(file, _STEP):
            yield b""
            continue
        data = file.read1(65536)  # type: ignore[union-attr]
        if not data:
            return
        yield data


def _udp(where: str) -> _Stream:
    import socket

    host, _, text = where.rpartition(":")
    try:
        port = int(text)
    except ValueError:
        port = -1
    if not 0 < port < 65536:
        raise InputError(f"udp:{where}: expected a port from 1 to 65535, got '{text}'")
    receiver = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    receiver.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4 << 20)
    receiver.settimeout(_STEP)
    try:
        receiver.bind((host or "127.0.0.1", port))
    except OSError as error:
        receiver.close()
        raise InputError(f"udp:{where}: cannot listen there ({error.strerror or error})") from None

    def chunks() -> Iterator[bytes]:
        while True:
            try:
                yield receiver.recv(65536)
            except TimeoutError:
                yield b""

    return _Stream(chunks(), receiver.close)


def _serial(device: str, baud: int) -> _Stream:
    try:
        import serial
    except ImportError:
        raise SchulerError(
            "a serial port needs pyserial, which is not installed: pip install 'schuler[live]'"
        ) from None
    try:
        port = serial.Serial(device, baud, timeout=_STEP)
    except (OSError, ValueError) as error:
        raise InputError(f"serial:{device}: cannot be opened ({error})") from None

    def chunks() -> Iterator[bytes]:
        while True:
            try:
                yield port.read(max(1, port.in_waiting))
            except OSError:
                # The port is gone: what came is what there is.
                return

    return _Stream(chunks(), port.close)
