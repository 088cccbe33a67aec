"""Forged and damaged packets between those of a stream: the heading stays, and the exit code.

SCHULER_FUZZ_SCALE multiplies the number of packets.
"""

from __future__ import annotations

import math
import os
import struct
import zlib

import numpy as np
import pytest

from schuler.errors import InputError
from schuler.io.packets import KINDS, PacketParser, encode_csv, encode_frame
from tests.alignment.live_tools import SENDER, Feed, frame, make_samples, make_session, right

SCALE = int(os.environ.get("SCHULER_FUZZ_SCALE", "1"))
KEY = b"0123456789abcdef"

pytestmark = pytest.mark.compiled


@pytest.fixture(scope="module")
def items():
    return make_samples()


NUMBERS = (0, 1, 64, 65, 255, 2**16, 2**31, 2**32 - 1)
WILD = (
    math.nan, math.inf, -math.inf, 0.0, -0.0, -1.0, 1e9, -1e9, 1e300, -1e300, 5e-324, 1.8e308,
    2**53,
)  # fmt: skip


def forge(rng: np.random.Generator, item) -> bytes:
    """Return a packet that is no sample of the stream, though it may be near to one.

    A forger that knows number, time and possible values at once can only be told by a key: at
    least one of the three is wrong here.
    """
    number, time, values = item

    def far() -> int:
        return int(rng.choice(NUMBERS)) if rng.random() < 0.5 else int(rng.integers(2**32))

    how = int(rng.integers(13))
    other = tuple(float(v) for v in rng.choice(WILD, 6))
    kind = KINDS[int(rng.integers(3))]
    if how == 0:
        return rng.bytes(int(rng.integers(0, 300)))
    if how == 1:
        out = bytearray(frame(item))
        for _ in range(int(rng.integers(1, 6))):
            out[int(rng.integers(len(out)))] ^= 1 << int(rng.integers(8))
        return bytes(out)
    if how == 2:
        return frame(item)[: int(rng.integers(1, 68))]
    if how == 3:
        return encode_frame(far(), float(rng.choice(WILD)), values, kind)
    if how == 4:
        return encode_frame(number, float(rng.choice(WILD)), other, "increments")
    if how == 5:
        return encode_frame(number, time, (*values[:5], float(rng.choice((1e300, math.nan, 1e9)))),
                            "increments")  # fmt: skip
    if how == 6:
        return encode_frame(number, time, values, "rates")
    if how == 7:
        return encode_csv(number, time, other)
    if how == 8:
        cells = [b"1", b"-1", b"nan", b"1e999", b"", b"x" * 50, b"\x1b[2J", b"9" * 400, b"\xff"]
        return b",".join(cells[int(k)] for k in rng.integers(len(cells), size=8)) + b"\n"
    if how == 9:
        body = struct.pack("<2sBBId6d", b"SC", int(rng.integers(256)), int(rng.integers(256)),
                           number, time, *values)  # fmt: skip
        return body + struct.pack("<I", zlib.crc32(body))
    if how == 12:
        return encode_frame(number, time + float(rng.normal(0.0, 1e3)), values, "increments")
    if how == 10:
        # Numbers and times of a sender that counts from elsewhere.
        return encode_frame(number + 10**6, time + 500.0, (0.0,) * 6, "increments")
    return encode_frame(number, time, values, "increments", key=b"of somebody else", run=number)


@pytest.mark.parametrize("address", [SENDER, None])
@pytest.mark.parametrize("seed", range(2 * SCALE))
def test_forged_packets_change_nothing(items, seed, address):
    """Up to five between two samples, and before the first; as datagrams and in a pipe."""
    rng = np.random.default_rng([20261127, seed])
    feed = Feed(make_session())
    forged = 0
    for item in items:
        for _ in range(int(rng.integers(6)) if rng.random() < 0.4 else 0):
            packet = forge(rng, item)
            forged += 1
            if address is None:
                feed.session.feed(packet + b"\n")
            else:
                known = rng.random() < 0.7
                feed.burst([packet], SENDER if known else f"203.0.113.{rng.integers(9)}:99")
        if address is None:
            feed.session.feed(frame(item))
        else:
            feed.real([item])
    assert forged > 2500
    outcome = feed.end() if address is not None else feed.session.finish()
    assert right(outcome.best.alignment)
    assert (outcome.spans, outcome.contradictions) == (1, ())
    counts = feed.session.counts()
    assert (counts["aligned"], counts["lost"]) == (len(items), 0)
    for reason in ("checksum", "malformed", "not_finite", "out_of_range", "wrong_time",
                   "wrong_number", "other_kind", "unverified"):  # fmt: skip
        assert counts[reason] > 0, reason
    assert (counts["foreign"] > 0) == (address is not None)


@pytest.mark.parametrize("seed", range(2 * SCALE))
def test_only_forged_packets_give_no_result(items, seed):
    rng = np.random.default_rng([7, seed])
    feed = Feed(make_session(key=KEY))
    for item in items[::3]:
        feed.now += 0.02
        feed.burst([forge(rng, item) for _ in range(3)])
    with pytest.raises(InputError, match=r"no sample could be used of those that came: [^\n]*$"):
        feed.end()


@pytest.mark.parametrize("seed", range(20 * SCALE))
def test_any_bytes_in_any_pieces_do_no_harm(seed):
    rng = np.random.default_rng([8, seed])
    parser = PacketParser(KEY if seed % 2 else None)
    stock = [
        frame((1, 0.5, (0.0,) * 6)), frame((1, 0.5, (0.0,) * 6), key=KEY, run=1), b"\n", b",",
        encode_csv(1, 0.5, [0.0] * 6), b"SC\x01", b"SC\x02", b"#", b"SC",
    ]  # fmt: skip
    for _ in range(300):
        piece = stock[int(rng.integers(len(stock)))]
        data = piece if rng.random() < 0.6 else piece[: int(rng.integers(1, len(piece) + 1))]
        data = data if rng.random() < 0.8 else rng.bytes(int(rng.integers(5000)))
        (parser.feed if rng.random() < 0.7 else parser.datagram)(data)
    parser.feed(bytes(200) + b"\n")
    key = {"key": KEY, "run": 1} if seed % 2 else {}
    good = frame((77, 0.5, (0.0,) * 6), **key)
    assert [p.number for p in parser.feed(good)] == [77]
