"""The manual's pictures, each drawn from what the library itself computes.

`draw` gives an SVG whose text and axes have the colour of the text around it, and whose data have
middle tones that a white page and a dark one both show.
"""

from __future__ import annotations

import io
import itertools
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np

import schuler as sc
from schuler.alignment import Position, bias_formula, limit, position_limit
from schuler.alignment.history import inertial_to_local
from schuler.attitude import (
    euler_to_quat,
    multiply,
    quat_to_matrix,
    quat_to_rotvec,
    rotvec_to_quat,
)
from schuler.constants import ARCMIN, DEG, DEG_PER_HOUR, EARTH_RATE
from schuler.motion import DisturbedVehicle, Static
from schuler.sensors import GRADES
from schuler.simulation import simulate

mpl.use("svg")

from matplotlib import pyplot as plt

TEXT = "#010203"
"""Stands for the page's own text colour until the picture is in it."""

BLUE, ORANGE, GREEN, GREY, PINK = "#3f87d9", "#e07b18", "#2f9e5f", "#8a8f98", "#d0559b"

_STYLE: dict[str, Any] = {
    "svg.fonttype": "none", "svg.hashsalt": "schuler", "figure.facecolor": "none",
    "axes.facecolor": "none", "savefig.facecolor": "none", "font.size": 10.0,
    "font.family": "sans-serif", "text.color": TEXT, "axes.labelcolor": TEXT,
    "axes.edgecolor": TEXT, "xtick.color": TEXT, "ytick.color": TEXT, "axes.linewidth": 0.7,
    "legend.frameon": False, "axes.spines.top": False, "axes.spines.right": False,
    "lines.linewidth": 1.8, "axes.titlesize": 10.0, "figure.constrained_layout.use": True,
}  # fmt: skip


def _arrow(
    ax: Any, tip: Any, text: str, color: str, tail: Any = (0.0, 0.0), off: float = 1.14
) -> None:
    tip, tail = np.asarray(tip, float), np.asarray(tail, float)
    ax.annotate(
        "", tip, tail, arrowprops={"arrowstyle": "-|>", "color": color, "lw": 1.8, "shrinkA": 0}
    )
    ax.text(*(tail + off * (tip - tail)), text, color=color, ha="center", va="center")


def _bare(ax: Any, span: float = 1.45) -> None:
    ax.set(xlim=(-span, span), ylim=(-0.95, 1.6), aspect="equal")
    ax.axis("off")


def _arc(
    ax: Any, first: float, last: float, text: str, at: tuple[float, float], radius: float = 0.55
) -> None:
    """Draw an arrow along an arc between two angles from the right, rad, and name it."""
    a = np.linspace(first, last, 40)
    x, y = radius * np.cos(a), radius * np.sin(a)
    ax.plot(x, y, color=TEXT, lw=1.0)
    ax.annotate("", (x[-1], y[-1]), (x[-3], y[-3]),
                arrowprops={"arrowstyle": "-|>", "color": TEXT, "lw": 1.0})  # fmt: skip
    ax.text(*at, text, ha="center", va="center")


def angles() -> Any:
    """Three views of a body turned by each angle alone: top, from the right side, from behind."""
    figure, (top, side, back) = plt.subplots(1, 3, figsize=(8.8, 2.7))
    turn = 35.0 * DEG
    c = quat_to_matrix(euler_to_quat([-turn, 0.0, 0.0]))
    _arrow(top, (0, 1), "north", GREY)
    _arrow(top, (1, 0), "east", GREY, off=1.2)
    _arrow(top, c[:2, 1], "forward", BLUE, off=1.17)
    _arrow(top, c[:2, 0], "right", ORANGE)
    _arc(top, 90 * DEG, np.arctan2(c[1, 1], c[0, 1]), "heading", (-0.42, 0.5))
    top.text(0, 1.5, "from above: heading +35°, ψ = −35°", ha="center")
    c = quat_to_matrix(euler_to_quat([0.0, turn, 0.0]))
    # From the right the line of sight is -x: north to the right, up is up.
    _arrow(side, (1, 0), "level", GREY, off=1.2)
    _arrow(side, (0, 1), "up", GREY)
    _arrow(side, c[1:, 1], "forward", BLUE, off=1.17)
    _arrow(side, c[1:, 2], "up of body", GREEN)
    _arc(side, 0.0, np.arctan2(c[2, 1], c[1, 1]), "pitch", (0.78, 0.2))
    side.text(0, 1.5, "from the right: pitch +35°", ha="center")
    c = quat_to_matrix(euler_to_quat([0.0, 0.0, turn]))
    _arrow(back, (1, 0), "level", GREY, off=1.2)
    _arrow(back, (0, 1), "up", GREY)
    _arrow(back, c[[0, 2], 0], "right", ORANGE)
    _arrow(back, c[[0, 2], 2], "up of body", GREEN, off=1.17)
    _arc(back, 90 * DEG, np.arctan2(c[2, 2], c[0, 2]), "roll", (-0.22, 0.55))
    back.text(0, 1.5, "from behind: roll +35°", ha="center")
    for ax in (top, side, back):
        _bare(ax)
    return figure


