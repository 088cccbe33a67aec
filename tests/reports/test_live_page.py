"""The page of a live alignment: its state, its events, who may look, and what a browser draws."""

from __future__ import annotations

import json
import math
import re
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import replace
from http.client import HTTPConnection, HTTPResponse
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from schuler.alignment import Alignment, LiveSession, align
from schuler.alignment.session import SpanFix
from schuler.attitude import euler_to_quat
from schuler.earth import Site
from schuler.errors import InputError
from schuler.io.packets import encode_frame
from schuler.reports import live_server
from schuler.reports.live_page import POINTS, LivePage, _degrees, page_html
from schuler.reports.live_server import LiveServer, allowed_host, parse_address, right_key

from .test_browser import FLAGS, chromium  # noqa: F401
from .test_report import SITE, record

KEY = b"a key of 24 bytes & \xe9 +/%"


@pytest.fixture(scope="module")
def fix() -> Alignment:
    return align(record(60.0, 20.0), SITE, spec="navigation-fog")


def data_of(event: bytes) -> dict[str, Any]:
    """Return the state in one server-sent event."""
    kind, data, *rest = event.decode().split("\n")
    assert (kind, rest) == ("event: state", ["", ""])
    found: dict[str, Any] = json.loads(data.removeprefix("data: "))
    return found


# -- the state ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("value", "text"), [(-1e-9, "0.0000°"), (-0.00006, "-0.0001°"), (1.25, "1.2500°")]
)
def test_a_level_that_is_rounded_to_nothing_has_no_sign(value: float, text: str) -> None:
    assert _degrees(value, 0.5) == text


def test_a_solution_is_shown_with_its_sigma_and_what_was_lost(fix: Alignment) -> None:
    page = LivePage("udp:127.0.0.1:5005")
    counts = {"aligned": 90, "lost": 0, "repeated": 0, "damaged": 3, "checksum": 3, "foreign": 7}
    page.update(SpanFix(fix, 1), counts, 1, silent=0.25)
    state = data_of(page.event())
    assert state["phase"] == "aligning"
    assert float(state["heading"]["value"].rstrip("°")) == pytest.approx(fix.heading_deg, abs=0.1)
    assert state["heading"]["sigma"] == f"± {fix.heading_sigma_arcmin:.2g}′"
    assert [0, "lost on the way"] in state["counts"]
    assert [3, "with a wrong checksum"] in state["counts"]
    assert [7, "of another source"] in state["counts"]
    # Three damaged packets are three, and not six.
    assert sum(n for n, _ in state["counts"]) == 100
    assert fix.limit_arcmin is not None
    assert state["points"] == [
        [fix.duration, fix.heading_deg, fix.heading_sigma_arcmin, fix.limit_arcmin[2]]
    ]


def test_a_heading_that_rounds_to_a_full_turn_is_north(fix: Alignment) -> None:
    north = replace(fix, quat_nb=euler_to_quat([np.radians(1e-4), 0.0, 0.0]))
    assert north.heading_deg == pytest.approx(359.9999)
    page = LivePage("-")
    page.update(SpanFix(north, 1), {}, 1)
    assert re.fullmatch(r"0\.0+°", page.state["heading"]["value"])


def test_a_window_that_moves_on_still_converges_over_time(fix: Alignment) -> None:
    """Of a stream in motion the part that is used has one length from some time on."""
    page = LivePage("-")
    for k in range(5):
        moved = replace(fix, start=100.0 + 10.0 * k, end=400.0 + 10.0 * k)
        page.update(SpanFix(moved, 1), {}, 1, aid_counts={"aid_checksum": k, "late": 0})
    assert [p[0] for p in page.state["points"]] == [300.0, 310.0, 320.0, 330.0, 340.0]
    assert page.state["fixes"] == [[4, "sentences with a wrong checksum"]]


def test_contradictions_stay_and_those_of_the_end_are_added_once(fix: Alignment) -> None:
    page = LivePage("-")
    page.update(SpanFix(fix.contradicted(["too fast"]), 1), {"aligned": 9}, 1)
    page.finish(["too fast", "span 2 is apart"])
    state = data_of(page.event())
    assert state["contradictions"] == ["too fast", "span 2 is apart"]
    assert state["phase"] == "ended"
    assert "has ended" in state["end"]
    # What contradicts leaves no heading.
    assert state["heading"]["value"] == "no heading"


