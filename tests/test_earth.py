"""The Earth against its own theory in high precision, not against the formulas of the code."""

from __future__ import annotations

import math

import mpmath as mp
import numpy as np
import pytest

from schuler.constants import EARTH_RATE
from schuler.earth import (
    Site,
    earth_rate,
    geocentric,
    geodetic,
    gravity,
    moved,
    radii,
    transport_rate,
)
from schuler.errors import InputError

# The four defining parameters of WGS-84 (NIMA TR8350.2, table 3.1); all else is derived here.
A = mp.mpf(6378137)
F = 1 / mp.mpf("298.257223563")
GM = mp.mpf("3986004.418e8")
OMEGA = mp.mpf("7292115e-11")

B = A * (1 - F)
E2 = F * (2 - F)
E_LINEAR = mp.sqrt(A**2 - B**2)

LATITUDES = [-90.0, -67.3, -45.0, -1e-3, 0.0, 12.0, 34.246, 45.0, 60.0, 89.9, 90.0]


def ecef(lat, lon, height):
    """Return the position in the Earth frame, m, by the definition of geodetic coordinates."""
    n = A**2 / mp.sqrt(A**2 * mp.cos(lat) ** 2 + B**2 * mp.sin(lat) ** 2)
    return mp.matrix(
        [
            (n + height) * mp.cos(lat) * mp.cos(lon),
            (n + height) * mp.cos(lat) * mp.sin(lon),
            (B**2 / A**2 * n + height) * mp.sin(lat),
        ]
    )


def enu_axes(lat, lon):
    """Return the matrix whose columns are east, north and up in the Earth frame."""
    sl, cl, so, co = mp.sin(lat), mp.cos(lat), mp.sin(lon), mp.cos(lon)
    return mp.matrix([[-so, -sl * co, cl * co], [co, -sl * so, cl * so], [0, cl, sl]])


def slope(function, x):
    """Return the derivative of a vector function by a central difference in 50 digits."""
    h = mp.mpf("1e-18")
    return (function(x + h) - function(x - h)) / (2 * h)


def normal_potential(x, z):
    """Return the potential of the rotating level ellipsoid (Heiskanen and Moritz, 1967, 2-62)."""

    def q(u):
        return ((1 + 3 * u**2 / E_LINEAR**2) * mp.atan(E_LINEAR / u) - 3 * u / E_LINEAR) / 2

    s = x**2 + z**2 - E_LINEAR**2
    u2 = (s + mp.sqrt(s**2 + 4 * E_LINEAR**2 * z**2)) / 2
    u = mp.sqrt(u2)
    sin2 = z**2 / u2
    return (
        GM / E_LINEAR * mp.atan(E_LINEAR / u)
        + OMEGA**2 * A**2 * q(u) / q(B) * (sin2 - mp.mpf(1) / 3) / 2
        + OMEGA**2 * x**2 / 2
    )


def theory_gravity(lat, height):
    """Return the length of the potential's gradient."""
    r = ecef(lat, 0, height)
    h = mp.mpf("1e-12")
    gx = (normal_potential(r[0] + h, r[2]) - normal_potential(r[0] - h, r[2])) / (2 * h)
    gz = (normal_potential(r[0], r[2] + h) - normal_potential(r[0], r[2] - h)) / (2 * h)
    return mp.hypot(gx, gz)


@pytest.fixture(autouse=True)
def fifty_digits():
    with mp.workdps(50):
        yield


@pytest.mark.parametrize("lat", LATITUDES[1:-1])
def test_radii_are_the_curvature_of_the_surface(lat):
    la = mp.mpf(lat) * mp.pi / 180
    meridian = mp.norm(slope(lambda x: ecef(x, 0, 0), la))
    transverse = mp.norm(slope(lambda x: ecef(la, x, 0), mp.mpf(0))) / mp.cos(la)
    rm, rn = radii(math.radians(lat))
    assert float(rm) == pytest.approx(float(meridian), rel=1e-14, abs=0)
    assert float(rn) == pytest.approx(float(transverse), rel=1e-14, abs=0)


def test_radii_at_equator_and_pole():
    rm, rn = radii([0.0, math.pi / 2, -math.pi / 2])
    np.testing.assert_allclose(rn[0], 6378137.0, rtol=1e-15)
    np.testing.assert_allclose(rm[0], float(B**2 / A), rtol=1e-15)
    # The polar radius of curvature is one of the published derived constants (table 3.3).
    np.testing.assert_allclose([rm[1], rn[1], rm[2], rn[2]], 6399593.6258, atol=5e-5)


@pytest.mark.parametrize(
    ("lat", "published"),
    # NIMA TR8350.2, table 3.4, equator and pole; 45 deg: Moritz (1980) form for WGS-84.
    [(0.0, 9.7803253359), (90.0, 9.8321849378), (-90.0, 9.8321849378), (45.0, 9.8061977694)],
)
def test_gravity_on_the_ellipsoid_is_the_published_one(lat, published):
    assert float(gravity(math.radians(lat))) == pytest.approx(published, abs=1e-10)


@pytest.mark.parametrize("lat", LATITUDES)
def test_gravity_on_the_ellipsoid_is_the_gradient_of_the_potential(lat):
    # The published constants have eleven digits: 1e-9 m/s^2 is 0.1 ng.
    expected = theory_gravity(mp.mpf(lat) * mp.pi / 180, mp.mpf(0))
    assert float(gravity(math.radians(lat))) == pytest.approx(float(expected), abs=1e-9)


