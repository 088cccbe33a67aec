"""The page of ``schuler allan``: deviations with their bounds, the fitted noise, and its terms."""

from __future__ import annotations

from html import escape
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler.allan_variance.deviation import Allan
from schuler.allan_variance.noise_fit import NoiseFit
from schuler.allan_variance.output import in_si, term_text, unit_of
from schuler.reports.figure import scatter
from schuler.reports.figures import BLUE, GREEN, ORANGE, figure_of, plot_layout
from schuler.reports.page import Drawing, Page, Section, definition_table
from schuler.units import percent, to_unit

__all__ = ["allan_page", "noise_page"]

Array = NDArray[np.float64]

_COLOURS = (BLUE, ORANGE, GREEN)
_BANDS = ("rgba(0,114,178,0.20)", "rgba(230,159,0,0.24)", "rgba(0,158,115,0.20)")

#: what each term is called on the figure
_LABELS = ("Q", "N", "B", "K", "R")


def allan_page(found: Allan, fit: NoiseFit | None = None) -> Page:
    """Return the page.

    Parameters
    ----------
    found : Allan
    fit : NoiseFit or None
        None where the record is too short for one.
    """
    sections = []
    for part, title in (("gyro", "Gyros"), ("accel", "Accelerometers")):
        names = [name for name in found.channels if name.startswith(part)]
        if not names:
            continue
        shown = (
            "Points: deviation; bands: 68 % confidence. Lines: the sum of the fitted terms; "
            "dotted: each term alone, of the channel that has most of it (Q quantisation, N random "
            "walk, B bias instability, K rate random walk, R rate ramp)."
        )
        if fit is None:
            shown = "Points: deviation; bands: 68 % confidence."
        alt = f"{title}: {found.kind} deviation of {', '.join(names)} against averaging time."
        sections.append(
            Section(
                title, drawings=[Drawing(title.lower(), _figure(found, fit, names), shown, alt)]
            )
        )
    if fit is not None:
        sections.append(Section("Noise", html=_table(fit)))
    rows = [
        ("record", found.name),
        ("deviation", found.kind),
        ("samples", str(found.samples)),
        ("duration", f"{found.duration:.9g} s"),
        ("sampling interval", f"{found.interval:.9g} s"),
        ("averaging times", f"{len(found.tau)}, {found.tau[0]:.6g} to {found.tau[-1]:.6g} s"),
        ("bridged samples", str(found.bridged)),
    ]
    sections.append(Section("Inputs", html=definition_table(rows, "What it was found from")))
    return Page(f"Noise of {found.name}", _headline(found, fit), sections)


def noise_page(fit: NoiseFit) -> Page:
    """Return the page of a fit, with the deviations that it was found from."""
    return allan_page(fit.source, fit)


def _headline(found: Allan, fit: NoiseFit | None) -> str:
    warned = found.warnings() + (fit.warnings() if fit is not None else [])
    items = "".join(f"<li>{escape(text)}</li>" for text in warned)
    facts, value = "", f"{escape(found.kind.capitalize())} deviation"
    if fit is not None:
        spec = fit.to_spec()
        # Of a record at rest the first question is the white noise: the gyros', or what there is.
        for part, key in (("gyro", spec.gyro.WHITE), ("accelerometer", spec.accelerometer.WHITE)):
            text = spec.describe()[part].get(key)
            if text is not None:
                words = f"{key.replace('_', ' ')} of the {part}s"
                value = f'{escape(text)} <span class="pm">{words}</span>'
                break
        shown = [
            (f"{part} {key.replace('_', ' ')}", value)
            for part, values in spec.describe().items()
            for key, value in values.items()
        ]
        facts = "".join(
            f"<li><b>{escape(value)}</b><span>{escape(label)}</span></li>" for label, value in shown
        )
    return (
        f"<h1>Noise · {escape(found.name)}</h1>"
        f'<p class="value">{value}</p>'
        f'<p class="sub">{escape(found.kind.capitalize())} deviation of {found.samples} samples, '
        f"{found.duration:.6g} s at "
        f"{1.0 / found.interval:.6g} Hz"
        + (". Below: the fitted noise, rms over the axes." if facts else ".")
        + "</p>"
        + (f'<ul class="facts">{facts}</ul>' if facts else "")
        + (f'<ul class="warnings" aria-label="Warnings">{items}</ul>' if items else "")
    )


