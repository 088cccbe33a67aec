"""Single bad samples are named and left out; real shocks and coarse values are not."""

from __future__ import annotations

import numpy as np
import pytest

from schuler import InputError, Site
from schuler.motion import DisturbedVehicle, Sea, Static, Turntable, moored_ship
from schuler.motion.turntable import Dwell, Turn
from schuler.record import ImuRecord, Intake, without_spikes
from schuler.record.quality import CHANNELS
from schuler.sensors import load_spec
from schuler.simulation import simulate

SITE = Site(48.1)
DEG = np.pi / 180.0


def made(kind, seed, grade="navigation-fog", rate=100.0, seconds=60.0):
    """Return a simulated record of one kind of motion."""
    rng = np.random.default_rng(seed)
    heading = rng.uniform(0.0, 360.0)
    motion = {
        "static": lambda: Static(heading, 2.0, -3.0),
        "crew": lambda: DisturbedVehicle.with_crew(rng, seconds, heading=heading),
        "shaken": lambda: DisturbedVehicle.draw(rng, seconds, heading=heading),
        "ship": lambda: moored_ship(rng, Sea(1.5, 8.0), heading=heading, lever=(1.0, 5.0, 3.0)),
        "table": lambda: Turntable([Dwell(20.0), Turn("psi", 90.0), Dwell(60.0)], (heading, 0, 0)),
    }[kind]()
    return simulate(motion, SITE, seconds, rate, load_spec(grade), rng).record


def spoilt(record, row, channel, size):
    """Return the record with one value off."""
    dtheta, dvel = record.dtheta.copy(), record.dvel.copy()
    (dtheta if channel < 3 else dvel)[row, channel % 3] += size
    return ImuRecord(record.time, record.dt, dtheta, dvel)


def found(record):
    return [(s.row - 1, CHANNELS.index(s.channel)) for s in without_spikes(record)[1]]


@pytest.mark.compiled
@pytest.mark.parametrize(
    ("kind", "grade", "rate"),
    [
        ("static", "navigation-fog", 100.0), ("static", "industrial-mems", 50.0),
        ("crew", "navigation-fog", 100.0), ("crew", "tactical-fog", 200.0),
        ("ship", "navigation-rlg", 100.0), ("shaken", "tactical-fog", 200.0),
        ("table", "navigation-fog", 100.0),
    ],
)  # fmt: skip
def test_one_bad_sample_of_any_size_channel_and_instant_is_named(kind, grade, rate):
    """At least 99 % of 100 sizes, log-uniform, each above 8 sigma of the sample noise."""
    record = made(kind, 1, grade, rate)
    assert found(record) == []
    rng = np.random.default_rng(2)
    spec = load_spec(grade)
    named = tried = 0
    while tried < 100:
        row, channel = int(rng.integers(len(record))), int(rng.integers(6))
        size = rng.choice([-1.0, 1.0]) * (
            10.0 ** rng.uniform(-2.0, np.log10(20.0)) * DEG
            if channel < 3
            else 10.0 ** rng.uniform(0.0, 3.0)
        )
        part = spec.gyro if channel < 3 else spec.accelerometer
        if abs(size) < 8.0 * np.hypot(part.white / np.sqrt(rate), 1.5 * part.quantisation):
            continue
        tried += 1
        named += found(spoilt(record, row, channel, size)) == [(row, channel)]
    assert named >= 99


@pytest.mark.compiled
@pytest.mark.parametrize("row", [0, 1, 2, 3, 100, -4, -3, -2, -1])
@pytest.mark.parametrize("kind", ["static", "ship"])
def test_the_first_and_the_last_samples_too(kind, row):
    record = made(kind, 3, seconds=20.0)
    at = row % len(record)
    for channel, size in ((0, 1.0 * DEG), (2, -0.1 * DEG), (4, 5.0)):
        assert found(spoilt(record, at, channel, size)) == [(at, channel)]


