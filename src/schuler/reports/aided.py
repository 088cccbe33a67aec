"""The page of an aided navigation: path, speed, attitude, errors, innovations, biases, score."""

from __future__ import annotations

from html import escape
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler.attitude import psi_to_heading
from schuler.constants import ARCMIN, DEG, DEG_PER_HOUR, MICRO_G
from schuler.navigation import AidedNavigation
from schuler.navigation.aid_estimates import estimate_rows
from schuler.navigation.evaluate import Evaluation, normalised_rms, sigma_at
from schuler.reports.figure import scatter
from schuler.reports.figures import (
    BLUE,
    GREY,
    ORANGE,
    POINTS,
    figure_of,
    line_of,
    plot_layout,
)
from schuler.reports.navigation import local_way
from schuler.reports.page import (
    Drawing,
    Page,
    Section,
    contradiction_box,
    definition_table,
)
from schuler.trajectory import Trajectory

__all__ = ["aided_page"]

Array = NDArray[np.float64]

_GAP, _LEAST_GAP = 5.0, 1.0
"""A line of innovations is broken over so many usual intervals, and s at least."""

_AXES = (("east", BLUE), ("north", ORANGE), ("up", GREY))


def aided_page(found: AidedNavigation, evaluation: Evaluation | None = None) -> Page:
    """Return the page.

    Parameters
    ----------
    found : AidedNavigation
    evaluation : Evaluation, optional
        Against a reference: found errors are drawn over their sigma.
    """
    path = found.path
    said = " + ".join(f"{n} {escape(name)}" for name, n in found.used.items())
    value, sub = _stated(path, said)
    rows: list[tuple[str, str]] = []
    if found.outages is not None:
        o = found.outages
        for way in ("forward", "smoothed"):
            if o[way] is not None:
                value = f"{o[way]['rms_horizontal_m']:.3g} m"
                sub = (
                    f"rms of the worst horizontal error in {o['count']} outages of "
                    f"{o['length_s']:g} s, {way}; {said}"
                )
                rows += [
                    (f"outages, {way}", f"{o[way]['rms_horizontal_m']:.4g} m rms horizontally, "
                     f"median {o[way]['median_horizontal_m']:.4g} m, "
                     f"{o[way]['rms_height_m']:.4g} m in height"),
                ]  # fmt: skip
    rows += [("instrument", escape(found.spec.name)), *estimate_rows(found.estimated)]
    rows += [(f"refused of {name}", str(n)) for name, n in found.refused.items() if n]
    head = (
        f"<h1>Aided navigation · {escape(path.name)}</h1>"
        + contradiction_box(found.contradictions)
        + f'<p class="value">{value}</p><p class="sub">{sub}.</p>'
    )
    against = []
    if evaluation is not None:
        against.append(Section("Against the reference", drawings=_errors(found, evaluation)))
        rows += _error_rows(found, evaluation)
    return Page(
        f"Aided navigation: {path.name}", head,
        [
            Section("Where it went", drawings=[_way(found), _height(found), _speed(found),
                                               _heading(found), *_tilt(found)]),
            *against,
            Section("Innovations", drawings=[_innovations(found, k) for k in found.innovations
                                             if k != "withheld"]),
            Section("Biases of the instrument", drawings=_biases(found)),
            Section("Estimates", html=definition_table(rows, "At the end, ± 1 sigma")),
        ],
    )  # fmt: skip


def _stated(path: Trajectory, said: str) -> tuple[str, str]:
    """Return the horizontal sigma at the end, or the duration where none is known, and of what."""
    span = f"{path.time[-1] - path.time[0]:.6g} s aided"
    if path.sigma is None:
        return span, said
    east, north, _ = path.sigma["position_enu_m"]
    return (
        f"± {np.hypot(east, north):.2g} m",
        f"1 sigma of the horizontal position at the end of {span} by {said}",
    )


def _thin(n: int) -> NDArray[np.int64]:
    return np.unique(np.linspace(0, n - 1, min(n, POINTS)).astype(np.int64))