def _figure(found: Allan, fit: NoiseFit | None, names: list[str]) -> Any:
    unit = unit_of(names[0])
    factor = to_unit(1.0, unit)
    layout = plot_layout(520, "averaging time, s", f"deviation, {unit}", hovermode="closest")
    for axis in ("xaxis", "yaxis"):
        layout[axis].update(type="log", exponentformat="power")
    tau = np.geomspace(found.tau[0], found.tau[-1], 121)
    traces: list[Any] = []
    largest = 0.0
    smallest = np.inf
    for k, name in enumerate(names):
        at = found.channels.index(name)
        colour, band = _COLOURS[k % 3], _BANDS[k % 3]
        low, high = (factor * v[:, at] for v in (found.lower, found.upper))
        middle = factor * found.deviation[:, at]
        if not middle.any():
            continue
        largest = max(largest, float(high.max()))
        smallest = min(smallest, float(low[low > 0].min()))
        text = name.replace("_", " ")
        traces.append(
            scatter(
                x=np.concatenate([found.tau, found.tau[::-1]]),
                y=np.concatenate([high, low[::-1]]),
                mode="lines", fill="toself", fillcolor=band, line={"width": 0},
                hoverinfo="skip", showlegend=False,
            )
        )  # fmt: skip
        if fit is not None and fit.channels[name].squares().any():
            traces.append(
                scatter(
                    x=tau, y=factor * fit.curve(name, tau), mode="lines", showlegend=False,
                    line={"color": colour, "width": 1.6}, hoverinfo="skip",
                )
            )  # fmt: skip
        traces.append(
            scatter(
                x=found.tau, y=middle, name=text, mode="markers",
                marker={"color": colour, "size": 6},
                hovertemplate=text + "<br>%{x:.4g} s: %{y:.4g} " + unit + "<extra></extra>",
            )
        )  # fmt: skip
    if fit is not None and largest > 0.0:
        layout["annotations"] = []
        _asymptotes(fit, names, tau, factor, traces, layout, smallest)
    if largest > 0.0:
        bottom, top = float(np.log10(0.5 * smallest)), float(np.log10(1.6 * largest))
        layout["yaxis"].update(range=[bottom, top])
    return figure_of(traces, layout)


def _asymptotes(
    fit: NoiseFit, names: list[str], tau: Array, factor: float,
    traces: list[Any], layout: dict[str, Any], smallest: float,
) -> None:  # fmt: skip
    """Add each term alone as a dotted line with its symbol, of the channel that has most of it."""
    parts = np.array([fit.parts(name, tau) for name in names]) * factor
    for j, label in enumerate(_LABELS):
        most = int(np.argmax(parts[:, 0, j]))
        y = parts[most, :, j]
        inside = y > 0.6 * smallest
        if not y.any() or inside.sum() < 2:
            continue
        colour = _COLOURS[most % 3]
        x, y = tau[inside], y[inside]
        traces.append(
            scatter(
                x=x, y=y, mode="lines", showlegend=False, hoverinfo="skip",
                line={"color": colour, "width": 1.2, "dash": "dot"},
            )
        )  # fmt: skip
        # Rising lines are labelled at their end, the others at their beginning.
        at = -1 if label in "KR" else (len(x) * 2) // 5 if label == "B" else 0
        layout["annotations"].append(
            {
                "x": float(np.log10(x[at])), "y": float(np.log10(y[at])), "text": f"<b>{label}</b>",
                "showarrow": False, "font": {"color": colour},
                "xanchor": "right" if label in "KR" else "left", "yanchor": "bottom",
            }
        )  # fmt: skip


def _table(fit: NoiseFit) -> str:
    """Return the fitted terms as HTML: a row to a channel."""
    out = []
    for part, title in (("gyro", "Gyros"), ("accel", "Accelerometers")):
        names = [name for name in fit.channels if name.startswith(part)]
        if not names:
            continue
        terms = list(fit.channels[names[0]].terms)
        head = "".join(f'<th scope="col">{escape(t.replace("_", " "))}</th>' for t in terms)
        body = ""
        for name in names:
            found = fit.channels[name]
            cells = "".join(
                f'<td class="pair">{escape(term_text(found.terms[t]))}'
                f"<br><small>{escape(in_si(name, place, found.terms[t]))}</small></td>"
                for place, t in enumerate(terms)
            )
            misfit = percent(found.misfit) if found.misfit else "by chance"
            body += (
                f'<tr><th scope="row">{escape(name.replace("_", " "))}</th>{cells}'
                f"<td>{escape(misfit)}</td></tr>"
            )
        caption = f"{title}: ± 1 sigma, below it in SI; < where it is not observable, with 95 %"
        out.append(
            f"<table><caption>{escape(caption)}</caption><thead><tr><td></td>{head}"
            f'<th scope="col">misfit of the variance</th></tr></thead><tbody>{body}</tbody></table>'
        )
    return "".join(out)
