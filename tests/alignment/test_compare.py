"""All methods on one record, in one process and in two."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from schuler import Site, compare
from schuler.motion import DisturbedVehicle, Static
from schuler.sensors import load_spec
from schuler.simulation import simulate

SITE, SPEC = Site(48.0), load_spec("navigation-fog")


def test_processes_that_share_the_work_change_no_number():
    record = simulate(Static(30.0), SITE, 60.0, 20.0, SPEC, np.random.default_rng(4)).record
    pairs = [("centred", "none"), ("optimal", "lowpass"), ("wahba", "none")]
    done: list[str] = []
    one, two = (
        compare(record, SITE, SPEC, pairs, window=20.0, progress=done.append, workers=workers)
        for workers in (1, 2)
    )
    # The first and the third share a pass over the record.
    assert done == 2 * ["centred", "wahba", "optimal, lowpass"]
    assert [replace(row, seconds=0.0) for row in one.rows] == [
        replace(row, seconds=0.0) for row in two.rows
    ]


def test_what_a_prefilter_does_to_a_record_does_not_contradict_the_record():
    rng = np.random.default_rng(5)
    truck = DisturbedVehicle.with_crew(rng, 300.0, heading=57.3)
    record = simulate(truck, SITE, 300.0, 50.0, SPEC, rng).record
    pairs = [("centred", "gate-printed(width=0.0005)"), ("centred", "none")]
    found = compare(record, SITE, SPEC, pairs)
    assert [row.consistent for row in found.rows] == [False, True]
    assert found.rows[0].note == "inconsistent after the prefilter"
    assert found.consistent
    # Where nothing else was run it is all that is known.
    assert not compare(record, SITE, SPEC, pairs[:1]).consistent
