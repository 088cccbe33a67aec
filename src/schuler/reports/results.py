"""Which page shows which result, and what follows from it: reports, figures, plots, files."""

from __future__ import annotations

import re
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

from schuler._result import Result
from schuler.errors import InputError
from schuler.reports.page import Page, write_page

__all__ = [
    "PAGES",
    "PAGES_OF_SEVERAL",
    "figures_of",
    "make_page",
    "page_of",
    "plot_of",
    "report",
    "save_figures",
    "write_plot",
]

#: class -> module of `schuler.reports` and the function there that makes its page
PAGES = {
    "schuler.alignment.latitude.LatitudeFix": "alignment.latitude_page",
    "schuler.alignment.compare.Comparison": "compare.comparison_page",
    "schuler.alignment.compare_records.RecordComparison": "compare.records_page",
    "schuler.alignment.limit_table.LimitTable": "limit.limit_page",
    "schuler.alignment.moving.planned.PathTable": "limit.path_page",
    "schuler.alignment.result.Alignment": "alignment.alignment_page",
    "schuler.alignment.table_north.TableNorth": "north.north_page",
    "schuler.alignment.windows.Windows": "alignment.windows_page",
    "schuler.allan_variance.noise_fit.NoiseFit": "allan.noise_page",
    "schuler.allan_variance.result.Allan": "allan.allan_page",
    "schuler.calibration.doppler.BodyVelocityFit": "calibrate.doppler_page",
    "schuler.calibration.poses_result.PosesFit": "calibrate.poses_page",
    "schuler.calibration.systematic.SystematicFit": "calibrate.systematic_page",
    "schuler.calibration.table_result.TableTest": "calibrate.table_page",
    "schuler.campaigns.run.Results": "campaign.results_page",
    "schuler.campaigns.scatter.Scatter": "campaign.scatter_page",
    "schuler.centrifuge.plan.Plan": "plan.one_plan_page",
    "schuler.centrifuge.result.CentrifugeTest": "centrifuge.platform_page",
    "schuler.modulation.compare.RotationComparison": "rotation.rotation_page",
    "schuler.modulation.history.RotationHistory": "rotation.history_page",
    "schuler.navigation.aided_result.AidedNavigation": "aided.aided_page",
    "schuler.navigation.evaluate.Evaluation": "navigation.evaluation_page",
    "schuler.navigation.free_result.FreeNavigation": "navigation.free_page",
    "schuler.published.result.Experiment": "published.experiment_page",
    "schuler.reports.overview.Overview": "overview.overview_page",
    "schuler.sensors.fault_scan.FaultScan": "array.faults_page",
    "schuler.sensors.figures.ArrayFigures": "array.array_page",
    "schuler.trajectory.Trajectory": "navigation.navigation_page",
}


#: class -> the same for several results of it, a list
PAGES_OF_SEVERAL = {
    "schuler.centrifuge.plan.Plan": "plan.plan_page",
    "schuler.published.result.Experiment": "published.experiments_page",
}


def _maker(result: object) -> Callable[..., Page]:
    several = isinstance(result, list | tuple) and len(result) > 0
    one, pages = (result[0], PAGES_OF_SEVERAL) if several else (result, PAGES)  # type: ignore[index]
    for kind in type(one).__mro__:
        name = pages.get(f"{kind.__module__}.{kind.__qualname__}")
        if name is not None:
            module, _, function = name.partition(".")
            found: Callable[..., Page] = getattr(
                import_module(f"schuler.reports.{module}"), function
            )
            return found
    known = sorted(name.rpartition(".")[2] for name in PAGES)
    raise InputError(
        f"a report is made of a result, got {type(result).__name__}: give one of {', '.join(known)}"
    )


def page_of(result: object, **details: Any) -> Page:
    """Return the page of a result.

    Parameters
    ----------
    result : object
        A result of schuler.
    **details
        What the page's function takes beside it, as ``evaluation=`` of a `Trajectory`.

    Raises
    ------
    InputError
        If it is no result.
    """
    if isinstance(result, Result) and not details:
        page: Page = result._page
        return page
    return make_page(result, **details)


def make_page(result: object, **details: Any) -> Page:
    """Make the page of a result anew; see `page_of`."""
    return _maker(result)(result, **details)


def report(result: object, path: str | Path, **details: Any) -> Path:
    """Write a self-contained interactive HTML report.

    Parameters
    ----------
    result : object
        Any result: an `Alignment`, `Windows`, `Comparison`, `Allan`, `Trajectory` and so on.
    path : str or Path
        The HTML file; it appears whole or not at all.
    **details
        What a report shows beside its result: ``evaluation=`` of a `Trajectory` or an aided
        navigation.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    InputError
        If the file cannot be written, or it is no result.
    SchulerError
        If Plotly is not installed.

    Examples
    --------
    >>> sc.report(sc.align(record, site, spec=spec), "fix.html").name
    'fix.html'
    """
    write_page(page_of(result, **details), path)
    return Path(path)


def figures_of(result: object, **details: Any) -> dict[str, Any]:
    """Return the Plotly figures of a result's report by their names.

    Raises
    ------
    SchulerError
        If Plotly is not installed.
    """
    return {d.name: d.figure.to_plotly() for d in page_of(result, **details).drawings}


def plot_of(result: object, name: str | None = None, ax: Any = None, **details: Any) -> Any:
    """Return a Matplotlib figure with a result's figures, or one of them; see `Result.plot`."""
    from schuler.reports.matplotlib_figures import draw_all, draw_one

    drawings = page_of(result, **details).drawings
    if name is None and ax is None:
        return draw_all([(d.name, d.figure) for d in drawings])
    if name is None:
        return draw_one(drawings[0].figure, ax)
    for drawing in drawings:
        if drawing.name == name:
            return draw_one(drawing.figure, ax)
    raise InputError(
        f"there is no figure '{name}' of a {type(result).__name__}: its figures are "
        f"{', '.join(repr(d.name) for d in drawings)}"
    )


def save_figures(
    result: object, folder: str | Path, kind: str = "svg", **details: Any
) -> list[Path]:
    """Write each figure of a result as a file of its own, by Matplotlib, without a browser.

    Parameters
    ----------
    result : object
    folder : str or Path
        Made where there is none.
    kind : {"svg", "png", "pdf"}

    Returns
    -------
    list of Path
        The files, named by the figures.

    Raises
    ------
    InputError
        If the folder cannot be written, or for another kind.
    SchulerError
        If Matplotlib is not installed.

    Examples
    --------
    >>> paths = save_figures(noise_fit, "figures", "svg")
    >>> paths[0].suffix
    '.svg'
    """
    from schuler.reports.matplotlib_figures import KINDS, write_picture

    if kind not in KINDS:
        raise InputError(f"figures are written as {', '.join(KINDS)}, not as '{kind}'")
    folder = Path(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be made ({error.strerror or error})") from None
    out = []
    for drawing in page_of(result, **details).drawings:
        path = folder / f"{_file_name(drawing.name)}.{kind}"
        write_picture([(drawing.name, drawing.figure)], path)
        out.append(path)
    return out


def write_plot(result: object, path: str | Path, **details: Any) -> None:
    """Write all figures of a result as one picture: .svg, .png or .pdf.

    Raises
    ------
    InputError
        If the suffix is another, or the file cannot be written.
    SchulerError
        If Matplotlib is not installed.
    """
    from schuler.reports.matplotlib_figures import write_picture

    write_picture([(d.name, d.figure) for d in page_of(result, **details).drawings], path)


def _file_name(name: str) -> str:
    """Return a figure's name as a file's: small letters, digits and hyphens."""
    return re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-") or "figure"
