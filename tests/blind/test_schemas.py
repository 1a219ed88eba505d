"""The columns of the closed loop have names, units and meanings."""

from elastocal_proof.blind import schemas


def test_every_column_has_a_unique_name_and_a_meaning():
    columns = schemas.CLOSED_LOOP.for_joints(7).columns
    names = [column.name for column in columns if column.meaning]
    assert len(set(names)) == len(columns) == len(names)
    angle_names = [name for name in names if name[0] == "q"]
    assert angle_names == [f"q{joint}" for joint in range(1, 8)]
