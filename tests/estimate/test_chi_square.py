"""The chi-square tail beside SciPy's."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import chdtrc

from schuler.estimate.chi_square import chi_square_tail


@pytest.mark.parametrize("freedom", [1, 2, 3, 4, 5, 6, 9, 24])
def test_it_agrees_with_scipy(freedom):
    values = np.geomspace(1e-6, 500.0, 60)
    found = [chi_square_tail(freedom, float(v)) for v in values]
    assert found == pytest.approx(chdtrc(freedom, values), rel=1e-12)


def test_nothing_is_sure_to_be_exceeded():
    assert chi_square_tail(3, 0.0) == 1.0
    assert chi_square_tail(1, 1e6) == 0.0
