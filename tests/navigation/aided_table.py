"""How good is an aided navigation? A hundred simulated drives with an outage, and a real drive.

``python -m tests.navigation.aided_table [RUNS]`` (make validate) writes the tables of
``docs/aided.md``; those of the real drive need the shared records.
"""

from __future__ import annotations

import os
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from schuler.aiding import GnssFixes
from schuler.attitude import multiply, quat_to_rotvec
from schuler.constants import ARCMIN
from schuler.earth import radii
from schuler.io import Mapping, open_source, read_gnss
from schuler.navigation import AidingOptions, Outages, evaluate, navigate_aided
from schuler.record import ImuRecord
from schuler.sensors import GRADES, draw
from schuler.sensors.noise import Instrument
from tests.alignment.moving.routes import car, fixes, noisy, truth_of
from tests.navigation.test_comma2k19 import LAST_FIX, PHONE, loaded

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "aided.md"
SEEDS = 5
BEGIN, END = "<!-- aided table -->\n", "<!-- end of the aided table -->"
SPEC, OUTAGE, LENGTH = GRADES["tactical-fog"], (200.0, 230.0), 300.0
OPTIONS = AidingOptions(vibration=1e-6, smooth=True)
_MEMS = GRADES["industrial-mems"]
MISALIGNED = replace(
    _MEMS, gyro=replace(_MEMS.gyro, scale_factor=3e-3, misalignment=2e-3),
    accelerometer=replace(_MEMS.accelerometer, scale_factor=5e-3, misalignment=2e-3),
)  # fmt: skip


def error_at(path, truth, time):
    """Return attitude (rad), velocity and position error (m), (9,), and the row it is of."""
    j = int(np.searchsorted(path.time, time - 1e-6))
    k = int(np.searchsorted(truth.time, path.time[j] - 1e-6))
    back = truth.quat_nb[k] * [1.0, -1.0, -1.0, -1.0]
    phi = -quat_to_rotvec(multiply(path.quat_nb[j], back))
    meridian, transverse = radii(truth.lat[k])
    place = [
        (path.lon[j] - truth.lon[k]) * transverse * np.cos(truth.lat[k]),
        (path.lat[j] - truth.lat[k]) * meridian, path.height[j] - truth.height[k],
    ]  # fmt: skip
    return np.concatenate([phi, path.v_n[j] - truth.v_n[k], place]), j


def one_drive(perfect, seed):
    """Return what one drive gives: NEES/9 of filter and smoother, errors at the outage's end."""
    rng = np.random.default_rng(seed)
    made = noisy(perfect, "tactical-fog", rng)
    gnss = fixes(perfect, rng=rng, first=1.0)
    inside = (gnss.time > OUTAGE[0]) & (gnss.time <= OUTAGE[1])
    used = gnss.rows(~inside)
    truth = perfect.truth
    whole = navigate_aided(made, used, spec=SPEC, options=OPTIONS)
    out = {}
    # The filter's covariance is whole at its end: the record ends there.
    for name, end in (("filter at 150 s", 150.0), ("filter after the outage", OUTAGE[1])):
        part = navigate_aided(
            made.between(None, end + 0.001), used, spec=SPEC, options=replace(OPTIONS, smooth=False)
        )
        error, _ = error_at(part.path, truth, end)
        out[name] = error @ np.linalg.solve(part.path.covariance[:9, :9], error) / 9.0
        out["forward"] = error
    for name, time in (("smoother at 150 s", 150.0), ("smoother after the outage", OUTAGE[1])):
        error, j = error_at(whole.path, truth, time)
        out[name] = error @ np.linalg.solve(whole.covariances[j], error) / 9.0
        out["smoothed"] = error
    return out


def simulated(runs):
    """Return the lines of the table of simulated drives."""
    perfect = truth_of(car(), LENGTH)
    done = [one_drive(perfect, seed) for seed in range(runs)]
    lines = [
        "A car with tactical gyros, 300 s, fixes of 3 m and 0.1 m/s each second, none from 200 to "
        f"230 s; {runs} runs.",
        "", "| quantity | value |", "|---|---|",
    ]  # fmt: skip
    for name in done[0]:
        if name in ("forward", "smoothed"):
            continue
        lines.append(f"| NEES / 9, {name} | {np.mean([each[name] for each in done]):.3f} |")
    for name in ("forward", "smoothed"):
        e = np.array([each[name] for each in done])
        axis = np.sqrt(np.mean(e[:, 6:8] ** 2))
        lines.append(
            f"| rms error at 230 s, {name} | {axis:.2f} m an axis, "
            f"{np.sqrt(np.mean(np.sum(e[:, 6:8] ** 2, axis=1))):.2f} m level, "
            f"{np.sqrt(np.mean(e[:, 8] ** 2)):.2f} m in height, heading "
            f"{np.sqrt(np.mean(e[:, 2] ** 2)) / ARCMIN:.1f}' |"
        )
    lines.append(f"| one standard deviation of NEES / 9 | {np.sqrt(2.0 / 9.0 / runs):.3f} |")
    return lines


