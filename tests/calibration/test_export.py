"""A calibration in other tools' files corrects outputs as it does here."""

from __future__ import annotations

import re

import numpy as np
import pytest

from schuler.calibration import Calibration, export_calibration
from schuler.calibration.export import calibration_texts, kalibr_matrices
from schuler.errors import InputError

C = Calibration(
    gyro_bias=np.array([0.01, -0.02, 0.03]), accel_bias=np.array([0.1, -0.2, 0.05]),
    gyro_matrix=np.array([[1.02, 0.01, -0.005], [-0.01, 0.98, 0.008], [0.003, -0.006, 1.01]]),
    accel_matrix=np.array([[1.01, 0.003, -0.002], [0.0, 0.99, 0.004], [0.0, 0.0, 1.02]]),
    name="bench",
)  # fmt: skip
OUTPUT = np.array([0.3, -9.7, 1.2])
ACCELERATION = C.accel_matrix @ (OUTPUT - C.accel_bias)
RATE = C.gyro_matrix @ (OUTPUT - C.gyro_bias)


def test_imu_tk_corrects_by_misalignment_scale_and_bias(tmp_path):
    files = export_calibration(C, "imu_tk", tmp_path / "bench")
    assert [path.name for path in files] == ["bench.acc", "bench.gyro"]
    for path, true in zip(files, (ACCELERATION, RATE), strict=True):
        numbers = np.array(path.read_text().split(), float)
        t, k, b = numbers[:9].reshape(3, 3), numbers[9:18].reshape(3, 3), numbers[18:]
        assert len(b) == 3
        np.testing.assert_allclose(np.diag(t), 1.0, atol=1e-11)
        np.testing.assert_array_equal(k, np.diag(np.diag(k)))
        np.testing.assert_allclose(t @ k @ (OUTPUT - b), true, rtol=1e-9)


def arrays(text):
    """Return the matrices and vectors of a YAML file by their keys, in their order."""
    found = []
    for key, inline, block in re.findall(
        r"^ *(\w+):(?: \[(.*)\])?\n((?: *- \[.*\]\n)*)", text, re.M
    ):
        numbers = [float(v) for v in re.findall(r"-?\d[\d.e+-]*", inline or block)]
        if inline or block:
            found.append((key, np.reshape(numbers, (3, 3)) if len(numbers) == 9 else numbers))
    return found


def test_kalibr_s_matrices_are_lower_triangular_and_give_the_outputs():
    found = arrays(calibration_texts(C, "kalibr")[""])
    assert [key for key, _ in found] == [
        "C_i_output", "M", "bias", "M", "C_gyro_i", "A", "bias"
    ]  # fmt: skip
    body, accel, accel_bias, gyro, rotation, _, gyro_bias = (np.asarray(v) for _, v in found)
    for triangle in (accel, gyro):
        np.testing.assert_allclose(triangle, np.tril(triangle), atol=1e-12)
        assert np.all(np.diag(triangle) > 0)
    for matrix in (body, rotation):
        np.testing.assert_allclose(matrix @ matrix.T, np.eye(3), atol=1e-8)
        assert np.linalg.det(matrix) == pytest.approx(1.0)
    np.testing.assert_allclose(accel @ body @ ACCELERATION + accel_bias, OUTPUT, rtol=1e-7)
    np.testing.assert_allclose(gyro @ rotation @ body @ RATE + gyro_bias, OUTPUT, rtol=1e-7)
    # And as the comment in the file says to apply it.
    f = body.T @ np.linalg.solve(accel, OUTPUT - accel_bias)
    w = body.T @ rotation.T @ np.linalg.solve(gyro, OUTPUT - gyro_bias)
    np.testing.assert_allclose(f, ACCELERATION, rtol=1e-7)
    np.testing.assert_allclose(w, RATE, rtol=1e-7)
    np.testing.assert_allclose(kalibr_matrices(C)[0], accel, atol=1e-8)


def test_ros_corrects_by_one_matrix_and_what_is_taken_off_after_it():
    found = dict(arrays(calibration_texts(C, "ros")[""]))
    np.testing.assert_allclose(found["SM"] @ OUTPUT - found["bias"], ACCELERATION, rtol=1e-7)
    np.testing.assert_allclose(found["gyro_SM"] @ OUTPUT - found["gyro_bias"], RATE, rtol=1e-7)


def test_accelerometers_alone_have_no_gyros(tmp_path):
    assert "gyro_SM" not in calibration_texts(C, "ros", has_gyros=False)[""]
    assert "gyroscopes" not in calibration_texts(C, "kalibr", has_gyros=False)[""]
    files = export_calibration(C, "imu_tk", tmp_path / "a", has_gyros=False)
    assert [path.name for path in files] == ["a.acc"]


def test_another_tool_is_refused():
    with pytest.raises(InputError, match="no tool 'matlab' to export to: imu_tk, kalibr, ros"):
        export_calibration(C, "matlab", "x")


def test_a_tool_that_reads_other_axes_has_the_calibration_in_these(tmp_path):
    from schuler.io.axes import parse_axes

    turn = np.array(parse_axes("FRD").matrix())
    np.testing.assert_array_equal(turn @ [1.0, 2.0, 3.0], [2.0, 1.0, -3.0])
    export_calibration(C, "ros", tmp_path / "frd.yaml", axes=turn)
    found = dict(arrays((tmp_path / "frd.yaml").read_text()))
    frd = turn.T @ OUTPUT
    np.testing.assert_allclose(found["SM"] @ frd - found["bias"], turn.T @ ACCELERATION, rtol=1e-7)
