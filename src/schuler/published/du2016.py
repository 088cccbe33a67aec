"""Four gyros and rotation about one axis (Du, Mou and Cheng, 2016): life, accuracy, eight hours."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.modulation import RotationCase, Turned, end_errors, turned
from schuler.motion import Limits, Scheme, named_scheme
from schuler.published.figures import Curve, Figure
from schuler.published.result import Experiment, Options, Row, conditions, experiment
from schuler.sensors import Lifetime, Reliability, named_array

__all__ = ["end_distance", "run"]

Array = NDArray[np.float64]


def end_distance(case: RotationCase, scheme: Scheme | Turned, lat: float, psi: ArrayLike) -> Array:
    """Return the position error at the end, m, for each psi (counter-clockwise, deg)."""
    heading = -np.atleast_1d(np.asarray(psi, np.float64))
    motion = turned(scheme, case.duration) if isinstance(scheme, Scheme) else scheme
    found = end_errors(motion, case.errors, [lat], heading, case.site.height)
    return np.asarray(np.hypot(found[0, :, 0], found[0, :, 1]))


def _reliability_rows(case: dict[str, Any]) -> list[Row]:
    printed, life = case["printed"], Lifetime(case["array"]["life_h"])
    mtbf = {
        name: Reliability(named_array(name), life).mtbf
        for name in ("symmetric4", "triad", "triad-plus-one", "dodecahedron")
    }
    four, more = mtbf["symmetric4"], mtbf["dodecahedron"]
    text = "best: six gyros through the faces of a dodecahedron"
    rows = [
        Row("mean life over three gyros", "1", printed["over_triad"], four / mtbf["triad"],
            more / mtbf["triad"], note=text),
        Row("mean life over three and a duplicate", "1", printed["over_duplicate"],
            four / mtbf["triad-plus-one"], more / mtbf["triad-plus-one"], note=text),
        Row("mean life", "h", None, four, more,
             note=f"derived from the document's {case['array']['life_h']:g} h of one gyro; {text}"),
    ]  # fmt: skip
    for name in case["array"]["names"]:
        array = named_array(name)
        # No weights of the four or three gyros do better than least squares: it is the limit too.
        whole = array.variance().max()
        rows.append(
            Row(f"largest variance of an axis, {name}", "of one gyro", None, whole, whole, whole)
        )
        worst = [max(each["variance"]) for each in array.figures()["after_one_failure"]]
        rows.append(
            Row(f"largest variance of an axis after one failure, {name}", "of one gyro", None,
                max(worst), max(worst), max(worst))
        )  # fmt: skip
    return rows


def run(options: Options) -> Experiment:
    """Redo the figures of reliability, accuracy and eight hours of navigation.

    Parameters
    ----------
    options : Options
        Nothing is random here.
    """
    data = conditions("du2016", options.changes)
    case = RotationCase.from_dict(
        {**data["simulation"],
         **{key: data[key] for key in ("site", "errors", "single_axis", "two_axis")}},
        "du2016",
    )  # fmt: skip
    fixed = named_scheme("fixed")
    limits = case.single.limits
    # The document's own order is clockwise first, from the end of the travel.
    schemes = {
        "fixed": fixed, "single": case.single, "double": case.double,
        "clockwise": named_scheme("reciprocating-from-end", limits=limits, clockwise=True),
        "counter": named_scheme("reciprocating-from-end", limits=limits),
    }  # fmt: skip
    # Each scheme is integrated once, for all places and headings.
    motions = {name: turned(scheme, case.duration) for name, scheme in schemes.items()}
    printed = data["printed"]["reduction_percent"]
    rows = _reliability_rows(data)

    def reductions(lat: float, psi: ArrayLike) -> dict[str, Array]:
        way = {name: end_distance(case, motion, lat, psi) for name, motion in motions.items()}
        return {name: 100.0 * (1.0 - way[name] / way["fixed"]) for name in schemes}

    places = [(case.site.lat, psi) for psi in data["headings"]["psi"]]
    places += [(lat, psi) for lat, psi in data["headings"]["places"]]
    for k, (lat, psi) in enumerate(places):
        cut = reductions(lat, psi)
        rows.append(
            Row(f"error of 8 h less by, latitude {lat:g}, psi {psi:g}", "%",
                printed if k == 0 else None, cut["single"][0], cut["double"][0],
                note="best: two axes; latitude, psi and the start in mid-turn are fitted, the "
                f"document prints none; begun as it describes {cut['clockwise'][0]:.1f}")
        )  # fmt: skip
    lat, psi_fitted = data["headings"]["places"][0]
    cut = reductions(lat, psi_fitted)
    for name, text in (
        ("clockwise", "clockwise first, from the end of a turn: as described"),
        ("counter", "counter-clockwise first, from the end of a turn"),
        ("single", "from the middle of a turn: the start that was fitted"),
    ):
        rows.append(
            Row(f"error of 8 h less by, {text}", "%", printed if name == "clockwise" else None,
                cut[name][0], cut["double"][0],
                note=f"latitude {lat:g} and psi {psi_fitted:g} are fitted; best: two axes")
        )  # fmt: skip
    lat = case.site.lat
    psi = np.arange(0.0, 360.0, data["headings"]["all_psi_step"])
    cut = reductions(lat, psi)
    for name, pick in (("least", np.argmin), ("largest", np.argmax)):
        one, two = int(pick(cut["single"])), int(pick(cut["double"]))
        rows.append(
            Row(f"error of 8 h less by, {name} of all headings, latitude {lat:g}", "%", None,
                cut["single"][one], cut["double"][two], note=f"at psi = {psi[one]:g} deg")
        )  # fmt: skip
    one_way = turned(
        named_scheme("continuous", limits=Limits(case.single.limits.rate)), case.duration
    )
    for lat in data["one_way"]["latitudes"]:
        way, back = (end_distance(case, m, lat, 0.0)[0] for m in (one_way, motions["single"]))
        rows.append(
            Row(f"error of 8 h turned one way, latitude {lat:g}, psi 0", "km", None, 1e-3 * way,
                1e-3 * back, note="best: to and fro")
        )  # fmt: skip
    if options.progress is not None:
        options.progress(1, 1)
    figure = Figure(
        f"Position error of 8 h by heading, latitude {case.site.lat:g} deg",
        "psi, counter-clockwise from north, deg", "error less than without rotation by, %",
        (Curve("single axis", psi, cut["single"]),
         Curve("single axis, clockwise from an end of its travel", psi, cut["clockwise"]),
         Curve("two axes", psi, cut["double"])),
    )  # fmt: skip
    return experiment(data, "du2016", options, 1, rows, (figure,))