@pytest.mark.compiled
def test_good_records_have_none():
    """At most 1 % of good records with any named; here 0 of 60, each motion, grade and rate."""
    grades = ("navigation-rlg", "navigation-fog", "tactical-fog", "industrial-mems")
    kinds = ("static", "crew", "shaken", "ship", "table")
    for seed in range(60):
        rate = (10.0, 25.0, 100.0, 400.0)[seed % 4]
        record = made(kinds[seed % 5], seed, grades[seed // 4 % 4], rate, min(60.0, 4000.0 / rate))
        assert found(record) == [], seed


@pytest.mark.compiled
def test_both_gyro_channels_of_a_row_may_be_bad():
    record = made("crew", 5)
    bad = spoilt(spoilt(record, 777, 0, 0.3 * DEG), 777, 2, -2.0 * DEG)
    good, spikes = without_spikes(bad)
    assert [(s.row, s.channel) for s in spikes] == [(778, "gyro x"), (778, "gyro z")]
    assert np.abs(good.dtheta - record.dtheta).max() < 0.002 * DEG
    assert spikes[0].value == bad.dtheta[777, 0]
    assert spikes[0].replaced_by == good.dtheta[777, 0]


@pytest.mark.compiled
@pytest.mark.parametrize("length", [0.02, 0.04, 0.08])
@pytest.mark.parametrize("rate", [50.0, 100.0, 400.0])
def test_a_real_shock_shows_in_the_force_and_stays(rate, length):
    record = made("static", 6, rate=rate)
    t = record.time
    dtheta, dvel = record.dtheta.copy(), record.dvel.copy()
    for start in (0.03, 10.002, 31.004, 45.5):
        inside = (t > start) & (t < start + length)
        pulse = np.where(inside, np.sin(np.pi * (t - start) / length), 0.0) / rate
        dtheta[:, :2] += np.outer(pulse, [3.0 * DEG, -1.0 * DEG])
        dvel += np.outer(pulse, [1.5, 0.8, 0.4])
    assert found(ImuRecord(t, record.dt, dtheta, dvel)) == []


@pytest.mark.compiled
def test_coarse_and_held_values_are_none():
    rng = np.random.default_rng(7)
    n = 20_000
    t = np.arange(1, n + 1) / 100.0
    fine = rng.normal(size=(n, 6))
    angle = np.cumsum(0.05 + 0.02 * rng.normal(size=(n, 6)), axis=0)
    for x in (
        np.round(fine),  # a MEMS whose noise is one step
        np.round(0.2 * fine),  # one that leaves zero now and then
        np.diff(np.floor(angle), axis=0, prepend=0.0),  # pulses of a laser gyro
        np.repeat(fine[: n // 5], 5, axis=0),  # a sensor held five times
    ):
        intake = Intake("mean-rates")
        intake.push(t, x)
        intake.close()
        assert intake.quality().spikes == ()


def rows(n=1000, scale=1e-3):
    rng = np.random.default_rng(8)
    return np.arange(1, n + 1) / 100.0, scale * rng.normal(size=(n, 6))


def taken(kind, t, x, **options):
    intake = Intake(kind, **options)
    parts = [intake.push(t, x), intake.close()]
    return ImuRecord.concatenate([p for p in parts if len(p)]), intake.quality()


@pytest.mark.parametrize(
    ("kind", "value", "said"),
    [
        ("rates", 2000.0 * DEG, "gyro z, 2000 deg/s"),
        ("mean-rates", -1.5 * DEG, "gyro z, -1.5 deg/s"),
        ("increments", 0.25 * DEG, "gyro z, 0.25 deg"),
    ],
)
def test_a_spike_is_named_with_row_time_channel_and_value(kind, value, said):
    t, x = rows(scale=1e-5)
    x[600, 2] = value
    record, quality = taken(kind, t, x)
    assert quality.warnings() == [f"1 sample was left out as a spike: row 601 (t = 6.01 s), {said}"]
    assert np.abs(record.dtheta).max() < 1e-4
    kept, as_is = taken(kind, t, x, keep_spikes=True)
    assert as_is.warnings() == []
    assert np.abs(kept.dtheta[:, 2]).max() > 20.0 * np.abs(record.dtheta).max()


def test_rows_of_the_file_are_counted_where_some_were_dropped():
    t, x = rows()
    x[100, 3] = np.nan
    x[600, 5] = 50.0
    assert [s.row for s in taken("rates", t, x)[1].spikes] == [601]


@pytest.mark.compiled
def test_more_than_a_few_are_refused_wherever_it_is_cut():
    t, x = rows(5000)
    at = 300 + 333 * np.arange(12)
    x[at, 1] = 10.0 * (1 + np.arange(12))

    def refused(size):
        intake = Intake("rates")
        for a in range(0, 5000, size):
            intake.push(t[a : a + size], x[a : a + size])

    sentences = set()
    for size in (1, 257, 1000, 5000):
        with pytest.raises(InputError) as error:
            refused(size)
        sentences.add(str(error.value))
    (sentence,) = sentences
    assert sentence.startswith(
        "11 samples up to data row 3631 (t = 36.31 s) stand far beyond both neighbours, the first "
        "at row 301 (t = 3.01 s), gyro y, 572.958 deg/s: more than a few"
    )
    # A few in a long record are none too many.
    t, x = rows(40_000)
    x[3000 * np.arange(1, 13), 0] = 1.0
    assert len(taken("increments", t, x)[1].spikes) == 12
    bad = ImuRecord(t[:5000], np.full(5000, 0.01), np.zeros((5000, 3)), np.zeros((5000, 3)))
    bad.dtheta[at, 0] = 1.0
    bad.dtheta[:] += rows(5000)[1][:, :3]
    with pytest.raises(InputError, match="11 samples up to data row 3631"):
        without_spikes(bad)


@pytest.mark.parametrize("cut", [300, 595, 601, 604, 608, 640])
@pytest.mark.parametrize("kind", ["rates", "mean-rates", "increments"])
def test_a_state_taken_up_on_the_way_gives_the_same_bits(kind, cut):
    t, x = rows()
    x[600, 2] = 3.0
    keep = np.ones(1000, bool)
    keep[[602, 603, 604, 700]] = False
    t, x = t[keep], x[keep]
    whole, quality = taken(kind, t, x)
    first, second = Intake(kind), Intake(kind)
    parts = [first.push(t[:cut], x[:cut])]
    second.restore(first.arrays())
    parts += [second.push(t[cut:], x[cut:]), second.close()]
    record = ImuRecord.concatenate([p for p in parts if len(p)])
    for field in ("time", "dt", "dtheta", "dvel", "values"):
        np.testing.assert_array_equal(getattr(record, field), getattr(whole, field))
    assert second.quality() == quality
    assert len(quality.spikes) == 1


def test_a_record_in_memory_of_another_shape_comes_back_as_it_is():
    t = np.arange(1, 101) / 100.0
    six = ImuRecord(t, np.full(100, 0.01), np.zeros((100, 6)), np.zeros((100, 3)))
    assert without_spikes(six) == (six, ())
    short = six.rows(0, 10)
    assert without_spikes(short)[0] is short


@pytest.mark.compiled
@pytest.mark.realdata
def test_real_records_have_none(data_dir):
    import schuler as sc

    laser = sc.read(data_dir / "psins_lasergyro_vehicle" / "lasergyro.imu")
    assert laser.quality is not None
    assert laser.quality.spikes == ()
    acc, gyro = (
        np.loadtxt(data_dir / "imu_tk_xsens_multipos" / f"xsens_{name}.mat")
        for name in ("acc", "gyro")
    )
    car = np.loadtxt(data_dir / "rtk_car_mems" / "imu.csv", delimiter=",", skiprows=1)
    with np.load(data_dir / "comma2k19_minute" / "segment.npz") as archive:
        n = min(len(archive["imu_t"]), len(archive["gyro"]))
        phone = np.hstack([archive["imu_t"][:n, None], archive["gyro"][:n], archive["accel"][:n]])
    for table in (
        np.hstack([acc[:, :1], gyro[:, 1:], acc[:, 1:]]),
        np.hstack([car[:, :1], DEG * car[:, 1:4], 9.80665 * car[:, 4:7]]),
        phone,
    ):
        table = table[np.append(True, np.diff(table[:, 0]) > 0)]
        assert taken("rates", table[:, 0], table[:, 1:], max_gap=1e9)[1].spikes == ()


@pytest.mark.compiled
@pytest.mark.parametrize("channel", [2, 4])
def test_a_gross_sample_is_named_while_the_base_is_shaken(channel):
    """In each of the 20 rows in which the other triad is moved most."""
    record = made("crew", 3, "navigation-rlg", rate=25.0)
    other = record.dvel if channel < 3 else record.dtheta
    moved = np.abs(np.diff(other, 3, axis=0)).max(axis=1)
    for row in np.argsort(moved)[-20:] + 2:
        spoilt_record = spoilt(record, row, channel, 5.0 * DEG if channel < 3 else 20.0)
        assert found(spoilt_record) == [(row, channel)]
