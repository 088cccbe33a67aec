"""Would errors on the group SE2(3) serve an alignment in motion better? An experiment.

``python -m tests.alignment.moving.invariant_table`` (make validate) writes the table of
``docs/concepts/in-motion-methods.md``. Three plain filters with feedback differ in nothing but
their error: attitude, velocity and position apart; right-invariant, where the errors of velocity
and position are those beside the turned estimate; left-invariant, where all are in body axes. They
begin at the truth but for a heading that is off by a draw of their own 1-sigma, and take the same
fixes.
"""

from __future__ import annotations

import sys

import numpy as np

import schuler as sc
from schuler.attitude import nearest_quat, quat_to_matrix, rotvec_to_quat
from schuler.constants import ARCMIN, DEG, EARTH_RATE
from schuler.sensors import GRADES
from tests.alignment.moving.routes import ROUTES, SITE, fixes, heading_error, noisy, truth_of
from tests.conftest import ROOT

PAGE = ROOT / "docs" / "concepts" / "in-motion-methods.md"
MARK = "<!-- invariant table -->\n"
GRADE, SPEC = "tactical-fog", GRADES["tactical-fog"]
STEP, LENGTH, RUNS = 10, 60.0, 100
FORMS = ("apart", "right-invariant", "left-invariant")


def cross(v):
    """Return [v x] (3, 3)."""
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def turned(phi):
    """Return the rotation of a vector (3,)."""
    return quat_to_matrix(rotvec_to_quat(phi))


class Filter:
    """Fifteen states: attitude, velocity, position (east, north, up), biases."""

    def __init__(self, mat, v, sigma, form):
        self.mat, self.v, self.p, self.bias = mat, v, np.zeros(3), np.zeros(6)
        self.form = form
        prior = [[1.0 * DEG] * 2, [sigma], [0.1] * 3, [3.0] * 3]
        prior += [[SPEC.gyro.bias] * 3, [SPEC.accelerometer.bias] * 3]
        self.cov = np.diag(np.concatenate(prior) ** 2)
        t = self.to_group()
        self.cov = t @ self.cov @ t.T
        lat = SITE.latitude
        self.earth = EARTH_RATE * np.array([0.0, np.cos(lat), np.sin(lat)])
        self.gravity = np.array([0.0, 0.0, -SITE.gravity])

    def to_group(self):
        """Return what turns errors apart into those of the form."""
        t = np.eye(15)
        if self.form == "right-invariant":
            t[3:6, :3], t[6:9, :3] = cross(self.v), cross(self.p)
        elif self.form == "left-invariant":
            for k in range(3):
                t[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] = self.mat.T
        return t

    def predict(self, dtheta, dvel, dt):
        """Integrate increments over a step and carry the covariance."""
        angle, speed = dtheta - self.bias[:3] * dt, dvel - self.bias[3:] * dt
        force = self.mat @ turned(0.5 * angle) @ speed / dt
        f, w = np.zeros((15, 15)), cross(self.earth)
        f[6:9, 3:6] = np.eye(3)
        if self.form == "left-invariant":
            turn, slow = cross(angle / dt), self.mat.T @ w @ self.mat
            f[:3, :3], f[:3, 9:12] = -turn, -np.eye(3)
            f[3:6, :3], f[3:6, 3:6], f[3:6, 12:] = -cross(speed / dt), -turn - slow, -np.eye(3)
            f[6:9, 6:9] = slow - turn
        else:
            f[:3, :3], f[:3, 9:12] = -w, -self.mat
            f[3:6, 3:6], f[3:6, 12:] = -2.0 * w, -self.mat
            f[3:6, :3] = -cross(force)
        if self.form == "right-invariant":
            f[3:6, :3] = cross(self.gravity) + cross(self.v) @ w
            f[3:6, 9:12], f[6:9, 9:12] = -cross(self.v) @ self.mat, -cross(self.p) @ self.mat
            f[6:9, :3] = -cross(self.p) @ w
        noise = np.zeros((15, 15))
        noise[:3, :3] = SPEC.gyro.white**2 * dt * np.eye(3)
        noise[3:6, 3:6] = SPEC.accelerometer.white**2 * dt * np.eye(3)
        t = self.to_group()
        noise = t @ noise @ t.T
        phi = np.eye(15) + f * dt + 0.5 * (f @ f) * dt**2
        self.cov = phi @ self.cov @ phi.T + noise
        change = (force + self.gravity - 2.0 * np.cross(self.earth, self.v)) * dt
        self.p = self.p + (self.v + 0.5 * change) * dt
        self.v = self.v + change
        self.mat = turned(-self.earth * dt) @ self.mat @ turned(angle)

    def update(self, p, v, sigma):
        """Take a fix: position and velocity, m and m/s."""
        h = np.zeros((6, 15))
        h[:3, 6:9], h[3:, 3:6] = np.eye(3), np.eye(3)
        # What is measured is v and p: H of errors apart, by the inverse of the form's.
        h = h @ np.linalg.inv(self.to_group())
        z = np.r_[p - self.p, v - self.v]
        s = h @ self.cov @ h.T + np.diag(sigma**2)
        gain = np.linalg.solve(s, h @ self.cov).T
        x = gain @ z
        left = np.eye(15) - gain @ h
        self.cov = left @ self.cov @ left.T + gain @ np.diag(sigma**2) @ gain.T
        if self.form == "left-invariant":
            self.v, self.p = self.v + self.mat @ x[3:6], self.p + self.mat @ x[6:9]
            self.mat = self.mat @ turned(x[:3])
        else:
            turn = turned(x[:3])
            self.mat = turn @ self.mat
            if self.form == "right-invariant":
                self.v, self.p = turn @ self.v, turn @ self.p
            self.v, self.p = self.v + x[3:6], self.p + x[6:9]
        self.bias = self.bias + x[9:]