def misaligned_drive(perfect, seed, options, end=OUTAGE[1], smooth=True):
    """Return NEES/9 of a drive of `MISALIGNED` at an instant: forward, and smoothed if wanted."""
    rng = np.random.default_rng(seed)
    gyro, accelerometer = draw(MISALIGNED.gyro, rng), draw(MISALIGNED.accelerometer, rng)
    dtheta, dvel = perfect.record.dtheta.copy(), perfect.record.dvel.copy()
    Instrument(MISALIGNED, gyro, accelerometer, perfect.step, rng).corrupt(dtheta, dvel)
    made = replace(perfect.record, dtheta=dtheta, dvel=dvel)
    gnss = fixes(perfect, rng=rng, first=1.0)
    used = gnss.rows(~((gnss.time > OUTAGE[0]) & (gnss.time <= OUTAGE[1])))
    out = []
    for whole in (False, True)[: 1 + smooth]:
        found = navigate_aided(
            made if whole else made.between(None, end + 0.001), used, spec=MISALIGNED,
            options=replace(options, smooth=whole),
        )  # fmt: skip
        error, j = error_at(found.path, perfect.truth, end)
        covariance = found.covariances[j] if whole else found.path.covariance[:9, :9]
        out.append(error @ np.linalg.solve(covariance, error) / 9.0)
    return out


def misaligned(runs):
    """Return the lines of the table of a MEMS with misalignments."""
    perfect = truth_of(car(), LENGTH)
    lines = [
        "", "The same drives with an industrial MEMS whose scale factors are off by 0.3 and 0.5 % "
        "and whose axes by 2 mrad;",
        f"{runs} runs, seeds 0 to {runs - 1}, NEES / 9:", "",
        "| states of the axes | filter at 150 s | after the outage | smoother at 150 s "
        "| after the outage |",
        "|---|---|---|---|---|",
    ]  # fmt: skip
    for name, axes in (("none", False), ("misalignments (the default)", None)):
        options = AidingOptions(vibration=1e-6, scale=True, axes=axes)
        cells = []
        for end in (150.0, OUTAGE[1]):
            each = [misaligned_drive(perfect, seed, options, end) for seed in range(runs)]
            cells.append(np.array(each).T)
        (a, c), (b, d) = cells
        told = (f"{x.mean():.3f} ± {x.std(ddof=1) / np.sqrt(runs):.3f}" for x in (a, b, c, d))
        lines.append(f"| {name} | {' | '.join(told)} |")
    return lines


def drive_files():
    """Return record and fixes of the real drive, or None where they are absent."""
    folder = Path(os.environ.get("SCHULER_DATA") or ROOT.parent / "shared" / "data")
    folder = folder / "rtk_car_mems"
    if not folder.is_dir():
        return None
    source = open_source(folder / "imu.csv", Mapping.from_cli(axes="y,-x,z"))
    record = ImuRecord.concatenate(list(source.chunks()))
    return record, read_gnss(folder / "gnss.csv", estimate=("delay",))


def pooled(scores, way):
    """Return rms of the worst level error, its median, and the normalised rms of all outages."""
    counts = np.array([score["count"] for score in scores], float)
    square = [score[way]["rms_horizontal_m"] ** 2 for score in scores]
    ratio = [score[way]["normalised_rms"] ** 2 for score in scores]
    return (
        np.sqrt(np.average(square, weights=counts)),
        np.average([score[way]["median_horizontal_m"] for score in scores], weights=counts),
        np.sqrt(np.average(ratio, weights=counts)),
    )


def with_outliers(gnss: GnssFixes, rng: np.random.Generator) -> tuple[GnssFixes, np.ndarray]:
    """Return fixes of which one in fifty is 50 m off, and which."""
    bad = rng.random(len(gnss)) < 0.02
    angle = rng.uniform(0.0, 2.0 * np.pi, len(gnss))
    north, east = 50.0 * np.cos(angle) * bad, 50.0 * np.sin(angle) * bad
    lat = gnss.lat + north / 6.36e6
    return replace(gnss, lat=lat, lon=gnss.lon + east / (6.386e6 * np.cos(lat))), bad


