"""No output may destroy an input, another output or a special file; held for each command."""

from __future__ import annotations

import os
import stat
import subprocess
import sys
import threading
from importlib import import_module

import click
import pytest

from schuler.cli import _COMMANDS
from schuler.cli.parameters import InputFile, OutputFile

FILLED = {"--angles": "0,120,240", "--spec": "navigation-fog", "--lat": "40"}
"""What commands ask for, beside their files."""


def leaves():
    """Return each command that does something, with the words that call it."""
    found = {}
    for name in _COMMANDS:
        command = import_module(f"schuler.cli.{name}").command
        below = command.commands if isinstance(command, click.Group) else {None: command}
        found.update({(name, *([sub] if sub else [])): each for sub, each in below.items()})
    return found


LEAVES = leaves()


def options(kind):
    """Return (words, command, parameter) for each parameter of a kind of file."""
    return [
        pytest.param(words, command, param, id=f"{' '.join(words)} {param.opts[0]}")
        for words, command in LEAVES.items()
        for param in command.params
        if isinstance(param.type, kind)
    ]


def words_for(words, command, path):
    """Return words that get past the parser, each file argument being `path`."""
    out = list(words)
    for param in command.params:
        if isinstance(param, click.Argument):
            out.append(str(path) if isinstance(param.type, InputFile) else "x")
        elif param.required:
            named = isinstance(param.type, InputFile)
            out += [param.opts[0], str(path) if named else FILLED[param.opts[0]]]
    return out


@pytest.fixture
def precious(tmp_path, monkeypatch):
    """Return a file that must stay as it is."""
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "precious.html"
    path.write_text("measured once\n")
    return path


def test_each_option_that_names_an_output_is_checked():
    for command in LEAVES.values():
        for param in command.params:
            if isinstance(param, click.Option) and (param.metavar or "").startswith("OUT"):
                assert isinstance(param.type, OutputFile), f"{command.name} {param.opts}"


@pytest.mark.parametrize(("words", "command", "param"), options(OutputFile))
def test_an_output_never_replaces_an_input(words, command, param, run, precious):
    suffix = param.type.suffixes[0] if param.type.suffixes else ".html"
    source = precious.rename(precious.with_suffix(suffix))
    link = source.with_name(f"link{suffix}")
    link.symlink_to(source)
    hard = source.with_name(f"hard{suffix}")
    os.link(source, hard)
    reads = [p for p in command.params if isinstance(p.type, InputFile)]
    if not reads:
        pytest.skip(f"{' '.join(words)} reads no file")
    base = words_for(words, command, source)
    if not any(isinstance(p, click.Argument) for p in reads):
        base += [reads[0].opts[0], str(source)]
    for target in (source, link, hard, f"./{source.name}"):
        done = run(*base, param.opts[0], target)
        assert done.code == 2, (target, done)
        assert "replaces an input" in done.err
        assert source.read_text() == "measured once\n"
        assert link.is_symlink()


@pytest.mark.parametrize(("words", "command", "param"), options(OutputFile))
def test_a_place_that_cannot_be_written_is_said_before_the_work(
    words, command, param, run, precious, tmp_path
):
    suffix = param.type.suffixes[0] if param.type.suffixes else ".html"
    base = words_for(words, command, precious)
    for target, said in (
        (tmp_path / "absent" / f"x{suffix}", "there is no folder"),
        (tmp_path / f"{'x' * 300}{suffix}", "too long"),
        (tmp_path, "is a folder"),
        (f"nul\0{suffix}", "no name of a file"),
    ):
        done = run(*base, param.opts[0], target)
        assert done.code == 2
        assert said in done.err, done.err
        assert "Traceback" not in done.err


@pytest.mark.parametrize(("words", "command", "param"), options(OutputFile))
def test_a_suffix_of_another_format_is_refused(words, command, param, run, precious):
    if not param.type.suffixes:
        pytest.skip("its content has no suffix of its own")
    done = run(*words_for(words, command, precious), param.opts[0], "x.pdf")
    assert done.code == 2
    assert "ends in .pdf; expected a name in" in done.err
    assert not os.path.exists("x.pdf")


def test_two_outputs_into_one_file_are_refused(run, csv, tmp_path):
    target = tmp_path / "x"
    done = run("align", csv, "--lat", 40, "--json", target, "--report", target)
    assert (done.code, target.exists()) == (2, False)
    assert "both name" in done.err
    done = run("align", csv, "--lat", 40, "--json", "-", "--report", "-")
    assert "cannot both go to standard output" in done.err


def test_the_mapping_beside_a_record_is_an_input_too(run, csv):
    sidecar = csv.with_name(f"{csv.name}.toml")
    done = run("allan", csv, "--save-spec", sidecar)
    assert (done.code, sidecar.exists()) == (2, False)
    done = run("align", csv, "--lat", 40, "--save-mapping", "--calibration", sidecar)
    assert done.code == 2
    assert "--save-mapping" in done.err


