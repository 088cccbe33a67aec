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
    `scipy.spatial.transform.Rotation` in public results.
names
    A vector ends in its frame (``f_b``, ``v_n``). A rotation ends in the frame that it maps to and
    the one that it maps from: ``mat_nb`` and ``quat_nb`` map body vectors to n, ``quat_ib0_b`` to
    ib0, ``quat_en`` from n to the Earth.
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
    SI and radians inside; units with names only in files, on the command line and in reports.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from schuler._version import __version__

#: module -> its public names; resolved on first use, so that `import schuler` costs nothing.
#: No module or subpackage may have the name of one of these: Python binds it in its place.
_EXPORTS = {
    "schuler.alignment": (
        "Aligner", "Alignment", "Analytic", "Auto", "KalmanAlignment", "Gyrocompass", "Inertial",
        "align", "align_windows", "align_without_latitude", "compare", "limit", "limit_on",
    ),
    "schuler.alignment.transfer": ("transfer",),
    "schuler.allan_variance": ("allan", "fit_noise"),
    "schuler.calibration": ("Calibration", "calibrate_poses", "calibrate_systematic"),
    "schuler.campaigns": ("Campaign", "campaign"),
    "schuler.config": ("load_scenario",),
    "schuler.earth": ("Site",),
    "schuler.errors": ("InputError", "SchulerError"),
    "schuler.io": (
        "Mapping", "open_source", "read", "read_dvl", "read_gnss", "read_speed", "read_trajectory",
        "write", "write_trajectory",
    ),
    "schuler.navigation": ("Navigator", "Start", "evaluate", "navigate"),
    "schuler.prefilter": (
        "Chain", "Emd", "Gate", "Hankel", "LowPass", "VelocityEmd", "Wavelet",
    ),
    "schuler.record": ("ImuRecord",),
    "schuler.reports": ("report",),
    "schuler.sensors": ("ImuSpec", "SensorArray", "load_spec"),
    "schuler.simulation": ("Simulation", "simulate"),
    "schuler.trajectory": ("Trajectory",),
}  # fmt: skip
_MODULE = {name: module for module, names in _EXPORTS.items() for name in names}

__all__ = ["__version__", *sorted(_MODULE)]

if TYPE_CHECKING:
    from schuler.alignment import Aligner as Aligner
    from schuler.alignment import Alignment as Alignment
    from schuler.alignment import Analytic as Analytic
    from schuler.alignment import Auto as Auto
    from schuler.alignment import Gyrocompass as Gyrocompass
    from schuler.alignment import Inertial as Inertial
    from schuler.alignment import KalmanAlignment as KalmanAlignment
    from schuler.alignment import align as align
    from schuler.alignment import align_windows as align_windows
    from schuler.alignment import align_without_latitude as align_without_latitude
    from schuler.alignment import compare as compare
    from schuler.alignment import limit as limit
    from schuler.alignment import limit_on as limit_on
    from schuler.alignment.transfer import transfer as transfer
    from schuler.allan_variance import allan as allan
    from schuler.allan_variance import fit_noise as fit_noise
    from schuler.calibration import Calibration as Calibration
    from schuler.calibration import calibrate_poses as calibrate_poses
    from schuler.calibration import calibrate_systematic as calibrate_systematic
    from schuler.campaigns import Campaign as Campaign
    from schuler.campaigns import campaign as campaign
    from schuler.config import load_scenario as load_scenario
    from schuler.earth import Site as Site
    from schuler.errors import InputError as InputError
    from schuler.errors import SchulerError as SchulerError
    from schuler.io import Mapping as Mapping
    from schuler.io import open_source as open_source
    from schuler.io import read as read
    from schuler.io import read_dvl as read_dvl
    from schuler.io import read_gnss as read_gnss
    from schuler.io import read_speed as read_speed
    from schuler.io import read_trajectory as read_trajectory
    from schuler.io import write as write
    from schuler.io import write_trajectory as write_trajectory
    from schuler.navigation import Navigator as Navigator
    from schuler.navigation import Start as Start
    from schuler.navigation import evaluate as evaluate
    from schuler.navigation import navigate as navigate
    from schuler.prefilter import Chain as Chain
    from schuler.prefilter import Emd as Emd
    from schuler.prefilter import Gate as Gate
    from schuler.prefilter import Hankel as Hankel
    from schuler.prefilter import LowPass as LowPass
    from schuler.prefilter import VelocityEmd as VelocityEmd
    from schuler.prefilter import Wavelet as Wavelet
    from schuler.record import ImuRecord as ImuRecord
    from schuler.reports import report as report
    from schuler.sensors import ImuSpec as ImuSpec
    from schuler.sensors import SensorArray as SensorArray
    from schuler.sensors import load_spec as load_spec
    from schuler.simulation import Simulation as Simulation
    from schuler.simulation import simulate as simulate
    from schuler.trajectory import Trajectory as Trajectory


def __getattr__(name: str) -> Any:
    if name not in _MODULE:
        raise AttributeError(f"module 'schuler' has no attribute '{name}'")
    value = getattr(import_module(_MODULE[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
