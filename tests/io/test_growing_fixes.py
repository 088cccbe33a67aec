"""A file of fixes that grows: whole lines, only what is new, and what cannot be followed."""

from __future__ import annotations

import gzip

import numpy as np
import pytest

from schuler.errors import InputError
from schuler.io.growing_fixes import GrowingFixes

HEAD = "time [s],lat [deg],lon [deg],height [m],ve [m/s],vn [m/s],vu [m/s]\n"


def lines(first, last):
    return "".join(f"{t},48.1{t},11.5,500,1,2,0\n" for t in range(first, last))


def test_only_what_is_new_and_whole(tmp_path):
    path = tmp_path / "gnss.csv"
    path.write_text(HEAD)
    growing = GrowingFixes(path, sigma=1.0)
    assert len(growing.rows()) == 0
    assert growing.trouble is not None
    got = []
    for text in (lines(0, 3) + "3,48", ".13,11.5,500,1,2,0\n", "", lines(4, 9)):
        with path.open("a") as file:
            file.write(text)
        got.append(growing.rows())
    assert [each[:, 0].tolist() for each in got] == [[0, 1, 2], [3], [], [4, 5, 6, 7, 8]]
    assert growing.trouble is None
    np.testing.assert_array_equal(got[0][:, 4:7], 1.0)


def test_a_file_that_becomes_shorter_or_is_gone(tmp_path):
    path = tmp_path / "gnss.csv"
    path.write_text(HEAD + lines(0, 4))
    growing = GrowingFixes(path)
    growing.rows()
    path.write_text(HEAD)
    with pytest.raises(InputError, match="has become shorter"):
        growing.rows()
    path.unlink()
    with pytest.raises(InputError, match="cannot be read"):
        growing.rows()


def test_what_cannot_be_followed(tmp_path):
    packed = tmp_path / "gnss.csv.gz"
    packed.write_bytes(gzip.compress(HEAD.encode()))
    with pytest.raises(InputError, match="is compressed"):
        GrowingFixes(packed)
    with pytest.raises(InputError, match="no regular file"):
        GrowingFixes(tmp_path)