def earth() -> Any:
    """Draw the meridian of a site: the Earth's rate, its two parts, up, and north."""
    figure, ax = plt.subplots(figsize=(5.2, 3.9))
    lat = 40.0 * DEG
    a = np.linspace(-90, 90, 200) * DEG
    ax.plot(np.cos(a), np.sin(a), color=GREY, lw=1.2)
    ax.plot([0, 0], [-1.15, 1.45], color=GREY, lw=1.0, ls="--")
    ax.plot([0, 1.1], [0, 0], color=GREY, lw=1.0, ls="--")
    up, north = np.array([np.cos(lat), np.sin(lat)]), np.array([-np.sin(lat), np.cos(lat)])
    ax.plot(*np.outer(up, [0, 1]), color=GREY, lw=0.8)
    ax.text(0.24, 0.08, "L", ha="center")
    rate = 0.75 * sc.Site(40.0).earth_rate / EARTH_RATE
    whole = rate[1] * north + rate[2] * up
    _arrow(ax, up + whole, "Ω", BLUE, up, 1.1)
    _arrow(ax, up + rate[1] * north, "", ORANGE, up)
    ax.text(-0.07, (up + rate[1] * north)[1], "Ω cosL, north", color=ORANGE, ha="right")
    _arrow(ax, up + rate[2] * up, "Ω sinL, up", GREEN, up, 1.3)
    _arrow(ax, (0, 1.5), "z of i0", GREY, (0, 1.1), 1.3)
    _arrow(ax, (1.45, 0), "x of i0", GREY, (1.1, 0), 1.45)
    ax.plot(*up, "o", color=TEXT, ms=5)
    ax.set(xlim=(-1.0, 2.15), ylim=(-1.1, 1.75), aspect="equal")
    ax.axis("off")
    return figure


def cone() -> Any:
    """Up of a site in i0 over a day, and what a minute of it is."""
    figure = plt.figure(figsize=(8.4, 3.6))
    ax = figure.add_subplot(1, 2, 1, projection="3d")
    lat = 40.0 * DEG
    day = inertial_to_local(np.linspace(0.0, 2 * np.pi / EARTH_RATE, 200), lat)[:, 2]
    ax.plot(*day.T, color=GREY, lw=1.0)
    for hours, color in ((0.0, BLUE), (2.0, ORANGE), (4.0, GREEN), (6.0, PINK)):
        up = inertial_to_local(3600.0 * hours, lat)[2]
        ax.plot(*np.outer(up, [0, 1]), color=color, lw=1.6)
        ax.text(*(1.12 * up), f"{hours:.0f} h", color=color, ha="center")
    ax.plot([0, 0], [0, 0], [0, 1.1], color=TEXT, lw=1.0, ls="--")
    ax.text(0, 0, 1.18, "the Earth's axis", ha="center")
    ax.set_axis_off()
    ax.set_box_aspect((1, 1, 0.75), zoom=1.3)
    ax.view_init(14, 45)
    right = figure.add_subplot(1, 2, 2)
    t = np.linspace(0.0, 120.0, 121)
    for degrees, color in ((0, BLUE), (40, ORANGE), (70, GREEN)):
        site = sc.Site(float(degrees))
        force = site.gravity * inertial_to_local(t, site.latitude)[:, 2]
        speed = np.concatenate([np.zeros((1, 3)), np.cumsum(0.5 * (force[1:] + force[:-1]), 0)])
        east = speed @ inertial_to_local(0.0, site.latitude)[0]
        right.plot(t, east, color=color, label=f"latitude {degrees}°")
    right.set(xlabel="time, s", ylabel="m/s to the east")
    right.set_title("velocity of the force in i0, its part to the east")
    right.legend()
    return figure


