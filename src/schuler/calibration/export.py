"""A calibration as the files of other tools, with what each of their matrices means.

schuler holds, for each triad, true = matrix (output - bias).

imu_tk
    true = T K (output - bias): K is the diagonal of the matrix, T = matrix K^-1 has ones on its
    diagonal. One file for each triad: T, K, bias as plain numbers.
kalibr
    The scale-misalignment model: output = M true + bias for the accelerometers, and
    output = M C true + bias for the gyros, M lower triangular, C a rotation from the axes of the
    accelerometers to those of the gyros. Lower triangular matrices belong to other body axes than
    the upper triangular ones here: the rotation between them is in the file.
ros
    imu_calib's accelerometer parameters: corrected = SM output - bias; the same for the gyros.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler._files import replacing
from schuler._version import __version__
from schuler.calibration.apply import Calibration
from schuler.errors import InputError, printable

__all__ = ["CALIBRATION_TOOLS", "calibration_texts", "export_calibration", "kalibr_matrices"]

Array = NDArray[np.float64]


def _numbers(values: Array) -> str:
    return ", ".join(f"{v + 0.0:.9g}" for v in np.ravel(values))


def _yaml_matrix(name: str, matrix: Array, indent: str) -> list[str]:
    return [f"{indent}{name}:", *(f"{indent}- [{_numbers(row)}]" for row in matrix)]


def _imu_tk_triad(matrix: Array, bias: Array) -> str:
    scale = np.diag(np.diag(matrix))
    parts = [matrix @ np.linalg.inv(scale), scale, bias[:, None]]
    return "\n".join(
        "\n".join(" ".join(f"{v + 0.0:.12g}" for v in row) for row in part) + "\n" for part in parts
    )


def _imu_tk(c: Calibration, has_gyros: bool) -> dict[str, str]:
    """Return the texts of the two files: plain numbers have no place for a comment."""
    out = {".acc": _imu_tk_triad(c.accel_matrix, c.accel_bias)}
    if has_gyros:
        out[".gyro"] = _imu_tk_triad(c.gyro_matrix, c.gyro_bias)
    return out


def kalibr_matrices(calibration: Calibration) -> tuple[Array, Array, Array, Array]:
    """Return M of the accelerometers, M and C of the gyros, and the rotation of the body axes.

    Returns
    -------
    accel_m, gyro_m : (3, 3) float64
        Lower triangular, diagonals positive.
    rotation_gyro : (3, 3) float64
        C: from the new body axes to the axes of the gyros.
    rotation_body : (3, 3) float64
        From the axes of the outputs to the new ones.
    """
    accel_m, rotation_body = _lower_times_rotation(np.linalg.inv(calibration.accel_matrix))
    gyro_m, rotation_gyro = _lower_times_rotation(
        np.linalg.inv(calibration.gyro_matrix) @ rotation_body.T
    )
    return accel_m, gyro_m, rotation_gyro, rotation_body


def _lower_times_rotation(matrix: ArrayLike) -> tuple[Array, Array]:
    """Return L and Q with matrix = L Q, L lower triangular with a positive diagonal."""
    q, r = np.linalg.qr(np.asarray(matrix, np.float64).T)
    signs = np.sign(np.diag(r))
    return (signs[:, None] * r).T, (q * signs).T


def _kalibr(c: Calibration, has_gyros: bool) -> dict[str, str]:
    accel_m, gyro_m, rotation_gyro, rotation_body = kalibr_matrices(c)
    lines = [
        f"# {printable(c.name)}, by schuler {__version__}: Kalibr's scale-misalignment model.",
        "# accelerometers: output = M f + bias;  gyros: output = M C_gyro_i w + bias",
        "# M is lower triangular in body axes i of its own: i = C_i_output b. In Python:",
        "#   C = np.array(C_i_output)",
        "#   f = C.T @ np.linalg.solve(accelerometer_M, accelerometer - accelerometer_bias)",
        "#   w = C.T @ C_gyro_i.T @ np.linalg.solve(gyro_M, gyro - gyro_bias)",
        "imu0:",
        "  model: scale-misalignment",
        *_yaml_matrix("C_i_output", rotation_body, "  "),
        "  accelerometers:",
        *_yaml_matrix("M", accel_m, "    "),
        f"    bias: [{_numbers(c.accel_bias)}]",
    ]
    if has_gyros:
        lines += [
            "  gyroscopes:",
            *_yaml_matrix("M", gyro_m, "    "),
            *_yaml_matrix("C_gyro_i", rotation_gyro, "    "),
            *_yaml_matrix("A", np.zeros((3, 3)), "    "),
            f"    bias: [{_numbers(c.gyro_bias)}]",
        ]
    return {"": "\n".join(lines) + "\n"}


def _ros(c: Calibration, has_gyros: bool) -> dict[str, str]:
    lines = [
        f"# {printable(c.name)}, by schuler {__version__}: SM and bias of imu_calib, row by row.",
        "# To apply it in Python (gyros likewise, where they are given):",
        "#   SM = np.reshape(parameters['SM'], (3, 3))",
        "#   acceleration = SM @ measured - parameters['bias']",
        f"SM: [{_numbers(c.accel_matrix)}]",
        f"bias: [{_numbers(c.accel_matrix @ c.accel_bias)}]",
    ]
    if has_gyros:
        lines += [
            f"gyro_SM: [{_numbers(c.gyro_matrix)}]",
            f"gyro_bias: [{_numbers(c.gyro_matrix @ c.gyro_bias)}]",
        ]
    return {"": "\n".join(lines) + "\n"}


#: tool -> what gives the texts of its files by what is added to the file's name
CALIBRATION_TOOLS: dict[str, Callable[[Calibration, bool], dict[str, str]]] = {
    "imu_tk": _imu_tk, "kalibr": _kalibr, "ros": _ros,
}  # fmt: skip


def calibration_texts(
    calibration: Calibration, tool: str, *, has_gyros: bool = True
) -> dict[str, str]:
    """Return the texts of a tool's files by what is added to the name of the file.

    Parameters
    ----------
    calibration : Calibration
    tool : {"imu_tk", "kalibr", "ros"}
    has_gyros : bool
        Whether the gyros were calibrated too.

    Raises
    ------
    InputError
        For another tool.
    """
    if tool not in CALIBRATION_TOOLS:
        raise InputError(f"there is no tool '{tool}' to export to: {', '.join(CALIBRATION_TOOLS)}")
    return CALIBRATION_TOOLS[tool](calibration, has_gyros)


def _in_axes(c: Calibration, to_body: ArrayLike) -> Calibration:
    """Return the calibration of outputs in other axes, which a matrix turns into body axes."""
    turn = np.asarray(to_body, np.float64)
    return replace(
        c,
        gyro_matrix=turn.T @ c.gyro_matrix @ turn, gyro_bias=turn.T @ c.gyro_bias,
        accel_matrix=turn.T @ c.accel_matrix @ turn, accel_bias=turn.T @ c.accel_bias,
    )  # fmt: skip


def export_calibration(
    calibration: Calibration, tool: str, path: str | Path, *, has_gyros: bool = True,
    axes: ArrayLike | None = None,
) -> list[Path]:  # fmt: skip
    """Write a tool's calibration files; return them.

    Parameters
    ----------
    calibration : Calibration
    tool : {"imu_tk", "kalibr", "ros"}
    path : str or Path
        The file; imu_tk has one for each triad, ``PATH.acc`` and ``PATH.gyro``.
    has_gyros : bool
        Whether the gyros were calibrated too.
    axes : (3, 3) array_like, optional
        Turns the instrument's own axes, in which the tool reads it, into right-forward-up; the
        file is for outputs in these axes. Right-forward-up when not given.

    Raises
    ------
    InputError
        For another tool, or if a file cannot be written.

    Examples
    --------
    >>> [path.name for path in export_calibration(sc.Calibration(), "imu_tk", "unit")]
    ['unit.acc', 'unit.gyro']
    """
    if axes is not None:
        calibration = _in_axes(calibration, axes)
    out = []
    for ending, text in calibration_texts(calibration, tool, has_gyros=has_gyros).items():
        there = Path(f"{path}{ending}")
        with replacing(there) as part:
            part.write_text(text, encoding="utf-8", newline="\n")
        out.append(there)
    return out
