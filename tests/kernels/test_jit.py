"""The kernels' disk cache: in a folder of its own, or not at all."""

from __future__ import annotations

from schuler.kernels._jit import CACHE_FOLDER

USE = "from schuler.earth import gravity; print(f'{float(gravity(0.5)):.12f}')"


def cached(folder):
    """Return the compiled kernels below a folder."""
    return [*folder.rglob("*.nbi"), *folder.rglob("*.nbc")]


def test_compiled_kernels_go_into_their_own_folder_and_come_from_there(run_python, tmp_path):
    environment = {"SCHULER_CACHE_DIR": str(tmp_path), "NUMBA_DISABLE_JIT": "0"}
    first = run_python(USE, **environment)
    written = {p: p.stat().st_mtime_ns for p in cached(tmp_path)}
    assert {p.parent.parent.name for p in written} == {CACHE_FOLDER.rpartition("/")[2]}
    assert run_python(USE, **environment) == first
    assert {p: p.stat().st_mtime_ns for p in cached(tmp_path)} == written


def test_without_a_writable_folder_nothing_is_cached(run_python, tmp_path, root):
    (tmp_path / "file").touch()
    folder = str(tmp_path / "file" / "below")
    before = cached(root / "src")
    code = USE + "; from schuler.kernels import earth; print(earth.gravity_many._cache.__class__)"
    plain, kind = run_python(code, SCHULER_CACHE_DIR=folder, NUMBA_DISABLE_JIT="0").splitlines()
    assert plain == run_python(USE)
    assert "NullCache" in kind
    assert cached(root / "src") == before
