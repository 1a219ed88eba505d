"""Rows of several kinds are read, and rows that name no kind or feature are refused."""

import numpy as np
import pytest
from contact_campaigns import write_contacts
from support import refused

from elastocal.campaigns.campaign import build_measurements, tabulate_measurements
from elastocal.campaigns.reading import read_campaign

MIXED = {
    "measured": ["position", "plane"],
    "features": {"table": {"kind": "plane"}},
    "noise": {"position_m": 1e-4, "by_kind": {"plane": 5e-5}},
}


def make_rows(count=20):
    draws = np.random.default_rng(1)
    rows = []
    for number in range(count):
        row = {"angles": draws.uniform(-1, 1, 6)}
        if number % 2:
            row |= {"x": 0.1, "y": 0.2, "z": 0.3 + 0.01 * number, "feature": ""}
        else:
            row |= {"x": 0.0, "y": 0.0, "z": 0.0, "feature": "table", "value": 0.001}
        rows.append(row)
    return rows


def test_each_number_of_a_mixed_campaign_is_a_measurement_with_its_spread(tmp_path):
    campaign = read_campaign(write_contacts(tmp_path / "cell", MIXED, make_rows()))
    measurements = campaign.measurements
    assert len(measurements) == 10 + 3 * 10
    assert measurements.position.shape == (40, 1)
    np.testing.assert_array_equal(measurements.row[:4], [1, 2, 2, 2])
    np.testing.assert_array_equal(measurements.channel[:4], [3, 0, 1, 2])
    np.testing.assert_allclose(measurements.position[:4, 0], [0.001, 0.1, 0.2, 0.31])
    np.testing.assert_allclose(measurements.spread[:4], [0.5, 1, 1, 1])
    read_back = build_measurements(tabulate_measurements(measurements))
    np.testing.assert_array_equal(read_back.position, measurements.position)
    np.testing.assert_array_equal(read_back.channel, measurements.channel)


@pytest.mark.parametrize(
    ("change", "phrases"),
    [
        ({"feature": "tabel"}, ("line 2, column feature", "'tabel'", "table")),
        ({"kind": "plan"}, ("column kind", "'plan'", "position, plane")),
        ({"kind": "plane", "feature": ""}, ("column feature", "kind plane")),
    ],
)
def test_a_row_without_a_kind_or_feature_is_refused(tmp_path, change, phrases):
    rows = make_rows()
    rows[0] |= change
    with refused((tmp_path / "cell" / "measurements.csv").as_posix(), *phrases):
        read_campaign(write_contacts(tmp_path / "cell", MIXED, rows))


def test_a_feature_that_no_row_touches_is_refused(tmp_path):
    features = {"table": {"kind": "plane"}, "wall": {"kind": "plane"}}
    with refused(
        (tmp_path / "cell" / "campaign.yaml").as_posix(),
        "features.wall",
        "no row of it",
    ):
        read_campaign(
            write_contacts(
                tmp_path / "cell", MIXED | {"features": features}, make_rows()
            )
        )


def test_a_table_without_a_column_of_its_kind_is_refused(tmp_path):
    document = {"measured": "distance", "features": {"wire": {}}}
    rows = [row | {"feature": "wire"} for row in make_rows()]
    for row in rows:
        row.pop("value", None)
    table = (tmp_path / "cell" / "measurements.csv").as_posix()
    with refused(table, "no column 'value'"):
        read_campaign(write_contacts(tmp_path / "cell", document, rows))
