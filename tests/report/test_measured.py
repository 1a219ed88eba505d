"""What was measured is counted for fitted and for validation poses."""

from made_loop_tables import DATA, residual_table

from elastocal.report.measured import tabulate_measured


def test_measurements_are_counted_for_fitted_and_for_validation_poses():
    table = residual_table(poses=30, repeats=2)
    rows = {
        name: cells for name, *cells in tabulate_measured(table, DATA["descriptions"])
    }
    assert rows["measurements"] == ["160, each a position", "80, each a position"]
    assert rows["poses"] == ["20 poses in 1 session", "10 poses in 1 session"]
    assert rows["loads"] == ["1 load of 500 N on 50\u00a0% of the measurements"] * 2
    assert rows["repeats of a state"] == ["2", "2"]
    assert rows["time"] == ["recorded", "recorded"]


def test_targets_that_are_fitted_and_turned_mounts_are_stated():
    campaign = DATA["descriptions"]["campaign"] | {
        "measured": "pose",
        "targets": {
            "A": {"point": "6DoF", "offset_m": "unknown"},
            "B": {"point": "3DoF", "offset_m": [0, 0, 0], "rotation": [0, 0, 0.5]},
        },
    }
    descriptions = DATA["descriptions"] | {"campaign": campaign}
    rows = dict(
        (row[0], row[1]) for row in tabulate_measured(residual_table(), descriptions)
    )
    assert rows["targets"] == (
        "A at the measuring point 6DoF, place and rotation fitted and "
        "B at the measuring point 3DoF, turned by 28.65°"
    )


def test_a_part_without_measurements_has_none():
    table = residual_table()
    table["held_out"][:] = False
    rows = {
        name: cells for name, *cells in tabulate_measured(table, DATA["descriptions"])
    }
    assert rows["measurements"] == ["120, each a position", "none"]
    assert rows["poses"] == ["30 poses in 1 session", ""]
