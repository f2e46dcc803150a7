import pickle
import re
from dataclasses import replace

import numpy as np
import pytest

from sim.sensorfile import sensor_named
from slam.core import InputError

VLP16 = sensor_named("vlp16")


def test_the_vlp16_is_a_vlp16():
    assert VLP16.beams == 16
    assert np.degrees(VLP16.elevations) == pytest.approx(np.arange(-15, 16, 2))
    assert VLP16.columns * VLP16.beams == 28_800
    assert VLP16.period == pytest.approx(0.1)
    assert abs(np.degrees(VLP16.column_step)) == pytest.approx(0.2)  # it turns clockwise


def test_shots_are_fired_within_the_sweep_one_after_the_other():
    times = VLP16.shot_times.ravel()
    assert (np.diff(times) > 0.0).all()
    assert times[0] >= -VLP16.period - 1e-9
    assert times[-1] <= 0.0


def test_directions_are_unit_and_at_the_beams_elevations():
    directions = VLP16.shot_directions
    assert np.linalg.norm(directions, axis=2) == pytest.approx(1.0)
    elevation = np.arcsin(directions[..., 2])
    expected = np.asarray(VLP16.elevations)[VLP16.firing_order]
    assert elevation == pytest.approx(np.broadcast_to(expected, elevation.shape))


def test_the_presets_differ_in_what_spoils_a_measurement():
    ideal, harsh = sensor_named("ideal"), sensor_named("vlp16-harsh")
    assert not any((*ideal.range_offsets, *ideal.range_noise, *ideal.dropout, ideal.divergence))
    assert 0.008 < np.std(VLP16.range_offsets) < 0.03
    assert abs(np.mean(VLP16.range_offsets)) < 1e-3
    for table in ("range_noise", "dropout"):
        assert np.all(np.array(getattr(harsh, table)) > np.array(getattr(VLP16, table)))
    assert all(p >= 0.16 for p in harsh.dropout[8:])
    assert harsh.elevations == VLP16.elevations == ideal.elevations


def test_another_make_is_only_data():
    os1 = sensor_named("os1-32")
    assert (os1.beams, os1.columns) == (32, 1024)
    assert np.degrees(np.ptp(os1.elevations)) == pytest.approx(45.0)
    assert np.ptp(os1.shot_times, axis=1).max() == 0.0  # all beams of a column at once


def test_unknown_sensors_name_the_nearest():
    with pytest.raises(InputError, match="vlp16"):
        sensor_named("vlp61")


@pytest.mark.parametrize(
    "change",
    [
        {"range_noise": (0.01,) * 15},
        {"dropout": (0.1,) * 17},
        {"range_noise": (-0.01,) * 16},
        {"dropout": (1.5,) * 16},
        {"range_offsets": (float("nan"),) * 16},
        {"elevations": ()},
        {"elevations": tuple(reversed(VLP16.elevations))},
        {"rate": 0.0},
        {"columns": 0},
        {"min_range": -1.0},
        {"min_range": 200.0},
        {"divergence": -0.001},
        {"divergence": 0.01},
        {"glass": 0.7, "glass_mirror": 0.7},
        {"grazing": float("nan")},
    ],
)
def test_tables_that_make_no_sense_are_refused(change):
    with pytest.raises(InputError):
        replace(VLP16, **change)


def test_a_sensor_can_be_sent_to_another_process():
    assert pickle.loads(pickle.dumps(VLP16)) == VLP16


FILE = """
elevations_deg = [-1, 1]
firing_offsets_us = [0, 2]
azimuth_offsets_deg = 0
range_offsets_mm = [5, -5]
range_noise_mm = 3
dropout = 0.01
rate_hz = 20
clockwise = false
"""


def sensor_file(tmp_path, text):
    path = tmp_path / "mine.toml"
    path.write_text(text)
    return str(path)


def test_a_sensor_can_be_a_file(tmp_path):
    sensor = sensor_named(sensor_file(tmp_path, FILE))
    assert sensor.name == "mine"
    assert np.degrees(sensor.elevations) == pytest.approx([-1, 1])
    assert sensor.firing_offsets == pytest.approx([0.0, 2e-6])
    assert sensor.range_offsets == pytest.approx([0.005, -0.005])
    assert sensor.range_noise == pytest.approx([0.003, 0.003])
    assert (sensor.rate, sensor.columns, sensor.clockwise) == (20.0, 1800, False)


def test_a_file_can_change_a_preset(tmp_path):
    changed = sensor_named(sensor_file(tmp_path, 'based_on = "vlp16"\nrange_noise_mm = 30'))
    assert changed == replace(VLP16, name="mine", range_noise=(0.03,) * 16)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("elevations_deg = [1", "expected TOML"),
        (FILE.replace("dropout = 0.01", ""), "dropout: missing"),
        (FILE.replace("[5, -5]", "[5, -5, 5]"), "range_offsets has 3 entries, expected 2"),
        (FILE.replace("range_noise_mm = 3", "range_noise_mm = -3"), "no negative sigma"),
        (FILE.replace("rate_hz = 20", "rate_hz = 0"), "rate: expected more than 0 Hz"),
        (FILE.replace("rate_hz = 20", 'rate_hz = "fast"'), "rate_hz: expected a number"),
        (FILE + "columns = 12.5", "columns: expected a whole number"),
        (FILE.replace("false", "1"), "clockwise: expected true or false"),
        (FILE + "colour = 3", "unknown key colour, expected elevations_deg"),
        (FILE.replace("[-1, 1]", "[]"), "elevations is empty"),
        ('based_on = "vlp17"', "unknown sensor 'vlp17'"),
    ],
)
def test_bad_sensor_files_get_one_clear_line(tmp_path, text, message):
    with pytest.raises(InputError, match=re.escape(message)) as caught:
        sensor_named(sensor_file(tmp_path, text))
    assert "mine" in str(caught.value)


def test_a_sensor_file_that_is_not_there_is_said(tmp_path):
    with pytest.raises(InputError, match=r"absent.toml: cannot be read: No such file"):
        sensor_named(str(tmp_path / "absent.toml"))