def test_a_waiting_and_a_failed_stream_say_why() -> None:
    page = LivePage("-")
    page.update(None, {"aligned": 0}, 1, trouble="too short")
    assert data_of(page.event())["why"] == "too short"
    page.finish(error="no sample came")
    state = data_of(page.event())
    assert (state["phase"], state["heading"]) == ("failed", None)
    assert state["end"].endswith("no sample came.")


def test_what_is_not_finite_is_null_in_the_event(fix: Alignment) -> None:
    page = LivePage("-")
    wide = replace(fix, covariance=np.diag([math.inf] * 3), bound=None, spec=None)
    page.update(SpanFix(wide, 1), {}, 1)
    state = data_of(page.event())
    assert state["points"][0][3] is None
    assert ["give --spec", "heading: sigma / its lower bound"] in state["facts"]


def test_the_convergence_is_bounded_evenly_spaced_and_has_the_newest(fix: Alignment) -> None:
    page = LivePage("-")
    for k in range(1, 3001):
        page.update(SpanFix(replace(fix, start=0.0, end=float(k)), 1), {}, 1)
        times = [p[0] for p in page.state["points"]]
        assert len(times) <= POINTS
        assert (times[0], times[-1]) == (1.0, float(k))
    assert len(set(np.diff(times)[:-1])) == 1
    assert 0.0 < times[-1] - times[-2] <= times[1] - times[0]
    # Another span begins anew.
    page.update(SpanFix(replace(fix, start=0.0, end=5.0), 2), {}, 2)
    assert [p[0] for p in page.state["points"]] == [5.0]


def test_no_more_notes_than_a_screen_holds() -> None:
    page = LivePage("-")
    for k in range(20):
        page.note(f"note {k}")
    assert page.state["notes"] == [f"note {k}" for k in range(15, 20)]


# -- who may look -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("query", "header", "right"),
    [
        ("", None, False), ("key=", None, False), ("key=wrong", None, False),
        ("key=a+key+of+24+bytes+%26+%E9+%2B%2F%25", None, True),
        ("other=1&key=a%20key%20of%2024%20bytes%20%26%20%e9%20%2B%2F%25", None, True),
        ("", "Bearer a key of 24 bytes & \xe9 +/%", True),
        ("", "bearer a key of 24 bytes & \xe9 +/%", True),
        ("", "Basic a key of 24 bytes & \xe9 +/%", False),
        ("key=wrong", "Bearer a key of 24 bytes & \xe9 +/", False),
        ("&".join(["key=a"] * 9), None, False),
    ],
)  # fmt: skip
def test_only_the_key_opens(query: str, header: str | None, right: bool) -> None:
    assert right_key(KEY, query, header) is right
    assert right_key(None, query, header)


@pytest.mark.parametrize(
    ("host", "near", "far"),
    [
        ("127.0.0.1:8700", True, True), ("localhost:8700", True, True), ("[::1]:8700", True, True),
        ("LOCALHOST", True, True), ("127.0.0.1", True, True), ("192.168.0.5:8700", False, True),
        ("evil.example", False, False), ("127.0.0.1.evil.example:8700", False, False),
        ("evil.example@127.0.0.1:x", True, True), ("127.0.0.1@evil.example", False, False),
        ("", False, False), (None, False, False), ("[::1", False, False),
    ],
)  # fmt: skip
def test_a_name_that_others_answer_for_is_refused(host: str | None, near: bool, far: bool) -> None:
    assert allowed_host(host, loopback=True) is near
    assert allowed_host(host, loopback=False) is far


@pytest.mark.parametrize(
    ("text", "keyed", "found"),
    [
        ("127.0.0.1:0", False, ("127.0.0.1", 0)), (":8700", False, ("127.0.0.1", 8700)),
        ("8700", False, ("127.0.0.1", 8700)), ("localhost:1", False, ("127.0.0.1", 1)),
        ("[::1]:9", False, ("::1", 9)), ("0.0.0.0:8700", True, ("0.0.0.0", 8700)),
    ],
)  # fmt: skip
def test_addresses(text: str, keyed: bool, found: tuple[str, int]) -> None:
    assert parse_address(text, keyed) == found


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("0.0.0.0:8700", "--page-key-file"), ("192.168.0.5:8700", "--page-key-file"),
        ("[::]:8700", "--page-key-file"), ("udp:5005x", "expected HOST:PORT"),
        ("udp:5005", "no IP address"), ("127.0.0.1:65536", "65535"), ("127.0.0.1:", "65535"),
        ("example.org:80", "no IP address"), ("127.0.0.1:²", "65535"),
    ],
)  # fmt: skip
def test_addresses_that_are_refused(text: str, told: str) -> None:
    with pytest.raises(InputError, match=re.escape(told)):
        parse_address(text, keyed=False)