def real():
    """Return the lines of the table of the real drive."""
    found = drive_files()
    if found is None:
        return []
    record, gnss = found
    full = AidingOptions(non_holonomic=True, zero_velocity=True, scale=True, smooth=True)
    lines = [
        "", "A real drive of nine minutes with a hobby unit on the roof and RTK; scale factors and",
        "delay are estimated, constraint and rest used; each length of outage at three shifts.", "",
        "| outages | count | forward, rms of the worst (median) | smoothed | error over sigma, "
        "forward | smoothed |",
        "|---|---|---|---|---|---|",
    ]  # fmt: skip
    for length, period in ((15.0, 45.0), (30.0, 90.0), (60.0, 180.0)):
        scores = [
            navigate_aided(
                record, gnss, options=full, outages=Outages(length, period, shift * period / 3.0)
            ).outages
            for shift in range(3)
        ]
        (f, fm, fr), (s, sm, sr) = (pooled(scores, way) for way in ("forward", "smoothed"))
        count = sum(score["count"] for score in scores)
        lines.append(
            f"| {length:g} s | {count} | {f:.1f} m ({fm:.1f}) | {s:.2f} m ({sm:.2f}) | {fr:.2f} "
            f"| {sr:.2f} |"
        )
    clean = navigate_aided(record, gnss, options=full)

    def rms(path, good):
        valid = gnss.time[good] - clean.estimated["delay_s"]["gnss"][0]
        off = [
            (np.interp(valid, path.time, x) - fix[good]) * size
            for x, fix, size in ((path.lon, gnss.lon, 4.9e6), (path.lat, gnss.lat, 6.36e6))
        ]
        return float(np.sqrt(np.mean(np.square(off)) * 2.0))

    grown, refused, wrongs = [], 0, 0
    for seed in range(SEEDS):
        wrong, bad = with_outliers(gnss, np.random.default_rng(seed))
        rough = navigate_aided(record, wrong, options=full)
        grown.append(100.0 * (rms(rough.path, ~bad) / rms(clean.path, ~bad) - 1.0))
        refused, wrongs = refused + rough.refused["gnss"], wrongs + int(bad.sum())
    a = rms(clean.path, np.ones(len(gnss), bool))
    estimated = clean.estimated
    yaw, pitch = estimated["mount_deg"]["yaw"], estimated["mount_deg"]["pitch"]
    delays = " and ".join(f"{v:.4f} ± {s:.4f} s" for v, s in estimated["delay_s"].values())
    lines += [
        "",
        f"Delay of positions and velocities {delays}; mounting yaw {yaw[0]:.2f} ± {yaw[1]:.2f} "
        "deg,",
        f"pitch {pitch[0]:.2f} ± {pitch[1]:.2f} deg.",
        f"With one fix in fifty 50 m off ({SEEDS} draws: {wrongs} of {SEEDS * len(gnss)}, "
        f"{refused} refused) the smoothed path",
        f"differs from the good fixes by {np.mean(grown):.1f} % more than without "
        f"({min(grown):.1f} to {max(grown):.1f} %; {a:.4f} m rms without).",
    ]  # fmt: skip
    return lines


def motorway() -> list[str]:
    """Return what came of the motorway minute."""
    folder = Path(os.environ.get("SCHULER_DATA") or ROOT.parent / "shared" / "data")
    path = folder / "comma2k19_minute" / "segment.npz"
    if not path.is_file():
        return []
    record, fixes_, wheels, reference = loaded(path)
    used = fixes_.rows(np.asarray(fixes_.time) < LAST_FIX)
    out = ["", "The motorway minute, the last 33 s without GNSS:", ""]
    for name, spec in (("with the specification of its test", PHONE), ("without one", None)):
        found = navigate_aided(
            record, used, spec=spec, speeds=[wheels],
            options=AidingOptions(non_holonomic=True, constraint_sigma=0.05),
        )  # fmt: skip
        error = evaluate(found.path, reference)
        east, north, _ = found.path.sigma["position_enu_m"]
        scale, sigma = found.estimated["odometer_scale"]
        out.append(
            f"- {name}: {error.radial[-1]:.2f} m off, sigma {np.hypot(east, north):.1f} m; factor "
            f"of the speed {1.0 / (1.0 + scale):.4f} ± {sigma:.4f}"
        )
    return out


def main() -> None:
    """Compute the tables and write them into the page."""
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    lines = simulated(runs) + misaligned(runs) + real() + motorway()
    text = PAGE.read_text(encoding="utf-8")
    before, rest = text.split(BEGIN)
    after = rest.split(END)[1]
    PAGE.write_text(f"{before}{BEGIN}{chr(10).join(lines)}\n{END}{after}", encoding="utf-8")
    print("\n".join(lines))


if __name__ == "__main__":
    main()
