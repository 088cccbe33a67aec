"""The command ``schuler live``, samples from UDP, a serial port or standard input."""

from __future__ import annotations

import json
import signal
import sys
import time as clock
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from typing import TYPE_CHECKING, Any

import click

from schuler.cli.command import CONTRADICTED, Command, echo
from schuler.cli.common import gravity_options, say_warnings, site_options, site_or_none
from schuler.cli.completion import methods, prefilters, specs
from schuler.cli.live_aids import (
    MAX_GAP,
    aid_counts,
    feed_aids,
    live_aid_options,
    live_aids_taken,
    moving_session,
    opened,
)
from schuler.cli.parameters import Count, InputFile, OutputFile, Seconds
from schuler.errors import InputError
from schuler.units import time_text

if TYPE_CHECKING:
    from schuler.alignment import Alignment
    from schuler.alignment.session import LiveSession, Outcome, SpanFix

__all__ = ["command"]

_ENOUGH = 10_000
"""Samples after which it is said why they cannot be aligned."""


@click.command("live", cls=Command)
@click.argument("source")
@site_options
@gravity_options
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
    help="As of schuler align.",
)
@click.option(
    "--prefilter",
    metavar="NAME",
    shell_complete=prefilters,
    help='Before it: one that runs on a stream, as "emd-velocity(block=100 s)".',
)
@click.option("--spec", type=InputFile(), metavar="GRADE|TOML", shell_complete=specs,
              help="The instrument.")  # fmt: skip
@click.option("--baud", type=Count(50, 10_000_000), default=115200, show_default=True,
              help="Of a serial port.")  # fmt: skip
@click.option(
    "--from",
    "sender",
    metavar="ADDRESS[:PORT]",
    help="Take UDP samples of this sender only; else the first that sends a stretch of them.",
)
@click.option(
    "--key-file",
    type=InputFile(),
    metavar="FILE",
    help="Take only frames that are authenticated (HMAC-SHA256) by the key in this file.",
)
@click.option("--depth", type=Count(4, 4096), default=64, show_default=True,
              help="Samples held while one is missing.")  # fmt: skip
@click.option("--max-gap", type=Seconds(above=0.0),
              help="Longest bridged gap (5s; in motion 0.5s).")  # fmt: skip
@click.option("--every", type=Seconds(above=0.0), default=1.0, help="Time between solutions.")
@click.option("--idle", type=Seconds(above=0.0), help="End after so long without a sample.")
@click.option("--checkpoint", type=OutputFile(), metavar="FILE",
              help="Save the state here, and resume from it.")  # fmt: skip