def _way(found: AidedNavigation) -> Drawing:
    traces = []
    for path, name, colour in (
        (found.forward, "forward", ORANGE), (found.path, "smoothed", BLUE),
    ):  # fmt: skip
        if name == "smoothed" or path is not found.path:
            k = _thin(len(path))
            x, y = local_way(path.rows(k), found.path)
            label = name if found.forward is not found.path else "way"
            traces.append(line_of(x, y, label, colour))
    layout = plot_layout(460, "east, m", "north, m", hovermode="closest")
    layout["yaxis"]["scaleanchor"] = "x"
    text = "The way over ground, from the start."
    return Drawing("way", figure_of(traces, layout), text)


def _band(t: Array, centre: Array, sigma: Array) -> Any:
    return scatter(
        x=np.concatenate([t, t[::-1]]),
        y=np.concatenate([centre + 3.0 * sigma, (centre - 3.0 * sigma)[::-1]]),
        name="± 3 sigma", mode="lines", fill="toself", fillcolor="rgba(0,114,178,0.18)",
        line={"width": 0}, hoverinfo="skip",
    )  # fmt: skip


def _height(found: AidedNavigation) -> Drawing:
    path = found.path
    k = _thin(len(path))
    assert path.variances is not None
    sigma = np.sqrt(path.variances[k, 8])
    text = "Height above the ellipsoid, with three sigma."
    traces = [
        _band(path.time[k], path.height[k], sigma),
        line_of(path.time[k], path.height[k], "height", BLUE),
    ]
    return Drawing(
        "height", figure_of(traces, plot_layout(260, "time, s", "height, m")), text, text
    )


def _heading(found: AidedNavigation) -> Drawing:
    path = found.path
    k = _thin(len(path))
    assert path.variances is not None
    heading = np.unwrap(psi_to_heading(path.euler[k, 0])) / DEG
    sigma = np.sqrt(path.variances[k, 2]) / DEG
    text = "Heading clockwise from north, without jumps at 360 degrees, with three sigma."
    traces = [_band(path.time[k], heading, sigma), line_of(path.time[k], heading, "heading", BLUE)]
    return Drawing(
        "heading", figure_of(traces, plot_layout(260, "time, s", "heading, deg")), text, text
    )


def _speed(found: AidedNavigation) -> Drawing:
    path = found.path
    k = _thin(len(path))
    v_n = path.known("v_n")[k]
    speed = np.linalg.norm(v_n, axis=1)
    along = v_n / np.maximum(speed, 1e-9)[:, None]
    sigma = np.sqrt(np.sum(along**2 * path.known("variances")[k, 3:6], axis=1))
    text = "Speed over ground, with three sigma."
    traces = [_band(path.time[k], speed, sigma), line_of(path.time[k], speed, "speed", BLUE)]
    return Drawing(
        "speed", figure_of(traces, plot_layout(260, "time, s", "speed, m/s")), text, text
    )


def _tilt(found: AidedNavigation) -> list[Drawing]:
    path = found.path
    k = _thin(len(path))
    tilt = np.sqrt(0.5 * (path.known("variances")[k, :2]).sum(axis=1)) / DEG
    out = []
    for name, axis in (("pitch", 1), ("roll", 2)):
        angle = path.euler[k, axis] / DEG
        text = f"{name.capitalize()}, with three sigma."
        traces = [_band(path.time[k], angle, tilt), line_of(path.time[k], angle, name, BLUE)]
        layout = plot_layout(220, "time, s", f"{name}, deg")
        out.append(Drawing(name, figure_of(traces, layout), text))
    return out