def test_a_scenario_s_instrument_is_an_input_too(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    spec = tmp_path / "mine.toml"
    spec.write_text('[gyro]\nbias = "0.01 deg/h"\n[accelerometer]\nbias = "50 ug"\n')
    text = spec.read_text()
    (tmp_path / "s.toml").write_text(
        'duration = "2 s"\nrate = "20 Hz"\ninstrument = "mine.toml"\n'
        '[site]\nlat = 40\n[motion]\nkind = "static"\nheading = 30\n'
    )
    os.symlink("mine.toml", "mine.json")
    done = run("simulate", "s.toml", "--json", "mine.json")
    assert done.code == 2, done
    assert "replaces an input" in done.err
    assert spec.read_text() == text
    assert not (tmp_path / "s.parquet").exists()


def test_what_was_written_is_named(run, csv, tmp_path):
    page, data = tmp_path / "a.html", tmp_path / "a.json"
    done = run("align", csv, "--lat", 40, "--json", data, "--report", page)
    assert done.code == 0
    assert [line for line in done.err.splitlines() if line.startswith("wrote ")] == [
        f"wrote {data}", f"wrote {page}",
    ]  # fmt: skip


def test_symlinks_are_followed_and_permissions_kept(run, csv, tmp_path):
    real, link = tmp_path / "real.json", tmp_path / "link.json"
    real.write_text("old")
    real.chmod(0o640)
    link.symlink_to(real)
    assert run("info", csv, "--json", link).code == 0
    assert link.is_symlink()
    assert real.read_text().startswith("{")
    assert stat.S_IMODE(real.stat().st_mode) == 0o640


@pytest.mark.skipif(not os.path.exists("/dev/null"), reason="there is no /dev/null here")
def test_a_device_is_written_to_and_stays_one(run, csv):
    assert run("info", csv, "--json", "/dev/null").code == 0
    assert stat.S_ISCHR(os.stat("/dev/null").st_mode)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no FIFOs here")
def test_a_fifo_is_written_to_and_stays_one(run, csv, tmp_path):
    fifo = tmp_path / "pipe"
    os.mkfifo(fifo)
    got = []
    reader = threading.Thread(target=lambda: got.append(fifo.read_text()))
    reader.start()
    assert run("info", csv, "--json", fifo).code == 0
    reader.join(30)
    assert got
    assert got[0].startswith("{")
    assert stat.S_ISFIFO(fifo.stat().st_mode)


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="there is no /dev/full here")
def test_a_full_device_is_one_sentence(run, csv):
    done = run("info", csv, "--json", "/dev/full")
    assert done.code == 2
    assert "/dev/full: cannot be written" in done.err


@pytest.mark.skipif(
    sys.platform != "linux" or os.geteuid() == 0, reason="root may write everywhere"
)
def test_a_folder_without_permission_is_said(run, csv, tmp_path):
    shut = tmp_path / "shut"
    shut.mkdir(mode=0o500)
    done = run("info", csv, "--json", shut / "x.json")
    assert done.code == 2
    assert "may not be written to" in done.err


def test_the_files_of_a_campaign_are_no_outputs(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "s.toml").write_text(
        'duration = "5 s"\nrate = "20 Hz"\ninstrument = "navigation-fog"\n'
        '[site]\nlat = 40\n[motion]\nkind = "static"\nheading = 30\n'
    )
    words = ("campaign", "s.toml", "--runs", 2, "--workers", 0, "--method", "centred")
    assert run(*words, "--out", "o").code == 0
    before = (tmp_path / "o" / "results.parquet").read_bytes()
    os.symlink("o/results.parquet", "page.html")
    for option, target in (("--json", "o/campaign.json"), ("--report", "page.html")):
        done = run(*words, "--out", "o", option, target)
        assert done.code == 2, done
        assert "the campaign's store" in done.err
    assert (tmp_path / "o" / "results.parquet").read_bytes() == before


def test_a_name_that_is_no_text(tmp_path):
    """A name on a disk may be any bytes: what is written and read there is whole."""
    odd = os.fsencode(tmp_path) + b"/\xff"
    try:
        os.mkdir(odd)
    except OSError:
        pytest.skip("this file system takes names in UTF-8 only")

    def run(*words):
        return subprocess.run(
            [sys.executable, "-m", "schuler", *words], capture_output=True, text=True, timeout=300
        )

    done = run("demo", "--out", odd, "--minutes", "0.2")
    assert done.returncode == 0, done.stderr
    again = run("align", odd + b"/demo.parquet", "--lat", "40", "--json", "-")
    assert again.returncode == 0, again.stderr
    assert '"schema": "schuler.alignment/3"' in again.stdout
