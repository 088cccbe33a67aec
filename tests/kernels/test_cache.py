"""The kernels' disk cache: in a folder of its own, never a condition, mended where damaged."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from schuler.kernels._cache import CACHE_FOLDER

USE = "from schuler.earth import gravity; print(f'{float(gravity(0.5)):.12f}')"
BY_NUMBA = "import schuler.kernels._machine_code as m; m.available = lambda: False; "
SUFFIXES = (".kernel", ".nbi", ".nbc")
EXPECTED = "9.7922046448"  # Somigliana at 0.5 rad

# Each test compiles in processes of its own, whatever this one does.
pytestmark = pytest.mark.compiled


def cached(folder):
    """Return the compiled kernels below a folder."""
    return sorted(path for suffix in SUFFIXES for path in folder.rglob(f"*{suffix}"))


def use(folder, code=USE, **environment):
    """Compute gravity in a process of its own, its cache below a folder."""
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code], capture_output=True, text=True, timeout=120,
        env={**os.environ, "SCHULER_CACHE_DIR": str(folder), "NUMBA_DISABLE_JIT": "0",
             **environment},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout.strip(), [li for li in done.stderr.splitlines() if "kernel cache" in li]


@pytest.fixture(scope="module", params=["machine code", "Numba"])
def fresh(tmp_path_factory, request):
    """Return a folder with compiled kernels in it, what they compute, and the code that does."""
    code = USE if request.param == "machine code" else BY_NUMBA + USE
    folder = tmp_path_factory.mktemp("cache")
    value, said = use(folder, code)
    assert not said
    return folder, value, code


def test_compiled_kernels_go_into_their_own_folder_and_come_from_there(fresh):
    folder, value, code = fresh
    written = {p: p.stat().st_mtime_ns for p in cached(folder)}
    assert CACHE_FOLDER is not None
    name = CACHE_FOLDER.rpartition("/")[2]
    assert written
    assert all(name in path.parts for path in written)
    assert use(folder, code) == (value, [])
    assert {p: p.stat().st_mtime_ns for p in cached(folder)} == written


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("damage", ["empty", "half", "flipped", "foreign"])
def test_a_damaged_file_is_said_once_and_made_anew(fresh, suffix, damage):
    folder, value, code = fresh
    hurt = [path for path in cached(folder) if path.suffix == suffix]
    if not hurt:
        pytest.skip("no such file where kernels are called this way")
    for path in hurt:
        data = path.read_bytes()
        path.write_bytes({
            "empty": b"", "half": data[: len(data) // 2], "foreign": b"cos\nsystem\n",
            "flipped": data[:50] + bytes([data[50] ^ 16]) + data[51:],
        }[damage])  # fmt: skip
    found, said = use(folder, code)
    assert found == value
    assert len(said) == 1
    assert "is damaged; the kernel is compiled again" in said[0]
    assert use(folder, code) == (value, [])


def test_a_full_disk_is_said_once_and_stops_nothing(tmp_path, fresh):
    code = (
        "import errno, schuler.kernels._cache as c, schuler.kernels._numba_cache as n\n"
        "def full(*_): raise OSError(errno.ENOSPC, 'No space left on device')\n"
        f"n._CheckedFile._open_for_write = full; c._put = full\n{fresh[2]}"
    )
    found, said = use(tmp_path, code)
    assert found == fresh[1]
    assert len(said) == 1
    assert "No space left on device" in said[0]


def test_without_a_writable_folder_a_private_one_is_taken(tmp_path, fresh, root):
    (tmp_path / "file").touch()
    before = cached(root / "src")
    code = fresh[2] + "; from schuler.kernels._cache import CACHE_FOLDER; print(CACHE_FOLDER)"
    own = tmp_path / "own"
    own.mkdir()
    found, said = use(tmp_path / "file" / "below", code, TMPDIR=str(own))
    value, folder = found.splitlines()
    assert (value, said) == (fresh[1], [])
    if hasattr(os, "getuid"):
        assert folder.startswith(str(own))
        # Where others may write, nothing is taken: compiled code is run.
        (own / f"schuler-kernels-{os.getuid()}").chmod(0o777)
        found, said = use(tmp_path / "file" / "below", code, TMPDIR=str(own))
        assert found.splitlines() == [fresh[1], "None"]
        assert len(said) == 1
    assert cached(root / "src") == before


def test_the_value_is_right(fresh):
    assert float(fresh[1]) == pytest.approx(float(EXPECTED), abs=1e-9)
