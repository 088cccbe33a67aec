"""Good records of every kind of base are left alone; what contradicts them is told."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import binom

from tests.alignment.good_and_faulty import BASES, FAULTS, MOVING_FAULTS, run


@pytest.mark.parametrize("base", BASES)
def test_good_records_of_each_base_are_left_alone(base):
    found = [each for seed in range(12) for each in run(seed, ("",), bases=(base,))]
    wrong = [each for each in found if each.told != "consistent"]
    # Four tests at 3e-4 each: more than one in twelve once in 11,000 runs.
    assert len(wrong) <= binom.isf(1e-4, len(found), 4 * 3e-4), wrong
    errors = [each.error for each in found if each.told == "consistent"]
    # Chi-square of twelve: beyond once in ten thousand, an excess of 10 % being allowed.
    assert 0.2 < np.sqrt(np.mean(np.square(errors))) < 1.1 * 1.83


@pytest.mark.parametrize("length", [120.0, 600.0])
@pytest.mark.parametrize("grade", ["navigation-fog", "tactical-fog"])
def test_what_contradicts_a_record_is_told(grade, length):
    drawn = {"grades": (grade,), "length": length}
    found = [each for seed in range(3) for each in run(seed, FAULTS, bases=("level",), **drawn)]
    # A truck does not show a small bias: gravity alone is left.
    plain = tuple(fault for fault in FAULTS if not fault.startswith("bias"))
    found += [
        each for seed in range(2)
        for each in run(seed, plain + MOVING_FAULTS, bases=("truck",), **drawn)
    ]  # fmt: skip
    # One of a hundred may pass: more than two of 42 once in 110 runs of other seeds.
    assert sum(each.missed for each in found) <= 2, [each for each in found if each.missed]
    assert sum(each.told != "consistent" for each in found) > 0.6 * len(found)
