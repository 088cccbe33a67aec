"""How well windows of a real, disturbed record agree, and whether the stated sigma says so.

Half an hour of a vehicle with people in it (laser gyros, 100 Hz), cut into windows of 60 to 300 s
that share no sample: the standard deviation of the headings (ours), and what each window states
of itself, as an rms (peer); their ratio is predicted over actual, best at one. No specification
is given: windows of one record share the instrument's biases, so that their spread shows the
disturbance and noise alone. The traditional analytic method is there to be compared with.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from _laser import PLACE, RECORD, skipped

LENGTHS = (60, 100, 150, 300)
METHODS = ("centred", "wahba", "integral-triad", "instants-triad", "analytic")


def run() -> list[dict[str, Any]]:
    """Align all windows by all methods."""
    if skipped("repeatability"):
        return []
    import schuler as sc
    from schuler.alignment import align_windows

    record, site = sc.read(RECORD), sc.Site(*PLACE)
    rows = []
    for length in LENGTHS:
        for method in METHODS:
            w = align_windows(record, site, length, method, at="start")
            sigma = np.array([x.sigma_arcmin[2] for x in w.each])
            stated, spread = float(np.sqrt(np.mean(sigma**2))), w.std_heading_arcmin
            assert spread is not None
            rows.append(
                {
                    "what": f"{len(w.each)} windows of {length} s, {method}: mean "
                    f"{w.mean_heading_deg:.3f} deg; actual std, predicted sigma",
                    "ours": spread,
                    "peer": stated,
                    "ratio": stated / spread,
                    "unit": "arcmin",
                }
            )
    return rows