@pytest.mark.parametrize("lat", LATITUDES)
@pytest.mark.parametrize(
    ("height", "tolerance"),
    # The series neglects terms in f^2 h/a, f (h/a)^2 and (h/a)^3: 5 ng at 400 m, 0.2 ug at 20 km.
    [(-400.0, 5e-8), (400.0, 5e-8), (3000.0, 3e-7), (20000.0, 2e-6)],
)
def test_gravity_at_height_is_the_gradient_of_the_potential(lat, height, tolerance):
    expected = theory_gravity(mp.mpf(lat) * mp.pi / 180, mp.mpf(height))
    got = float(gravity(math.radians(lat), height))
    assert got == pytest.approx(float(expected), abs=tolerance)


@pytest.mark.parametrize("lat", LATITUDES)
def test_earth_rate_is_the_pole_seen_from_the_local_axes(lat):
    axes = enu_axes(mp.mpf(lat) * mp.pi / 180, mp.mpf("1.9"))
    expected = axes.T * mp.matrix([0, 0, OMEGA])
    got = earth_rate(math.radians(lat))
    np.testing.assert_allclose(got, [float(x) for x in expected], atol=1e-20, rtol=1e-15)
    assert math.hypot(*got) == pytest.approx(EARTH_RATE, rel=1e-15, abs=0)


@pytest.mark.parametrize("lat", [-67.3, -12.0, 0.0, 34.246, 80.0])
@pytest.mark.parametrize("height", [-100.0, 9000.0])
@pytest.mark.parametrize("velocity", [(200.0, 0.0), (0.0, -150.0), (-37.0, 61.0)])
def test_transport_rate_is_how_the_local_axes_turn(lat, height, velocity):
    la, lo, h = mp.mpf(lat) * mp.pi / 180, mp.mpf("-0.7"), mp.mpf(height)
    # Latitude and longitude rates from the motion of the position itself.
    axes = enu_axes(la, lo)
    north = (axes.T * slope(lambda x: ecef(x, lo, h), la))[1]
    east = (axes.T * slope(lambda x: ecef(la, x, h), lo))[0]
    rates = velocity[1] / north, velocity[0] / east
    turn = axes.T * slope(lambda t: enu_axes(la + rates[0] * t, lo + rates[1] * t), mp.mpf(0))
    expected = [float(turn[2, 1]), float(turn[0, 2]), float(turn[1, 0])]
    got = transport_rate(math.radians(lat), height, *velocity)
    np.testing.assert_allclose(got, expected, rtol=1e-13, atol=1e-20)


def test_everything_broadcasts():
    lat = np.radians([[0.0], [30.0]])
    height = np.array([0.0, 100.0, 1000.0])
    g = gravity(lat, height)
    assert g.shape == (2, 3)
    assert g[1, 2] == float(gravity(lat[1, 0], 1000.0))
    assert transport_rate(lat, height, 10.0, 0.0).shape == (2, 3, 3)
    assert earth_rate(lat).shape == (2, 1, 3)
    assert radii(lat)[0].shape == (2, 1)
    assert gravity(0.5).shape == ()


def test_site_speaks_degrees_and_gives_radians():
    site = Site(lat=34.246, lon=108.910, height=380)
    assert site.latitude == pytest.approx(math.radians(34.246), rel=1e-15, abs=0)
    assert site.longitude == pytest.approx(math.radians(108.910), rel=1e-15, abs=0)
    assert site.gravity == float(gravity(site.latitude, 380.0))
    np.testing.assert_array_equal(site.earth_rate, earth_rate(site.latitude))
    assert Site(90.0, -180.0, -12000.0).latitude == math.pi / 2


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ((90.1, 0.0, 0.0), "latitude must be between -90 and 90 deg, got 90.1"),
        ((-91.0, 0.0, 0.0), "latitude must be between -90 and 90 deg, got -91"),
        ((math.nan, 0.0, 0.0), "latitude must be between -90 and 90 deg, got nan"),
        ((0.0, 360.5, 0.0), "longitude must be between -180 and 360 deg, got 360.5"),
        ((0.0, 0.0, math.inf), "height must be between -12000 and 100000 m, got inf"),
        ((0.0, 0.0, 2e5), "height must be between -12000 and 100000 m, got 200000"),
    ],
)
def test_site_refuses_what_is_not_a_place(values, sentence):
    with pytest.raises(InputError) as error:
        Site(*values)
    assert str(error.value) == sentence


def test_positions_in_the_earths_axes_and_back():
    rng = np.random.default_rng(2)
    lat = np.concatenate([rng.uniform(-np.pi / 2, np.pi / 2, 200), [np.pi / 2, -np.pi / 2, 0.0]])
    lon = rng.uniform(-np.pi, np.pi, len(lat))
    height = rng.uniform(-500.0, 20_000.0, len(lat))
    found = geodetic(geocentric(lat, lon, height))
    np.testing.assert_allclose(found[0], lat, atol=1e-14)
    np.testing.assert_allclose(found[1][:200], lon[:200], atol=1e-10)
    np.testing.assert_allclose(found[2], height, atol=1e-8)


def test_a_step_over_the_pole_and_the_date_line():
    lat, lon, height = moved(np.pi / 2 - 1e-7, 0.5, 10.0, [0.0, 2.0, 0.0])
    assert lat == pytest.approx(np.pi / 2 - (2.0 / 6399593.6 - 1e-7), abs=1e-12)
    assert lon == pytest.approx(0.5 - np.pi)
    assert height == pytest.approx(10.0, abs=1e-5)
    _, lon, _ = moved(0.0, np.pi - 1e-7, 0.0, [2.0, 0.0, 0.0])
    assert lon == pytest.approx(-np.pi - 1e-7 + 2.0 / 6378137.0, abs=1e-12)
