"""Prefilters: a record in, a record with less disturbance out.

Each is a small frozen dataclass that is called with a record; ``LowPass(0.05) | Gate()`` is a
chain. What they cost in delay and bias
is theirs: an estimator that models the disturbance (the centred one) needs none.
"""

from __future__ import annotations

from schuler.prefilter.base import Chain, Prefilter
from schuler.prefilter.emd import Emd, ceemdan, decompose, split_index
from schuler.prefilter.gate import Gate
from schuler.prefilter.hankel import Hankel
from schuler.prefilter.lowpass import LowPass
from schuler.prefilter.registry import PREFILTERS, parse_prefilter
from schuler.prefilter.velocity import VelocityEmd
from schuler.prefilter.wavelet import Wavelet

__all__ = [
    "PREFILTERS",
    "Chain",
    "Emd",
    "Gate",
    "Hankel",
    "LowPass",
    "Prefilter",
    "VelocityEmd",
    "Wavelet",
    "ceemdan",
    "decompose",
    "parse_prefilter",
    "split_index",
]
