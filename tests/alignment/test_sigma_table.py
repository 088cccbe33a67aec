"""A third of the table of sigmas, with fewer seeds: normalised errors in a chi-square band."""

from __future__ import annotations

import numpy as np
import pytest

from tests.alignment.sigma_table import CONDITIONS, run
from tests.conftest import chi_square_band

SEEDS = 10
#: quick ones of each kind
HELD = [c for c in CONDITIONS if c.length * c.rate <= 6000 and c.rate <= 100][::2]


def test_the_table_is_long_enough():
    assert len(CONDITIONS) >= 40
    assert len(set(map(str, CONDITIONS))) == len(CONDITIONS)
    assert 3 * len(HELD) >= len(CONDITIONS)


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize("condition", HELD, ids=str)
def test_sigma_is_what_it_says(condition):
    row = run(condition, SEEDS)
    assert row.flagged <= 1
    # The page's band, widened by chance: once in ten thousand for each of them.
    low, high = chi_square_band(SEEDS - row.flagged, 2e-4)
    n = SEEDS - row.flagged
    assert 0.7 * np.sqrt(low / n) < row.heading < 1.3 * np.sqrt(high / n)
    if not np.isnan(row.tilt):
        assert 0.7 * np.sqrt(low / n) < row.tilt < 1.3 * np.sqrt(high / n)
