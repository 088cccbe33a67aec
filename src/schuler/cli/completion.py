"""The command ``schuler completion``, and what the shell may complete."""

from __future__ import annotations

from pathlib import Path

import click
from click.shell_completion import CompletionItem

from schuler.cli.command import Command

__all__ = ["command", "files", "methods", "prefilters", "scenarios", "specs"]

_WHERE = {
    "bash": 'put  eval "$(schuler completion bash)"  into ~/.bashrc',
    "zsh": 'put  eval "$(schuler completion zsh)"  into ~/.zshrc, after compinit',
    "fish": "schuler completion fish > ~/.config/fish/completions/schuler.fish",
}


@click.command("completion", cls=Command)
@click.argument("shell", type=click.Choice(list(_WHERE)))
def command(shell: str) -> None:
    """Print the lines that let a SHELL complete commands, options, methods and files.

    \b
    bash:  eval "$(schuler completion bash)"     in ~/.bashrc
    zsh:   eval "$(schuler completion zsh)"      in ~/.zshrc, after compinit
    fish:  schuler completion fish > ~/.config/fish/completions/schuler.fish
    """  # noqa: D301
    from click.shell_completion import get_completion_class

    from schuler.cli import cli

    kind = get_completion_class(shell)
    assert kind is not None
    # The class's check of the shell's version runs the shell; its lines do not need it.
    comp = kind(cli, {}, "schuler", "_SCHULER_COMPLETE")
    click.echo(f"# {_WHERE[shell]}\n{comp.source_template % comp.source_vars()}")


def _matching(names: list[str], begun: str) -> list[CompletionItem]:
    return [CompletionItem(name) for name in names if name.startswith(begun)]


def files(ctx: click.Context, param: click.Parameter, begun: str) -> list[CompletionItem]:
    """Let the shell complete a file."""
    return [CompletionItem(begun, type="file")]


def scenarios(ctx: click.Context, param: click.Parameter, begun: str) -> list[CompletionItem]:
    """Complete TOML files and folders."""
    return _toml(begun)


def _toml(begun: str) -> list[CompletionItem]:
    head, slash, tail = begun.rpartition("/")
    folder = Path(head or ("/" if slash else "."))
    try:
        found = sorted(folder.iterdir())
    except OSError:
        return []
    return [
        CompletionItem(f"{head}{slash}{path.name}" + ("/" if path.is_dir() else ""))
        for path in found
        if path.name.startswith(tail or "") and not path.name.startswith(".")
        and (path.is_dir() or path.suffix == ".toml")
    ]  # fmt: skip


def methods(ctx: click.Context, param: click.Parameter, begun: str) -> list[CompletionItem]:
    """Complete the name of a method."""
    from schuler.alignment import METHODS

    return _matching(list(METHODS), begun)


def prefilters(ctx: click.Context, param: click.Parameter, begun: str) -> list[CompletionItem]:
    """Complete the name of a prefilter."""
    from schuler.prefilter import PREFILTERS

    return _matching(["none", *PREFILTERS], begun)


def specs(ctx: click.Context, param: click.Parameter, begun: str) -> list[CompletionItem]:
    """Complete a grade of instrument, or a TOML file."""
    from schuler.sensors import GRADES

    return [*_matching(list(GRADES), begun), *_toml(begun)]
