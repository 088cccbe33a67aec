"""The decomposition of the velocity in blocks: any chunking, seams, ends, and who takes it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from schuler.alignment import Aligner, Inertial, LiveAligner, align
from schuler.earth import Site
from schuler.errors import InputError
from schuler.motion import DisturbedVehicle
from schuler.prefilter import Chain, Gate, LowPass, VelocityEmd
from schuler.record import ImuRecord
from schuler.sensors import load_spec
from schuler.simulation import simulate
from tests.conftest import pieces

SITE = Site(40.0)
N, DT = 4000, 0.02
TIME = DT * np.arange(1, N + 1)
BLOCKS = VelocityEmd(block=20.0, overlap=5.0)


def truck(seconds: float = N * DT) -> ImuRecord:
    rng = np.random.default_rng(6)
    motion = DisturbedVehicle.with_crew(rng, seconds, heading=70.0)
    return simulate(motion, SITE, seconds, 1.0 / DT, load_spec("navigation-fog"), rng).record


RECORD = truck()


def streamed(design, record, cuts):
    stream = design.stream()
    parts = [stream.push(record.rows(s.start, s.stop)) for s in pieces(len(record), cuts)]
    parts.append(stream.close())
    return ImuRecord.concatenate([part for part in parts if len(part)])


@settings(max_examples=10, deadline=None)
@given(st.lists(st.integers(0, N), max_size=40))
def test_any_chunking_gives_the_same_bits(cuts):
    out, whole = streamed(BLOCKS, RECORD, cuts), BLOCKS(RECORD)
    np.testing.assert_array_equal(out.dvel, whole.dvel)
    np.testing.assert_array_equal(out.time, RECORD.time)
    np.testing.assert_array_equal(out.dtheta, RECORD.dtheta)


@pytest.mark.parametrize("rows", [999, 1000, 1001, 1749, 1750, 1751, 2501])
def test_lengths_about_the_ends_of_blocks(rows):
    """Every sample comes once; up to one block the bits are those of the whole record."""
    part = RECORD.rows(0, rows)
    out = streamed(BLOCKS, part, range(0, rows, 97))
    np.testing.assert_array_equal(out.time, part.time)
    same = np.array_equal(out.dvel, VelocityEmd()(part).dvel)
    assert same == (rows <= 1000)


def test_the_velocity_stays_where_it_was():
    """What blocks take away from the velocity stays bounded: no offset is left at a seam."""
    taken = VelocityEmd().velocity(BLOCKS(RECORD))[0] - VelocityEmd().velocity(RECORD)[0]
    thirds = np.abs(taken).reshape(-1)[: 3 * (len(taken) // 3) * 3].reshape(3, -1)
    assert thirds[2].max() < 3.0 * thirds[0].max()
    inner = np.diff(taken, axis=0)[200:-200]
    # A seam that jumped would show beside the differences of the modes that are dropped.
    seams = (np.arange(1, 5) * 750 - 200)[:, None]
    assert np.abs(inner[seams]).max() <= np.quantile(np.abs(inner), 0.999)


def test_a_cubic_passes_through_blocks():
    at = np.concatenate([[0.0], TIME])
    steps = np.outer(np.diff(9.8 * at - 3e-4 * at**2 + 2e-7 * at**3), [1.0, 0.5, -2.0])
    still = ImuRecord(TIME, np.full(N, DT), np.zeros((N, 3)), steps, coning_corrected=True,
                      sculling_corrected=True)  # fmt: skip
    np.testing.assert_allclose(BLOCKS(still).dvel, steps, atol=1e-9)


def test_a_copy_continues_by_itself():
    stream = BLOCKS.stream()
    stream.push(RECORD.rows(0, 2100))
    before = stream.copy()
    early = before.close()
    rest = [stream.push(RECORD.rows(2100, N)), stream.close()]
    whole = BLOCKS(RECORD)
    done = N - sum(len(part) for part in rest)
    np.testing.assert_array_equal(ImuRecord.concatenate(rest).dvel, whole.dvel[done:])
    assert early.time[-1] == RECORD.time[2099]


def test_an_aligner_streams_and_can_be_asked_at_any_time():
    method = Inertial(prefilter=BLOCKS)
    aligner = Aligner(SITE, method, "navigation-fog")
    for first in range(0, N, 333):
        aligner.update(RECORD.rows(first, min(first + 333, N)))
        if first in (999, 1998):
            part = align(RECORD.rows(0, first + 333), SITE, method, "navigation-fog")
            assert aligner.solution().heading_deg == part.heading_deg
    fix = aligner.solution()
    by_hand = align(BLOCKS(RECORD), SITE, Inertial(), "navigation-fog")
    assert (fix.heading_deg, fix.samples) == (by_hand.heading_deg, N)
    assert fix.method.prefilter == BLOCKS


def test_the_memory_of_a_stream_does_not_grow():
    stream = BLOCKS.stream()
    held = []
    for first in range(0, N, 100):
        stream.push(RECORD.rows(first, first + 100))
        held.append(sum(len(record) for record, _, _ in stream._pieces))
    assert max(held[20:]) <= 1000 + 750 + 100


def test_a_chain_streams_where_its_filters_do():
    low = LowPass(2.0, frame="body", channels="both", start_span=1.0)
    chain = BLOCKS | low
    assert chain.streams
    assert not (BLOCKS | Gate()).streams
    out = streamed(chain, RECORD, [1000, 1003, 2500])
    np.testing.assert_array_equal(out.time, RECORD.time)
    np.testing.assert_allclose(out.dvel, chain(RECORD).dvel, rtol=1e-9, atol=1e-12)
    assert isinstance(chain.stream().copy(), type(chain.stream()))
    with pytest.raises(InputError, match="needs the whole record"):
        Chain((BLOCKS, Gate())).stream()


def test_live_takes_blocks_and_refuses_the_whole_record():
    live = LiveAligner(SITE, "increments", Inertial(prefilter=BLOCKS), "navigation-fog")
    values = np.hstack([RECORD.dtheta, RECORD.dvel])
    live.push((k, t, v) for k, (t, v) in enumerate(zip(RECORD.time, values, strict=True)))
    live.finish()
    ours = align(RECORD, SITE, Inertial(prefilter=BLOCKS), "navigation-fog")
    assert live.solution().heading_deg == pytest.approx(ours.heading_deg, abs=1e-3)
    with pytest.raises(InputError, match="leave out the checkpoint or the prefilter"):
        live.save("state.npz")
    with pytest.raises(InputError, match=r"cannot run live; one in blocks can: emd-velocity\("):
        LiveAligner(SITE, "increments", Inertial(prefilter=VelocityEmd()))


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: VelocityEmd(block=50.0), "twice the overlap"),
        (lambda: VelocityEmd(block=50.0, overlap=0.0), "twice the overlap"),
        (lambda: VelocityEmd(block=-1.0), "block must be 0"),
        (lambda: VelocityEmd().stream(), "in blocks it can run"),
        (lambda: VelocityEmd(block=1.0, overlap=0.2)(RECORD), "blocks need 16"),
        (lambda: BLOCKS.stream().close(), "the record has 0"),
        (lambda: BLOCKS(replace(RECORD, dt=np.where(np.arange(N) == 70, 0.1, DT))),
         "even sampling"),
    ],
)  # fmt: skip
def test_errors(call, words):
    with pytest.raises(InputError, match=words):
        call()
