"""Frames, lines, and samples put back into order."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from schuler.io.packets import FRAME_BYTES, PacketParser, encode_csv, encode_frame
from schuler.io.reorder import Reorder


def sample(k):
    return k, 0.01 * (k + 1), tuple(float(v) for v in np.arange(6) + 0.1 * k)


def stream(numbers, csv=False):
    if csv:
        return b"".join(encode_csv(*sample(k)) for k in numbers)
    return b"".join(encode_frame(*sample(k), "increments") for k in numbers)


@pytest.mark.parametrize("csv", [False, True])
@given(cuts=st.lists(st.integers(0, 20 * FRAME_BYTES), max_size=8))
def test_any_pieces_give_the_same_samples(csv, cuts):
    data = stream(range(20), csv)
    edges = sorted({0, len(data), *(min(c, len(data)) for c in cuts)})
    parser = PacketParser()
    found = [s for a, b in pairwise(edges) for s in parser.feed(data[a:b])]
    assert [s[:3] for s in found] == [sample(k) for k in range(20)]
    assert parser.damaged == 0


def test_a_damaged_frame_costs_itself_only():
    data = bytearray(stream(range(5)))
    data[2 * FRAME_BYTES + 30] ^= 0xFF
    parser = PacketParser()
    assert [s[0] for s in parser.feed(bytes(data))] == [0, 1, 3, 4]
    assert parser.damaged == 1
    assert parser.kind == "increments"


@given(st.binary(max_size=2000))
def test_any_bytes_do_no_harm(data):
    parser = PacketParser()
    parser.feed(stream(range(2)) + data)
    tail = parser.feed(bytes(FRAME_BYTES) + stream(range(3)))
    assert [s[0] for s in tail][-3:] == [0, 1, 2]
    lines = PacketParser()
    lines.feed(b"#\n" + data)
    assert [s[0] for s in lines.feed(b"\n" + stream(range(3), True))] == [0, 1, 2]


def test_lines_that_are_no_samples_are_counted():
    parser = PacketParser()
    found = parser.feed(b"# head\n1,2,3\n" + encode_csv(*sample(4)) + b"5,x,1,2,3,4,5,6\n")
    assert [s[0] for s in found] == [4]
    assert parser.damaged == 2


@given(st.permutations(range(40)), st.sets(st.integers(0, 39), max_size=5))
def test_order_is_restored_within_the_depth(order, doubled):
    reorder = Reorder(depth=64)
    came = [k for n in order for k in ([n, n] if n in doubled else [n])]
    out = reorder.push(sample(k) for k in came) + reorder.flush()
    assert sorted(s[0] for s in out) == [s[0] for s in out]
    assert len(out) + reorder.lost + reorder.late >= 40
    assert len({s[0] for s in out}) == len(out)


def test_what_never_comes_is_given_up():
    reorder = Reorder(depth=8)
    out = reorder.push(sample(k) for k in range(50) if k not in (10, 11))
    out += reorder.flush()
    assert [s[0] for s in out] == [k for k in range(50) if k not in (10, 11)]
    assert reorder.lost == 2
    assert reorder.push([sample(10)]) == []
    assert reorder.late == 1
