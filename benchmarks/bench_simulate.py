"""True increments of a swaying vehicle, beside pyins; and what all error terms cost.

pyins is given the trajectory, sampled, and turns it into increments. So the first row gives ours
the trajectory as well; the second makes the motion too (16 sinusoids on each of six channels).
Both must agree before they are timed: pyins interpolates between the samples, so to a part in a
thousand of the motion.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from schuler.attitude import quat_to_euler
from schuler.earth import Site
from schuler.motion import DisturbedVehicle, Motion, Static, Track
from schuler.sensors import ImuSpec
from schuler.simulation import simulate

RATE, SECONDS, REPEATS = 100.0, 600.0, 5
SITE = Site(40.0, 116.0, 50.0)

ALL_ERRORS = ImuSpec.from_dict(
    {
        "dropout": "0.1 %",
        "gyro": {
            "bias": "0.003 deg/h", "angle_random_walk": "0.001 deg/sqrt(h)",
            "bias_instability": "0.01 deg/h", "rate_random_walk": "0.03 deg/h/sqrt(h)",
            "gauss_markov": "0.01 deg/h", "gauss_markov_time": "100 s",
            "quantisation": "0.3 arcsec", "scale_factor": "10 ppm",
            "scale_factor_asymmetry": "1 ppm", "misalignment": "5 arcsec",
            "non_orthogonality": "5 arcsec", "g_sensitivity": "0.01 deg/h/g",
            "g2_sensitivity": "0.01 deg/h/g^2", "temperature_sensitivity": "0.001 deg/h/K",
            "full_scale": "400 deg/s",
        },
        "accelerometer": {
            "bias": "5 ug", "velocity_random_walk": "20 ug/sqrt(Hz)",
            "bias_instability": "20 ug", "acceleration_random_walk": "50 ug/sqrt(h)",
            "gauss_markov": "10 ug", "gauss_markov_time": "100 s", "quantisation": "0.3 mm/s",
            "scale_factor": "10 ppm", "scale_factor_asymmetry": "1 ppm",
            "misalignment": "5 arcsec", "non_orthogonality": "5 arcsec",
            "g2_sensitivity": "10 ug/g^2", "temperature_sensitivity": "1 ug/K",
            "full_scale": "10 g",
        },
    }
)  # fmt: skip


class Given:
    """A motion that has been worked out before."""

    def __init__(self, motion: Motion, samples: int) -> None:
        self.whole = motion.track(np.arange(samples + 1) / RATE)

    def track(self, t: np.ndarray) -> Track:
        """Return the part at times t, s."""
        rows = slice(round(t[0] * RATE), round(t[-1] * RATE) + 1)
        return Track(self.whole.path[rows], self.whole.angles[rows], self.whole.levers)


def best(function: Any, samples: float) -> float:
    """Return the shortest time of a call, us a sample, after one to warm up."""
    function()
    spans = []
    for _ in range(REPEATS):
        begin = time.perf_counter()
        function()
        spans.append(time.perf_counter() - begin)
    return min(spans) / samples * 1e6


def run() -> list[dict[str, Any]]:
    """Measure."""
    n = SECONDS * RATE
    rng = np.random.default_rng(1)
    truck = DisturbedVehicle.draw(rng, SECONDS, heading=30.0)
    made = simulate(truck, SITE, SECONDS, RATE)
    rows: list[dict[str, Any]] = []
    peer: float | None = None
    try:
        from pyins import sim
    except ImportError:
        peer = None
    else:
        t, truth = made.truth.time, made.truth
        psi, theta, gamma = np.degrees(quat_to_euler(truth.quat_nb)).T
        rph = np.column_stack([gamma, theta, -psi])
        lla = truth.position * [180 / np.pi, 180 / np.pi, 1.0]
        v = truth.v_n[:, [1, 0, 2]] * [1.0, 1.0, -1.0]

        def theirs() -> Any:
            return sim.generate_imu(t, lla, rph, v, "increment")[1]

        # Front, right, down to right, front, up.
        values = theirs().to_numpy()[1:, [1, 0, 2, 4, 3, 5]] * [1, 1, -1, 1, 1, -1]
        ours = np.hstack([made.record.dtheta, made.record.dvel])
        off = np.abs(values - ours).max(axis=0)
        if np.any(off > 1e-3 * np.ptp(ours, axis=0)):
            raise SystemExit(f"bench_simulate: the two do not agree: {off}")
        peer = best(theirs, n)
    for name, motion in (
        ("a swaying vehicle, trajectory given", Given(truck, int(n))),
        ("a swaying vehicle, motion made as well", truck),
        ("a base at rest", Static(30.0)),
    ):
        mine = best(lambda motion=motion: simulate(motion, SITE, SECONDS, RATE), n)
        rows.append(
            {
                "what": f"true increments, {name} (peer: pyins.sim.generate_imu)",
                "ours": mine, "peer": peer, "ratio": peer / mine if peer else None,
                "unit": "us/sample",
            }
        )  # fmt: skip
    for name, motion in (("a base at rest", Static(30.0)), ("a swaying vehicle", truck)):
        cost = best(
            lambda motion=motion: simulate(
                motion, SITE, SECONDS, RATE, ALL_ERRORS, np.random.default_rng(2),
                temperature_rate=1e-4,
            ),
            n,
        )  # fmt: skip
        rows.append(
            {
                "what": f"increments with all error terms: {name}",
                "ours": cost, "peer": None, "ratio": None, "unit": "us/sample",
            }
        )  # fmt: skip
    return rows


if __name__ == "__main__":
    for row in run():
        print(row)
