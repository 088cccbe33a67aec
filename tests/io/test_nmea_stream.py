"""NMEA as it comes: whole fixes at once, damaged sentences counted, any chunking."""

from __future__ import annotations

import numpy as np
import pytest

from schuler.aiding.fix_rows import is_possible
from schuler.errors import InputError
from schuler.io.gnss.nmea_stream import NmeaStream, apart
from tests.alignment.moving.nmea_tools import gga, rmc, sentence

PLACE = (0.7, 0.2, 100.0)
V = (3.0, 4.0, 0.0)


def both(t):
    return gga(t, *PLACE) + rmc(t, *PLACE[:2], V)


def test_a_fix_has_what_its_sentences_say():
    stream = NmeaStream()
    assert stream.feed(both(10.0)) == []
    (row,) = stream.feed(gga(11.25, *PLACE))
    np.testing.assert_allclose(row[:4], [10.0, *PLACE], rtol=0.0, atol=1e-7)
    np.testing.assert_allclose(row[7:9], V[:2], atol=1e-5)
    np.testing.assert_allclose(row[4:7], 3.0)
    assert row[13] == 5.0
    np.testing.assert_allclose(row[10:12], 0.1)


def test_sigma_is_that_of_the_best_quality_that_came():
    """Fixed, single and fixed again: a single fix has fifty times the sigma of a fixed one."""
    stream = NmeaStream(sigma=0.02)
    rows = [row for k, q in enumerate((1, 4, 1, 4)) for row in stream.feed(gga(k, *PLACE, q))]
    rows += stream.finish()
    assert [round(float(row[4]), 6) for row in rows] == [0.02, 0.02, 1.0, 0.02]


def test_the_second_is_given_as_soon_as_it_is_whole():
    stream = NmeaStream()
    stream.feed(both(10.0))
    assert len(stream.feed(gga(11.0, *PLACE))) == 1
    (row,) = stream.feed(rmc(11.0, *PLACE[:2], V))
    assert row[0] == 11.0
    assert stream.feed(both(12.0))[0][0] == 12.0
    assert stream.finish() == []


def test_a_sentence_that_is_lost_is_waited_for():
    """RMC is lost once: the fix has no velocity, and the next has one again."""
    stream = NmeaStream()
    stream.feed(both(10.0))
    stream.feed(both(11.0))
    assert stream.feed(gga(12.0, *PLACE)) == []
    first, second = stream.feed(both(13.0))
    assert np.all(np.isnan(first[7:10]))
    assert second[0] == 13.0
    assert np.all(np.isfinite(second[7:10]))


def test_any_chunking_gives_the_same_fixes():
    text = b"".join(both(t) for t in np.arange(10.0, 20.0, 0.5)) + b"$GPGSV,1,1,00*79\r\nnoise\n"
    rows = [np.array(NmeaStream().feed(text))]
    for size in (1, 7, 100):
        stream = NmeaStream()
        rows.append(np.array([
            row for k in range(0, len(text), size) for row in stream.feed(text[k : k + size])
        ]))  # fmt: skip
        assert stream.counts.total() == 0
    for other in rows[1:]:
        np.testing.assert_array_equal(other, rows[0])


def test_what_is_damaged_is_counted_by_reason():
    stream = NmeaStream()
    whole = gga(10.0, *PLACE)
    stream.datagram(whole.replace(b"10,0.9", b"10,0.8"))
    stream.datagram(whole[:30])
    stream.datagram(sentence("GPGGA,120000.00,,,,,0,,,,,,,").strip())
    stream.datagram(sentence("GPGGA,120001.00,4000.0,N,1000.0,E,1,10,0.9,100.0,M,,M,,").strip())
    stream.datagram(sentence("GPRMC,,,,,,,,,,,,N").strip())
    stream.feed(b"x" * 3000)
    stream.finish()
    assert dict(stream.counts) == {
        "aid_checksum": 2, "no_fix": 1, "no_height": 1, "aid_malformed": 1,
    }  # fmt: skip


def test_a_height_without_the_geoid_s_is_taken_where_it_is_said():
    text = sentence("GPGGA,120001.00,4000.0,N,1000.0,E,4,10,0.9,100.0,M,,M,,")
    stream = NmeaStream(sigma=0.05, height="geoid")
    stream.feed(text)
    (row,) = stream.finish()
    assert row[3] == 100.0
    np.testing.assert_allclose(row[4:7], 0.05)


@pytest.mark.parametrize("size", [1, 5, 64, 1000])
def test_sentences_and_frames_of_one_stream_come_apart(size):
    """A frame may hold a dollar sign, and a chunk may end anywhere."""
    frame = b"SC\x01" + b"$GP" + bytes(range(62))
    pieces = [frame, both(10.0), b"1,0.5,0,0,0,0,0,1\n", frame[:10], both(11.0), frame]
    text = b"".join(pieces)
    got, rest = [], b""
    for k in range(0, len(text), size):
        parts, rest = apart(rest + text[k : k + size])
        got += parts
    joined = {kind: b"".join(data for each, data in got if each is kind) for kind in (True, False)}
    assert joined[True] == both(10.0) + both(11.0)
    assert joined[False] + rest == b"".join(pieces[k] for k in (0, 2, 3, 5))


def test_whatever_comes_is_counted_or_a_fix():
    """Bytes changed at random, the checksum made right again: no error, and fixes are finite."""
    rng = np.random.default_rng(1)
    stream = NmeaStream(height="ellipsoid")
    for k in range(400):
        body = bytearray(both(10.0 + k).split(b"*")[0][1:])
        for _ in range(rng.integers(1, 5)):
            body[rng.integers(6, len(body))] = rng.integers(32, 127)
        for row in stream.feed(sentence(body.decode())):
            assert is_possible(row)
    stream.feed(rng.integers(0, 256, 20_000, dtype=np.uint8).tobytes())
    stream.finish()
    assert stream.counts.total() > 0


def test_without_pynmeagps(monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "pynmeagps", None)
    with pytest.raises(InputError, match="pip install"):
        NmeaStream()