@click.option(
    "--cold-start",
    is_flag=True,
    help="Begin anew if the checkpoint is refused; it is kept as FILE.refused.",
)
@click.option(
    "--page",
    is_flag=False,
    flag_value="127.0.0.1:0",
    metavar="[HOST:PORT]",
    help="Serve a page that shows the alignment; its address is said on standard error. Without "
    "HOST:PORT: on loopback, at a port that the system chooses.",
)
@click.option(
    "--page-key-file",
    type=InputFile(),
    metavar="FILE",
    help="Show the page only to who has the key in this file; needed beyond loopback.",
)
@click.option("--json", "json_to", is_flag=True, help="One JSON object a line on standard output.")
@live_aid_options
def command(**options: Any) -> int:
    """Align samples as they come from SOURCE: udp:PORT, udp:HOST:PORT, serial:DEVICE or -.

    Samples are frames of 68 or 104 bytes or CSV lines (number, time, gyro x y z, accelerometer
    x y z, in SI and right-forward-up axes); lost, repeated and shuffled ones do no harm, and
    what is damaged or contradicts the stream is counted and left out. When the sender restarts
    or its clock steps, a new span begins; the longest span is the result. Port 0 lets the system
    choose one. Ctrl-C ends with the result.

    Exit code: 0 a result, 3 a result that something contradicts (said on standard error),
    2 nothing usable.

    \b
      schuler live udp:5005 --lat 34.2 --spec navigation-fog --checkpoint north.npz
      schuler live udp:5005 --lat 34.2 --page
      schuler live udp:0.0.0.0:5005 --lat 34.2 --from 192.168.0.7 --key-file imu.key
      cat /dev/ttyUSB0 | schuler live - --lat 34.2 --kind rates --json
      schuler live udp:5005 --gnss udp:5006 --imu-time utc --spec tactical-fog
    """  # noqa: D301
    from schuler.alignment.methods import parse_method
    from schuler.alignment.session import LiveSession
    from schuler.io.live_sources import check_sender
    from schuler.io.packets import read_key
    from schuler.prefilter import parse_prefilter

    aids = live_aids_taken(options)
    site = None if aids is not None else site_or_none(options)
    if site is None and aids is None:
        raise InputError("the latitude is needed to find north: say --lat (and --height)")
    if options["max_gap"] is None:
        options["max_gap"] = 5.0 if aids is None else MAX_GAP
    source, checkpoint, lines = options["source"], options["checkpoint"], options["json_to"]
    every, idle = options["every"], options["idle"]
    if options["cold_start"] and checkpoint is None:
        raise InputError("--cold-start is about a checkpoint: say --checkpoint")
    sender = None if options["sender"] is None else check_sender(options["sender"], source)
    key = None if options["key_file"] is None else read_key(options["key_file"])
    session: LiveSession
    if site is None:
        assert aids is not None
        session = moving_session(options, aids, key, sender)
    else:
        method: Any = options["method"]
        if options["prefilter"] is not None:
            method = parse_method(method).with_prefilter(parse_prefilter(options["prefilter"]))
        session = LiveSession(
            site, options["kind"], method, options["spec"], depth=options["depth"],
            max_gap=options["max_gap"], key=key, only=sender, checkpoint=checkpoint,
            cold_start=options["cold_start"],
        )  # fmt: skip
    show = _page_server(options, every)
    _say_notes(session)
    session.warm_up()
    with ExitStack() as stack:
        stream = stack.enter_context(opened(source, options["baud"], aids))
        interruptions = stack.enter_context(_interruptions())
        page = stack.enter_context(show(stream.name)) if show is not None else None
        if stream.real_time:
            echo(f"note: listening on {stream.name}", err=True)
        screen = _Screen() if sys.stdout.isatty() and not lines else None
        if screen is not None:
            stack.enter_context(screen)
        last = heard = clock.monotonic()
        said = False
        for chunk in stream.chunks:
            now = clock.monotonic()
            if chunk.second:
                feed_aids(session, chunk)
            elif chunk.data:
                before = session.packets
                arrived = now if chunk.arrived is None else chunk.arrived
                session.feed(chunk.data, chunk.address, arrived if stream.real_time else None)
                heard = now if session.packets > before else heard
            if interruptions or (idle is not None and now - heard > idle):
                break
            if now - last < every:
                continue
            last = now
            fix = None
            if session.spans:
                fix = session.solution()
                session.save()
                if lines and fix is not None:
                    _line(session, fix, [])
                if session.trouble and session.samples > _ENOUGH and not said:
                    say_warnings([f"no heading yet: {session.trouble}"])
                    said = True
            notes = _say_notes(session)
            if screen is not None:
                screen.show(None if fix is None else fix.alignment, session.summary())
            if page is not None:
                page.show(session, fix, notes, now - heard)
        try:
            outcome = session.finish(clock.monotonic() if stream.real_time else None)
        except InputError as error:
            notes = _say_notes(session)
            if page is not None:
                page.fail(session, notes, str(error))
            raise InputError(f"{stream.name}: {error}") from None
        notes = _say_notes(session)
        if page is not None:
            page.finish(session, outcome, notes)
    best = outcome.best
    contradictions = list(outcome.contradictions)
    if lines:
        _line(session, best, contradictions)
    else:
        echo(str(best.alignment))
        if outcome.spans > 1:
            start, end = (round(t, 6) + 0.0 for t in (best.alignment.start, best.alignment.end))
            echo(f"span {best.span} of {outcome.spans}, {time_text(start)} s to {time_text(end)} s")
        echo(session.summary())
        say_warnings(best.alignment.warnings)
    say_warnings(contradictions)
    return CONTRADICTED if contradictions else 0


@contextmanager
def _interruptions() -> Iterator[list[int]]:
    """Collect the first SIGINT and SIGTERM, which end the session with its result; a second stops.

    A signal that the caller of the program ignores stays ignored.
    """
    came: list[int] = []

    def note(number: int, _: Any) -> None:
        if came:
            raise KeyboardInterrupt
        came.append(number)

    kept = {}
    for number in (signal.SIGINT, signal.SIGTERM):
        handler = signal.getsignal(number)
        try:
            if handler is not signal.SIG_IGN and handler is not None:
                kept[number] = signal.signal(number, note)
        except ValueError:
            # Not in the main thread: whoever runs the command there ends it.
            break
    try:
        yield came
    finally:
        for number, handler in kept.items():
            signal.signal(number, handler)


