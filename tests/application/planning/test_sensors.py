"""The noise that is assumed of a sensor is one that a campaign may declare, and its source is named."""

import pytest

from elastocal.application.planning.sensors import SENSORS


@pytest.mark.parametrize("name", SENSORS)
def test_a_sensor_has_a_source_and_noise_of_what_it_reads(name):
    sensor = SENSORS[name]
    assert "Leica" in sensor.words or "arXiv" in sensor.words
    assert 1e-8 <= sensor.position_m <= 0.1
    assert ("pose" in sensor.measured) == (sensor.orientation_rad is not None)
    assert sensor.orientation_rad is None or 1e-8 <= sensor.orientation_rad <= 0.2
