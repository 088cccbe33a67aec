"""schuler: inertial alignment, calibration and error control.

Conventions, written once and used everywhere
---------------------------------------------
navigation frame n
    Local level, East-North-Up.
body frame b
    x right, y forward, z up (RFU).
inertial frames
    i0: the Earth frame frozen at the start (x in the local meridian plane, parallel to the
    equator; z along Earth's spin). ib0: the body frame frozen at the start.
attitude
    C_b^n maps body vectors to n; a Hamilton quaternion (w, x, y, z) inside,
    `scipy.spatial.transform.Rotation` in the public face.
Euler angles
    C_b^n = Rz(psi) Rx(theta) Ry(gamma): psi counter-clockwise seen from above, theta pitch in
    [-90, 90] deg, gamma roll in (-180, 180] deg. A person reads the heading, clockwise from
    north, in [0, 360) deg: -psi mod 360.
misalignment phi
    C_est = (I - [phi x]) C_true, phi = (phi_E, phi_N, phi_U) in n; reported in arcmin.
IMU samples
    Increments over (t[k-1], t[k]]: rad and m/s.
bias
    measured = true + bias.
units
    SI and radians inside; units with names live at the borders (files, CLI, reports).
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from schuler._version import __version__

#: public name -> module; resolved on first use, so that `import schuler` costs nothing
_PUBLIC = {
    "ImuRecord": "schuler.record",
    "Site": "schuler.earth",
    "SchulerError": "schuler.errors",
    "InputError": "schuler.errors",
    "ImuSpec": "schuler.sensors",
    "read": "schuler.io",
    "open_source": "schuler.io",
    "write": "schuler.io",
    "Mapping": "schuler.io",
    "Calibration": "schuler.calibrate",
    "calibrate_poses": "schuler.calibrate",
    "align": "schuler.align",
    "align_windows": "schuler.align",
    "Aligner": "schuler.align",
    "Alignment": "schuler.align",
    "Analytic": "schuler.align",
    "Inertial": "schuler.align",
    "navigate": "schuler.navigate",
    "Navigator": "schuler.navigate",
    "Start": "schuler.navigate",
    "evaluate": "schuler.navigate",
    "SensorArray": "schuler.sensors",
    "report": "schuler.report",
}

__all__ = ["__version__", *sorted(_PUBLIC)]

if TYPE_CHECKING:
    from schuler.align import Aligner as Aligner
    from schuler.align import Alignment as Alignment
    from schuler.align import Analytic as Analytic
    from schuler.align import Inertial as Inertial
    from schuler.align import align as align
    from schuler.align import align_windows as align_windows
    from schuler.calibrate import Calibration as Calibration
    from schuler.calibrate import calibrate_poses as calibrate_poses
    from schuler.earth import Site as Site
    from schuler.errors import InputError as InputError
    from schuler.errors import SchulerError as SchulerError
    from schuler.io import Mapping as Mapping
    from schuler.io import open_source as open_source
    from schuler.io import read as read
    from schuler.io import write as write
    from schuler.navigate import Navigator as Navigator
    from schuler.navigate import Start as Start
    from schuler.navigate import evaluate as evaluate
    from schuler.navigate import navigate as navigate
    from schuler.record import ImuRecord as ImuRecord
    from schuler.report import report as report
    from schuler.sensors import ImuSpec as ImuSpec
    from schuler.sensors import SensorArray as SensorArray


def __getattr__(name: str) -> Any:
    module = _PUBLIC.get(name)
    if module is None:
        raise AttributeError(f"module 'schuler' has no attribute '{name}'")
    room = import_module(module)
    # A room of the same name is itself callable (`schuler._face`): both uses must go on working.
    value = room if module == f"schuler.{name}" else getattr(room, name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
