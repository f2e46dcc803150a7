import pickle
from dataclasses import replace

import numpy as np
import pytest

from sim.sensor import sensor_named
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
    ideal = sensor_named("ideal")
    assert not any((*ideal.range_offsets, *ideal.range_noise, *ideal.dropout))
    assert 0.008 < np.std(VLP16.range_offsets) < 0.03
    assert all(0.01 <= sigma <= 0.017 for sigma in VLP16.range_noise)
    up, down = VLP16.dropout[8:], VLP16.dropout[:8]
    assert all(0.1 <= p <= 0.4 for p in up)
    assert np.mean(down) < np.mean(up)


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
    ],
)
def test_tables_that_make_no_sense_are_refused(change):
    with pytest.raises(InputError):
        replace(VLP16, **change)


def test_a_sensor_can_be_sent_to_another_process():
    assert pickle.loads(pickle.dumps(VLP16)) == VLP16