# -- the server ---------------------------------------------------------------------------


@pytest.fixture
def served() -> Iterator[tuple[LivePage, LiveServer]]:
    page = LivePage("-")
    with LiveServer(page, ("127.0.0.1", 0)) as server:
        yield page, server


@pytest.fixture
def ask() -> Iterator[Callable[..., HTTPResponse]]:
    """Return a function that gives the answer to a request, its body unread."""
    with ExitStack() as stack:

        def ask(server: LiveServer, path: str, **headers: str) -> HTTPResponse:
            connection = HTTPConnection("127.0.0.1", server.port, timeout=30)
            stack.callback(connection.close)
            connection.request("GET", path, headers=headers)
            return stack.enter_context(connection.getresponse())

        yield ask


def next_event(answer: HTTPResponse) -> dict[str, Any]:
    lines = [answer.readline() for _ in range(3)]
    return data_of(b"".join(lines))


def test_the_page_has_its_policy_and_nothing_from_elsewhere(
    ask: Callable[..., HTTPResponse],
    served: tuple[LivePage, LiveServer],
) -> None:
    answer = ask(served[1], "/")
    text = answer.read().decode()
    assert answer.status == 200
    assert "default-src 'none'" in (answer.getheader("Content-Security-Policy") or "")
    assert answer.getheader("Access-Control-Allow-Origin") is None
    assert "{{" not in text
    assert not re.search(r'(?:src|href)="(?!data:)', text)
    assert not re.search(r"https?://(?!www\.w3\.org/2000/svg)", text)
    assert "innerHTML" not in text
    assert ask(served[1], "/etc").status == 404


def test_a_foreign_host_and_a_missing_key_get_403(
    ask: Callable[..., HTTPResponse],
) -> None:
    with LiveServer(LivePage("-"), ("127.0.0.1", 0), KEY) as server:
        for path in ("/", "/events", "/else"):
            assert ask(server, path).status == 403
            assert ask(server, f"{path}?key=wrong").status == 403
            right = f"{path}?key=a+key+of+24+bytes+%26+%E9+%2B%2F%25"
            assert ask(server, right, Host="evil.example").status == 403
        assert ask(server, "/?key=a+key+of+24+bytes+%26+%E9+%2B%2F%25").status == 200
        assert b"schuler live" not in ask(server, "/").read()


def test_events_come_as_they_are_shown_and_the_last_one_at_the_end(
    ask: Callable[..., HTTPResponse], fix: Alignment
) -> None:
    page = LivePage("-")
    with LiveServer(page, ("127.0.0.1", 0)) as server:
        answer = ask(server, "/events")
        assert answer.getheader("Content-Type") == "text/event-stream"
        assert next_event(answer)["phase"] == "waiting"
        page.update(SpanFix(fix, 1), {"aligned": fix.samples}, 1)
        server.show()
        assert next_event(answer)["phase"] == "aligning"
        # Who comes late is sent the whole state.
        late = ask(server, "/events")
        assert len(next_event(late)["points"]) == 1
        page.finish()
    for each in (answer, late):
        assert next_event(each)["phase"] == "ended"
        assert each.read() == b""