def slopes() -> Any:
    """Limit of the heading with time, and the part of each source."""
    figure, ax = plt.subplots(figsize=(6.4, 3.7))
    times, site = np.geomspace(10.0, 7200.0, 25), sc.Site(40.0)
    names = {"navigation-rlg": GREEN, "navigation-fog": BLUE, "tactical-fog": ORANGE}
    for name, color in names.items():
        spec = GRADES[name]
        bound = [np.sqrt(limit(spec, site, t)[2, 2]) / ARCMIN for t in times]
        ax.loglog(times, bound, color=color, label=name)
        floor = spec.gyro.bias / (EARTH_RATE * np.cos(site.latitude)) / ARCMIN
        ax.axhline(floor, color=color, lw=0.9, ls="--")
    ax.text(150, floor / 1.25, "gyro bias to the east / (Ω cosL)", color=ORANGE, va="top")
    ax.set(xlabel="time, s", ylabel="heading, 1 sigma, arcmin")
    ax.set_title("the limit at latitude 40°; dashed, the floor of each instrument")
    ax.legend()
    return figure


def centred() -> Any:
    """Heading error along the span, and what a jolt at the first sample does."""
    figure, (ax, right) = plt.subplots(1, 2, figsize=(8.4, 3.3))
    site = sc.Site(40.0)
    eps = np.array([0.01, -0.02, 0.03]) * DEG_PER_HOUR
    made = simulate(Static(30.0, 2.0, -3.0), site, 300.0, 20.0, gyro_bias=eps)
    record, truth = made.record, euler_to_quat(made.euler[0])
    c0 = quat_to_matrix(sc.align(record, site, "centred", at="start").quat_nb)
    # At rest the rate is constant, so that the sum of increments is the rotation vector.
    body = quat_to_matrix(rotvec_to_quat(np.cumsum(record.dtheta, axis=0)))
    carried = inertial_to_local(record.time, site.latitude)
    first = inertial_to_local(0.0, site.latitude)
    c = carried @ first.T @ c0 @ body
    off = c @ quat_to_matrix(truth).T
    phi = np.column_stack([off[:, 1, 2], off[:, 2, 0], off[:, 0, 1]]) / ARCMIN
    said = bias_formula(site, truth, eps, np.zeros(3)) / ARCMIN
    for k, (name, color) in enumerate((("east", GREEN), ("north", ORANGE), ("up", BLUE))):
        ax.plot(record.time, phi[:, k] - said[k], color=color, label=name)
    ax.axhline(0.0, color=TEXT, lw=0.7)
    ax.axvline(150.0, color=GREY, lw=0.9, ls="--")
    ax.set(xlabel="time, s", ylabel="φ less the formula, arcmin")
    ax.set_title("a gyro drift, 300 s: right in the middle")
    ax.legend(loc="upper center")
    record, steps = record.between(0.0, 100.0), np.linspace(0.0, 5e-3, 6)
    for method, color in (("centred", BLUE), ("wahba", ORANGE)):
        found = []
        for step in steps:
            dvel = record.dvel.copy()
            dvel[0, 0] += step
            moved = sc.ImuRecord(record.time, record.dt, record.dtheta, dvel)
            found.append(sc.align(moved, site, method).heading_deg)
        right.plot(1e3 * steps, 60 * np.abs(np.subtract(found, found[0])), "o-", ms=4,
                   color=color, label=method)  # fmt: skip
    right.set(xlabel="velocity at the first sample, mm/s", ylabel="heading turned by, arcmin")
    right.set_title("100 s; the vehicle moved at first")
    right.legend()
    return figure


def budget() -> Any:
    """Shares of the heading's variance for three spans of one simulated truck."""
    figure, ax = plt.subplots(figsize=(7.2, 2.9))
    site, spec = sc.Site(40.0), GRADES["navigation-fog"]
    rng = np.random.default_rng(7)
    truck = DisturbedVehicle.draw(rng, 900.0, heading=57.3)
    record = simulate(truck, site, 900.0, 50.0, spec, rng).record
    spans = (100.0, 300.0, 900.0)
    fixes = [sc.align(record.between(0.0, t), site, spec=spec) for t in spans]
    # Only what would be seen: the others add up to less than one part in a thousand.
    shares = [
        max(fix.budget_arcmin2[source] / sum(fix.budget_arcmin2.values()) for fix in fixes)
        for source in fixes[0].budget
    ]
    shown = [name for name, share in zip(fixes[0].budget, shares, strict=True) if share > 1e-3]
    colors = (BLUE, PINK, GREEN, GREY, ORANGE)
    left = np.zeros(len(spans))
    for source, color in zip(shown, itertools.cycle(colors), strict=False):
        part = np.array([fix.budget_arcmin2[source] for fix in fixes])
        part /= [sum(fix.budget_arcmin2.values()) for fix in fixes]
        ax.barh(range(len(spans)), 100 * part, left=left, color=color, height=0.55,
                label=source.replace("_", " "))  # fmt: skip
        left += 100 * part
    names = [
        f"{t:.0f} s: ± {fix.sigma_arcmin[2]:.1f}′" for t, fix in zip(spans, fixes, strict=True)
    ]
    ax.set_yticks(range(len(spans)), names)
    ax.invert_yaxis()
    ax.set(xlabel="share of the heading's variance, %", xlim=(0, 100))
    figure.legend(loc="outside upper center", ncols=2, fontsize=9)
    return figure