def _say_notes(session: LiveSession) -> list[str]:
    """Say what happened since the last call, and return it."""
    notes = [" ".join(text.split()) for text in session.take_notes()]
    for text in notes:
        echo(f"note: {text}", err=True)
    return notes


def _page_server(options: dict[str, Any], every: float) -> Callable[[str], _Page] | None:
    """Return what opens the page once the source is known, its options checked already."""
    where, key_file = options["page"], options["page_key_file"]
    if where is None:
        if key_file is not None:
            raise InputError("--page-key-file is about the page: say --page")
        return None
    from schuler.io.packets import read_key
    from schuler.reports.live_server import parse_address

    key = None if key_file is None else read_key(key_file)
    address = parse_address(where, key is not None)
    return lambda name: _Page(name, every, address, key)


class _Page(AbstractContextManager["_Page"]):
    """The page in a browser, fed with the session's solutions."""

    def __init__(
        self, name: str, every: float, address: tuple[str, int], key: bytes | None
    ) -> None:
        from schuler.reports.live_page import LivePage
        from schuler.reports.live_server import LiveServer

        self._page = LivePage(name, every)
        self._server = LiveServer(self._page, address, key)
        more = "" if key is None else "?key=... (the content of the key file)"
        echo(f"note: the page is {self._server.url}{more}", err=True)

    def __exit__(self, *exc: Any) -> None:
        self._server.__exit__(*exc)

    def show(
        self, session: LiveSession, fix: SpanFix | None, notes: list[str], silent: float | None
    ) -> None:
        """Show a solution, or that there is none yet."""
        for text in notes:
            self._page.note(text)
        self._page.update(fix, session.counts(), session.spans, silent=silent,
                          trouble=session.trouble, **aid_counts(session))  # fmt: skip
        self._server.show()

    def finish(self, session: LiveSession, outcome: Outcome, notes: list[str]) -> None:
        """Show the result, which stays."""
        self.show(session, outcome.best, notes, None)
        self._page.finish(outcome.contradictions)

    def fail(self, session: LiveSession, notes: list[str], error: str) -> None:
        """Show why there is no result."""
        self.show(session, None, notes, None)
        self._page.finish(error=error)


def _line(session: LiveSession, fix: SpanFix, contradictions: list[str]) -> None:
    """Print a solution as one line of JSON."""
    data = {
        **fix.alignment.to_dict(), "schema": "schuler.live/1", "counts": session.counts(),
        "span": fix.span, "spans": session.spans,
        "contradictions": [*fix.alignment.contradictions, *contradictions],
        **aid_counts(session),
    }  # fmt: skip
    echo(json.dumps(data, allow_nan=False))
    sys.stdout.flush()


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

    def show(self, fix: Alignment | None, counts: str) -> None:
        """Draw the state of affairs."""
        from rich.panel import Panel
        from rich.text import Text

        text = Text()
        if fix is None:
            text.append("waiting for enough samples\n", style="dim")
        else:
            if fix.contradictions:
                text.append(f"INCONSISTENT: {'; '.join(fix.contradictions)}\n", style="bold red")
            self._way = [*self._way[-59:], fix.heading_deg]
            text.append(f"heading {fix.heading_deg:9.4f} deg ± {fix.sigma_arcmin[2]:.3g}'\n",
                        style="bold")  # fmt: skip
            text.append(
                f"pitch {fix.pitch_deg:.4f} deg   roll {fix.roll_deg:.4f} deg   "
                f"{fix.duration:.1f} s\n"
            )
            text.append(_bars(self._way) + "\n", style="blue")
        text.append(counts, style="dim")
        self._live.update(Panel(text, title="schuler live"))


def _bars(values: list[float]) -> str:
    """Return the last values as a line of blocks, about the last one."""
    off = [(v - values[-1] + 180.0) % 360.0 - 180.0 for v in values]
    low, high = min(off), max(off)
    if high - low < 1e-9:
        return "▄" * len(off)
    return "".join("▁▂▃▄▅▆▇█"[int(7.999 * (v - low) / (high - low))] for v in off)