def test_too_many_browsers_are_refused(
    ask: Callable[..., HTTPResponse],
    served: tuple[LivePage, LiveServer],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(live_server, "_WATCHERS", 2)
    held = [ask(served[1], "/events") for _ in range(2)]
    assert [next_event(each)["phase"] for each in held] == ["waiting"] * 2
    assert ask(served[1], "/events").status == 503


def test_a_port_that_is_taken_is_said(served: tuple[LivePage, LiveServer]) -> None:
    with pytest.raises(InputError, match="cannot listen there"):
        LiveServer(LivePage("-"), ("127.0.0.1", served[1].port))


# -- how it looks -------------------------------------------------------------------------


def luminance(colour: str) -> float:
    """Return the relative luminance of ``#rrggbb`` as WCAG 2 defines it."""
    channels = [int(colour[k : k + 2], 16) / 255.0 for k in (1, 3, 5)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]
    return float(np.dot([0.2126, 0.7152, 0.0722], linear))


def contrast(one: str, other: str) -> float:
    a, b = sorted((luminance(one), luminance(other)))
    return (b + 0.05) / (a + 0.05)


def test_text_can_be_read_in_sunlight() -> None:
    assert contrast("#000000", "#ffffff") == pytest.approx(21.0)
    style = files("schuler.reports").joinpath("live.css").read_text(encoding="utf-8")
    blocks = re.findall(r":root \{(.*?)\}", style, re.DOTALL)
    assert len(blocks) == 2
    for block in blocks:
        colour = dict(re.findall(r"--([\w-]+): (#[0-9a-f]{6})", block))
        for ink in ("ink", "soft", "accent", "other"):
            assert contrast(colour[ink], colour["paper"]) >= 7.0, (ink, block)
        for ink in ("ink", "soft"):
            assert contrast(colour[ink], colour["card"]) >= 7.0, (ink, block)
        assert contrast(colour["bad-ink"], colour["bad"]) >= 7.0
        assert contrast(colour["warn-ink"], colour["warn"]) >= 7.0


def test_the_policy_is_that_of_the_script_in_the_page() -> None:
    html, policy = page_html()
    assert html.count("<script>") == html.count("<style>") == 1
    assert policy.count("sha256-") == 2


@pytest.mark.browser
@pytest.mark.slow
def test_a_browser_draws_each_solution_and_keeps_the_last(
    chromium: str,  # noqa: F811
    tmp_path: Path,
) -> None:
    """A sender plays while the browser looks: it draws on the way, and keeps what came last."""
    made = record(60.0, 20.0)
    values = np.hstack([made.dtheta, made.dvel])
    frames = [encode_frame(k, float(t), v, "increments")
              for k, (t, v) in enumerate(zip(made.time, values, strict=True))]  # fmt: skip
    session, page = LiveSession(Site(SITE.lat), spec="navigation-fog"), LivePage("udp:a <b>")
    with LiveServer(page, ("127.0.0.1", 0)) as server:
        browser = subprocess.Popen(
            [chromium, *FLAGS, f"--user-data-dir={tmp_path}", "--window-size=360,900",
             "--enable-logging=stderr", "--v=0", "--dump-dom", server.url],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        deadline = time.monotonic() + 120.0
        while not server.watchers and browser.poll() is None and time.monotonic() < deadline:
            time.sleep(0.02)
        for part in range(12):
            for frame in frames[part * 100 : (part + 1) * 100]:
                session.feed(frame[:50] if frame is frames[700] else frame)
            page.update(session.solution(), session.counts(), session.spans, silent=0.0)
            server.show()
            time.sleep(0.02)
        outcome = session.finish()
        page.update(outcome.best, session.counts(), session.spans)
        page.finish(["span 2 is <apart>"])
    dom, log = browser.communicate(timeout=180)
    assert [line for line in log.splitlines() if "CONSOLE" in line] == []
    root = re.search(r"<html[^>]*>", dom)
    assert root is not None
    assert 'data-phase="ended"' in root[0]
    updates = re.search(r'data-updates="(\d+)"', root[0])
    assert updates is not None
    assert int(updates[1]) >= 3
    fix = outcome.best.alignment
    heading = re.search(r'id="value">([\d.]+)°', dom)
    assert heading is not None
    assert float(heading[1]) == pytest.approx(fix.heading_deg, abs=0.06)
    assert "The stream has ended: this is the result." in dom
    assert "span 2 is &lt;apart&gt;" in dom
    assert "udp:a &lt;b&gt;" in dom
    assert dom.index("span 2 is") < dom.index('id="value"')
    for name in ("band", "line", "other"):
        drawn = re.search(rf'<path class="{name}" d="M([^"]+)"', dom)
        assert drawn is not None, name
        assert "NaN" not in drawn[1]
        assert len(drawn[1].split("L")) >= 3
    assert "lost on the way" in dom