def positions() -> Any:
    """Limit of the heading with the turn to a second position, and with latitude."""
    figure, (ax, right) = plt.subplots(1, 2, figsize=(8.4, 3.2), sharey=True)
    spec, site = GRADES["navigation-fog"], sc.Site(40.0)
    turns = np.arange(0.0, 361.0, 15.0)
    two = [position_limit(spec, site, [Position(), Position(t)]).sigma_arcmin[2] for t in turns]
    ax.plot(turns, two, color=BLUE)
    ax.set(xlabel="turn to the second position, deg", ylabel="heading, 1 sigma, arcmin")
    ax.set_title("two dwells of 300 s, latitude 40°")
    ax.set_xticks([0, 90, 180, 270, 360])
    lats = np.arange(0.0, 81.0, 5.0)
    one, both = [Position(dwell=600.0)], [Position(), Position(180.0)]
    for plan, name, color in ((one, "one, 600 s", ORANGE), (both, "two, 180° apart", BLUE)):
        found = [position_limit(spec, sc.Site(lat), plan).sigma_arcmin[2] for lat in lats]
        right.plot(lats, found, color=color, label=name)
    right.set(xlabel="latitude, deg", ylim=(0, 14))
    right.set_title("and at all latitudes")
    right.legend()
    return figure


def misalignment() -> Any:
    """Rotations from true to estimated axes, as the estimated axes and phi show them."""
    figure, ax = plt.subplots(figsize=(4.6, 2.2))
    phi = np.array([0.0, 0.0, 20.0 * DEG])
    true = euler_to_quat([0.0, 0.0, 0.0])
    found = multiply(rotvec_to_quat(-phi), true)
    turned = quat_to_matrix(found)
    assert np.allclose(quat_to_rotvec(multiply(found, true * [1, -1, -1, -1])), -phi)
    _arrow(ax, (0, 1), "", GREY)
    ax.text(-0.05, 1.0, "forward, truth", color=GREY, ha="right")
    _arrow(ax, turned[:2, 1], "", BLUE)
    ax.text(0.42, 0.92, "forward, as found", color=BLUE, ha="left")
    _arc(ax, 90 * DEG, np.arctan2(turned[1, 1], turned[0, 1]), "φ up", (-0.2, 0.6), 0.6)
    ax.set(xlim=(-1.3, 1.7), ylim=(-0.1, 1.15), aspect="equal")
    ax.axis("off")
    return figure


def _velocity_table() -> dict[str, list[str]]:
    """Return the cells of the table of the prefilters' page by way."""
    page = (Path(__file__).resolve().parent / "prefilter.md").read_text(encoding="utf-8")
    rows = page.partition("<!-- velocity table -->")[2].partition("<!-- end")[0].split("\n")
    cells = [[cell.strip() for cell in row.strip("|").split("|")] for row in rows if "|" in row]
    return {row[0]: row[1:] for row in cells[2:]}


def velocity_emd() -> Any:
    """Draw the prefilters' table: azimuth error against the length of the record."""
    table, lengths = _velocity_table(), [100.0, 150.0, 200.0, 300.0]
    figure, ax = plt.subplots(figsize=(7.2, 3.6))
    for name, text, color, marker in (
        ("no prefilter", "Kalman, no prefilter", GREY, "o"),
        ("EMD", "Kalman, EMD of the velocity", ORANGE, "s"),
        ("improved EMD", "Kalman, improved EMD", PINK, "D"),
        ("zero-phase low-pass", "Kalman, zero-phase low-pass", GREEN, "^"),
        ("default", "default method, no prefilter", BLUE, "v"),
    ):
        found = [cell.split(" ± ") for cell in table[name][1:5]]
        error = [float(cell[1]) if len(cell) > 1 else 0.0 for cell in found]
        ax.errorbar(lengths, [float(cell[0]) for cell in found], error, color=color,
                    marker=marker, ms=4.5, capsize=2.5, label=text)  # fmt: skip
    bound = [float(cell) for cell in table["Cramér-Rao bound"][1:5]]
    ax.plot(lengths, bound, color=TEXT, ls=":", lw=1.2, label="Cramér-Rao bound")
    ax.set(xlabel="length of the record, s", ylabel="azimuth error, rms, arcmin", yscale="log")
    ax.set_yticks([4, 6, 10, 20, 40], ["4", "6", "10", "20", "40"])
    ax.minorticks_off()
    ax.legend(loc="upper right")
    return figure


