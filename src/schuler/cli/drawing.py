"""The options ``--report`` and ``--figures``, and the drawing that they request."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from typing import Any, TypeVar

import click

from schuler.cli.command import echo
from schuler.cli.parameters import OutputFile, OutputFolder
from schuler.errors import SchulerError, how_to_install

__all__ = ["draw", "draws", "report_option"]

F = TypeVar("F", bound=Callable[..., Any])

_FOLDER, _FORMAT = "schuler.figures", "schuler.figure_format"


def _needs(module: str, extra: str, what: str) -> None:
    """Say a missing library before the work, without the cost of importing it."""
    if find_spec(module) is None:
        raise SchulerError(
            f"{what} need {module.capitalize()}, which is not installed: {how_to_install(extra)}"
        )


def _report(ctx: click.Context, _: click.Parameter, value: str | None) -> str | None:
    if value is not None and not ctx.resilient_parsing:
        _needs("plotly", "report", "reports")
    return value


def _figures(ctx: click.Context, _: click.Parameter, value: str | None) -> None:
    if value is not None and not ctx.resilient_parsing:
        _needs("matplotlib", "plot", "figures")
    ctx.meta[_FOLDER] = value


def _format(ctx: click.Context, _: click.Parameter, value: str) -> None:
    ctx.meta[_FORMAT] = value


def report_option(text: str) -> Callable[[F], F]:
    """Return the options ``--report OUT.html``, as `report_to`, and ``--figures DIR``."""

    def decorate(function: F) -> F:
        """Add the options to a command."""
        for option in (
            click.option(
                "--figure-format", type=click.Choice(["svg", "png", "pdf"]), default="svg",
                show_default=True, expose_value=False, callback=_format,
                help="Of the files of --figures.",
            ),
            click.option(
                "--figures", type=OutputFolder(), metavar="DIR", expose_value=False,
                callback=_figures, help="Write each figure of the report as a file of its own.",
            ),
            click.option(
                "--report", "report_to", type=OutputFile(".html", ".htm"), metavar="OUT.html",
                callback=_report, help=text,
            ),
        ):  # fmt: skip
            function = option(function)
        return function

    return decorate


def draws(report_to: str | None) -> bool:
    """Say whether the running command was asked for a report or for figures."""
    return report_to is not None or click.get_current_context().meta.get(_FOLDER) is not None


def draw(result: object, report_to: str | None, **details: Any) -> None:
    """Write the report and the figures that the running command was asked for.

    Parameters
    ----------
    result : object
        A result, or several that share a page.
    report_to : str or None
        The report; none is written without it.
    **details
        What the report shows beside the result, as of `schuler.reports.report`.
    """
    meta = click.get_current_context().meta
    if report_to is not None:
        from schuler.reports import report

        report(result, report_to, **details)
    if meta.get(_FOLDER) is not None:
        from schuler.reports import save_figures

        for path in save_figures(result, meta[_FOLDER], meta[_FORMAT], **details):
            echo(f"wrote {path}", err=True)