def run(made, seed, wrong):
    """Return heading error and sigma, rad, by each form."""
    rng = np.random.default_rng(seed)
    gnss, record = fixes(made, rng=rng), noisy(made, GRADE, rng)
    place = gnss.local()
    true = quat_to_matrix(made.truth.quat_nb[0])
    start = turned(np.array([*(1.0 * DEG * rng.standard_normal(2)), wrong * rng.standard_normal()]))
    out = []
    for form in FORMS:
        flt = Filter(start @ true, made.truth.v_n[0].copy(), wrong, form)
        at = 1
        sigma = np.r_[[3.0] * 3, [0.1] * 3]
        for k in range(0, len(record), STEP):
            part = slice(k, k + STEP)
            flt.predict(record.dtheta[part].sum(0), record.dvel[part].sum(0), record.dt[part].sum())
            if at < len(gnss.time) and record.time[part][-1] >= gnss.time[at] - 1e-6:
                flt.update(place[at], gnss.v_n[at], sigma)
                at += 1
        back = np.linalg.inv(flt.to_group())
        cov = back @ flt.cov @ back.T
        quat = nearest_quat(flt.mat)
        error = heading_error(quat, made.truth.quat_nb[len(record)])[2]
        out.append((error, np.sqrt(cov[2, 2])))
    return out


def _fine(made, runs):
    """Return heading error and sigma, rad, of the alignment that begins with no heading."""
    out = []
    for seed in range(runs):
        rng = np.random.default_rng(seed)
        gnss, record = fixes(made, rng=rng), noisy(made, GRADE, rng)
        fix = sc.align(record, SITE, aiding=gnss, spec=SPEC, vibration=0.0)
        error = heading_error(fix.quat_nb, made.truth.quat_nb[len(record)])[2]
        out.append((error, fix.sigma_arcmin[2] * ARCMIN))
    return np.array(out)


def _line(name, found):
    """Return a row of the table for errors and sigmas (runs, 2), rad."""
    error, sigma = np.abs(found).T
    rms = np.sqrt(np.mean(error**2))
    spread = np.std(error**2) / np.sqrt(len(error)) / (2.0 * rms)
    nees = (error / sigma) ** 2
    cells = [f"{rms / ARCMIN:.0f} ± {spread / ARCMIN:.0f}", f"{np.median(error) / ARCMIN:.0f}",
             f"{np.median(sigma) / ARCMIN:.0f}", f"{np.mean(nees):.3g}",
             f"{100.0 * np.mean(nees > 9.0):.0f} %"]  # fmt: skip
    return f"| {name} | " + " | ".join(cells) + " |"


def main() -> None:
    """Run all and write the table into the page."""
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else RUNS
    lines = [
        "| route | start, 1-sigma | errors | rms, ′ | median | stated, median | NEES | "
        "beyond 3 sigma |",
        "|---|---:|---|---:|---:|---:|---:|---:|",
    ]
    for route in ("straight", "ship"):
        made = truth_of(ROUTES[route](), LENGTH)
        for wrong in (10.0, 45.0):
            found = np.array([run(made, seed, wrong * DEG) for seed in range(runs)])
            for k, form in enumerate(FORMS):
                lines.append(_line(f"{route} | {wrong:.0f}° | {form}", found[:, k]))
                print(lines[-1], flush=True)
    # A straight drive is refused.
    lines.append(_line("ship | none | `sc.align`", _fine(truth_of(ROUTES["ship"](), LENGTH), runs)))
    head, mark, rest = PAGE.read_text(encoding="utf-8").partition(MARK)
    _, _, tail = rest.partition(MARK)
    if not mark:
        sys.exit(f"{PAGE} has no place for the table: {MARK.strip()}")
    text = "\n".join(lines) + "\n"
    PAGE.write_text(f"{head}{MARK}{text}{MARK}{tail}", encoding="utf-8")


if __name__ == "__main__":
    main()
