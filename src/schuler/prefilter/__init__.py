"""Prefilters: a record in, a record with less disturbance out.

Each is a small frozen dataclass that is called with a record. What they cost in delay and bias
is theirs: an estimator that models the disturbance (the centred one) needs none.
"""

from __future__ import annotations

from schuler.prefilter.base import Prefilter
from schuler.prefilter.emd import Emd, ceemdan, decompose, split_index
from schuler.prefilter.gate import Gate
from schuler.prefilter.hankel import Hankel
from schuler.prefilter.lowpass import LowPass
from schuler.prefilter.wavelet import Wavelet

__all__ = [
    "Emd",
    "Gate",
    "Hankel",
    "LowPass",
    "Prefilter",
    "Wavelet",
    "ceemdan",
    "decompose",
    "split_index",
]