def moving() -> Any:
    """Heading error against the span for a car, plain and centred, beside the bound."""
    from schuler.alignment import limit_on, planned_fixes
    from schuler.in_motion.body import body_rows
    from schuler.in_motion.series import velocity_series
    from schuler.motion import Manoeuvre, Route
    from schuler.sensors import draw as draw_errors
    from schuler.sensors.noise import Instrument

    legs = []
    for speed, turn in ((3, 90), (-5, -60), (4, 90), (-3, 30), (2, -90)):
        legs += [Manoeuvre(12.0, speed=speed), Manoeuvre(8.0, turn=turn), Manoeuvre(6.0)]
    site, spec = sc.Site(40.0, 10.0, 100.0), GRADES["navigation-fog"]
    car = Route(legs, heading=40.0, speed=12.0)
    lengths, runs = np.array([20, 30, 45, 60, 90, 120]), 30
    clean = simulate(car, site, 120.0, 50.0)
    fixes = planned_fixes(clean.truth)
    v = np.asarray(fixes.v_n)
    off: dict[str, list[Any]] = {"plain": [], "centred": []}
    for seed in range(runs):
        rng = np.random.default_rng(seed)
        dtheta, dvel = clean.record.dtheta.copy(), clean.record.dvel.copy()
        errors = draw_errors(spec.gyro, rng), draw_errors(spec.accelerometer, rng)
        Instrument(spec, *errors, clean.step, rng).corrupt(dtheta, dvel)
        record = replace(clean.record, dtheta=dtheta, dvel=dvel)
        noisy = replace(fixes, v_n=v + 0.1 * rng.standard_normal(v.shape))
        series = velocity_series(body_rows(record, noisy.time), noisy)
        for name in off:
            each = []
            for n in lengths:
                y, x = series.y[: n + 1], series.x[: n + 1]
                first = (y[0], x[0]) if name == "plain" else (y.mean(axis=0), x.mean(axis=0))
                mat = _wahba(y - first[0], x - first[1])
                each.append(_heading_off(mat, clean.truth.quat_nb[0], site))
            off[name].append(each)
    figure, ax = plt.subplots(figsize=(7.2, 3.2))
    for name, color in (("plain", ORANGE), ("centred", BLUE)):
        rms = np.sqrt(np.mean(np.square(off[name]), axis=0)) / ARCMIN
        ax.plot(lengths, rms, "o-", ms=4, color=color, label=f"{name}, {runs} runs")
    bound = []
    for n in lengths:
        path = clean.truth.rows(slice(0, 50 * n + 1))
        bound.append(limit_on(path, spec, planned_fixes(path)).sigma_arcmin[2])
    ax.plot(lengths, bound, "--", color=GREY, label="bound")
    ax.set(xlabel="span, s", ylabel="heading error, rms, arcmin", ylim=(0.0, None))
    ax.legend()
    return figure


def _wahba(y: Any, x: Any) -> Any:
    """Return the rotation from x to y."""
    u, _, vt = np.linalg.svd(y.T @ x)
    return u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt


def _heading_off(mat_i0_ib0: Any, quat_nb: Any, site: Any) -> float:
    """Return the heading's error at the start, rad."""
    from schuler.in_motion.earth_side import local_axes

    axes = local_axes(np.array(site.latitude), np.array(site.longitude))
    turn = axes.T @ mat_i0_ib0 @ quat_to_matrix(quat_nb).T
    return float(turn[0, 1] - turn[1, 0]) / 2.0


PICTURES: dict[str, Callable[[], Any]] = {
    each.__name__: each
    for each in (
        angles,
        earth,
        cone,
        slopes,
        centred,
        budget,
        positions,
        misalignment,
        velocity_emd,
        moving,
    )
}


def draw(name: str) -> str:
    """Return the SVG of a picture, for a page: no header, its names its own."""
    with mpl.rc_context(_STYLE), io.StringIO() as out:
        figure = PICTURES[name]()
        figure.savefig(out, format="svg", metadata={"Date": None, "Creator": None})
        plt.close(figure)
        svg = out.getvalue()
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>\s*|<!--.*?-->\s*|\n\s*", " ", svg, flags=re.DOTALL)
    svg = re.sub(r'(\bid="|url\(#|href="#)', rf"\g<1>{name}-", svg)
    return svg.replace(TEXT, "currentColor").strip()