def _biases(found: AidedNavigation) -> list[Drawing]:
    """Draw what the filter's biases are with three sigma, an axis to a line."""
    epochs = found.epochs
    k = _thin(len(found.path))
    time, values = epochs.rows[1:, 0][k], epochs.estimates[1:][k]
    out = []
    for group, first, what, unit, word in (
        ("gyro_bias", 9, "Gyro", DEG_PER_HOUR, "deg/h"),
        ("accelerometer_bias", 12, "Accelerometer", MICRO_G, "ug"),
    ):
        bias = values[:, epochs.layout[group]] / unit
        sigma = np.sqrt(found.path.known("variances")[k, first : first + 3]) / unit
        for axis, side in enumerate(("right", "forward", "up")):
            text = f"{what} bias, {side} axis, with three sigma."
            traces = [
                _band(time, bias[:, axis], sigma[:, axis]),
                line_of(time, bias[:, axis], "bias", BLUE),
            ]
            layout = plot_layout(200, "time, s", f"{side}, {word}")
            out.append(
                Drawing(f"{group} {side}".replace("_", " "), figure_of(traces, layout), text)
            )
    return out


def _error_rows(found: AidedNavigation, e: Evaluation) -> list[tuple[str, str]]:
    told = e.to_dict()
    ratio = normalised_rms(e, found.path)
    said = ", ".join(f"{value:.2f} ({name})" for name, value in ratio.items() if value is not None)
    return [
        ("median horizontal error", f"{told['cep_m']:.4g} m against {escape(e.reference)}"),
        ("found error over sigma, rms", said),
    ]


def _errors(found: AidedNavigation, e: Evaluation) -> list[Drawing]:
    """Draw what was found of each error within three sigma."""
    sigma = sigma_at(e, found.path)
    drawn = [("position", e.position, 1.0, "m")]
    if e.velocity is not None:
        drawn.append(("velocity", e.velocity, 1.0, "m/s"))
    if e.phi is not None:
        drawn.append(("phi", e.phi, ARCMIN, "arcmin"))
    k = _thin(len(e.time))
    t, out = e.time[k], []
    for what, error, unit, name in drawn:
        for axis, (side, _) in enumerate(_AXES):
            spread = sigma[what][k, axis] / unit
            own = "attitude error phi" if what == "phi" else f"{what} error"
            text = f"The {own} {side}, path minus reference, with three sigma about zero."
            traces = [
                _band(t, np.zeros(len(t)), spread), line_of(t, error[k, axis] / unit, "error", BLUE)
            ]  # fmt: skip
            layout = plot_layout(220, "time, s", f"{side}, {name}")
            out.append(Drawing(f"{what} error {side}", figure_of(traces, layout), text))
    return out


def _with_breaks(time: Array, values: Array, k: NDArray[np.int64]) -> tuple[Array, Array]:
    """Return some of the points, with a gap of the line where there was one in time."""
    step = np.diff(time)
    long = np.flatnonzero(step > max(_GAP * float(np.median(step)), _LEAST_GAP)) + 1
    at = np.searchsorted(k, long)
    return np.insert(time[k], at, time[long]), np.insert(values[k], at, np.nan)


def _innovations(found: AidedNavigation, aid: str) -> Drawing:
    time, z, sigma, weight = found.innovations[aid]
    traces = []
    for axis, (name, colour) in enumerate(_AXES):
        seen = sigma[:, axis] > 0.0
        if np.any(seen):
            ratio = z[seen, axis] / sigma[seen, axis]
            label = name if "gnss" in aid else f"axis {axis + 1}"
            t, ratio = _with_breaks(time[seen], ratio, _thin(len(ratio)))
            traces.append(line_of(t, ratio, label, colour))
    out = np.flatnonzero(weight == 0.0)[:POINTS]
    if len(out):
        worst = np.max(np.abs(z[out]) / np.maximum(sigma[out], 1e-12), axis=1)
        traces.append(
            scatter(x=time[out], y=worst, name="refused", mode="markers",
                       marker={"color": "#CC3311", "symbol": "x", "size": 7})
        )  # fmt: skip
    text = f"Predicted minus measured of {aid.replace('_', ' ')}, over its sigma: within 3."
    layout = plot_layout(280, "time, s", "innovation / sigma")
    return Drawing(f"innovations of {aid}".replace("_", " "), figure_of(traces, layout), text)
