"""Kernels that are compiled ahead: the list names what there is, and only fitting code is taken."""

from __future__ import annotations

import inspect
from importlib import import_module

import pytest

from schuler.kernels import _cache as cache
from schuler.kernels import _machine_code as machine_code
from schuler.kernels.ahead import signatures


def test_the_list_names_kernels_and_as_many_types_as_they_have_arguments():
    found = signatures()
    assert len(found) == len(set(found)) > 40
    for place, words in found:
        module, name = place.split(".")
        function = getattr(import_module(f"schuler.kernels.{module}"), name)
        count = len(inspect.signature(getattr(function, "py_func", function)).parameters)
        assert len(words) == count, place


def test_the_first_commands_take_a_part_of_the_list_which_keeps_its_order():
    found = signatures()
    first = signatures(first=True)
    assert 20 < len(first) < len(found)
    assert [each for each in found if each in first] == first


@pytest.mark.compiled
@pytest.mark.skipif(not machine_code.available(), reason="kernels are called through Numba")
def test_code_that_was_compiled_ahead_is_taken_if_it_is_of_these_sources(tmp_path, monkeypatch):
    name = "quat.nothing-000000000000.kernel"
    monkeypatch.setattr(cache, "AHEAD", tmp_path)
    monkeypatch.setattr(cache, "CACHE_FOLDER", str(tmp_path))
    cache.write_code(name, b"header", b"code")
    monkeypatch.setattr(cache, "CACHE_FOLDER", None)
    for written, taken in (("0" * 64, False), (cache.sources_digest(), True)):
        (tmp_path / "sources").write_text(written)
        cache._compiled_ahead.cache_clear()
        fits = taken and machine_code.runs_generic_code()
        assert cache.read_code(name) == ((b"header", b"code") if fits else None)
    cache._compiled_ahead.cache_clear()
