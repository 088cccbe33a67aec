"""Coarse alignment in motion, for whatever starts from it: an alignment, or an aided navigation.

From velocities, positions or body velocities beside what the gyros and accelerometers say, without
an attitude to start from.
"""

from __future__ import annotations

from schuler.in_motion.coarse import CoarseAlignment

__all__ = ["CoarseAlignment"]
