"""Campaigns of any robot in any dialect: the same numbers come back, or one line asks what is ambiguous; no other number."""

from dataclasses import replace

import numpy as np
import pytest
from fuzzed import over
from hypothesis import event, given
from hypothesis import strategies as st
from made_dialects import written_campaigns
from scipy.spatial.transform import Rotation
from support import robot_of

from elastocal.errors import InputError
from elastocal.exchange.measurement_table import ImportOptions, read_measurement_table


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    made = tmp_path_factory.mktemp("dialects") / "table.csv"
    made.touch()
    return made


def robot_for(made):
    words = " Tx(0.3) ".join(f"{'Tz' if slides else 'Rz'}(q{j})" for j, slides in enumerate(made.prismatic, 1))
    robot = robot_of(f"{words} Tx(0.2) [end]")
    return replace(robot, joint_names=made.joint_names) if made.joint_names else robot


def assert_meant(found, made):
    """The numbers of the file, in SI units and base axes, and nothing else."""
    table = found.table
    assert len(table["x"]) == len(made.rows["x"])
    for name, values in made.rows.items():
        if name == "target":
            assert table["target"].tolist() == values.tolist()
        elif name == "rotation":
            got = Rotation.from_rotvec(np.column_stack([table[each] for each in ("rx", "ry", "rz")])).as_matrix()
            np.testing.assert_allclose(got, values, atol=1e-6)
        else:
            np.testing.assert_allclose(table[name], values, rtol=1e-9, atol=1e-9, err_msg=name)
    assert ("rx" in table) == ("rotation" in made.rows)
    assert set(table) <= {*made.rows, "rx", "ry", "rz", "pose", "load", "repeat"}
    # Nothing of the file is left unmentioned.
    words = " ".join(found.notes)
    mentioned = {*(found.options.columns or {}).values(), *found.ignored}
    assert [header for header in made.headers if header not in mentioned and repr(header) not in words] == []
    poses = np.unique(np.column_stack([table[name] for name in table if name[0] == "q"]), axis=0)
    assert len(np.unique(table["pose"])) == len(poses)


@given(written_campaigns())
def test_a_campaign_is_read_as_it_was_measured_where_what_is_ambiguous_is_stated(path, made):
    def read():
        found = read_measurement_table(path, ImportOptions(**made.options), robot_for(made))
        assert_meant(found, made)
        again = read_measurement_table(path, found.options)
        assert again.options == found.options
        assert all(np.array_equal(again.table[name], found.table[name]) for name in found.table)

    try:
        path.write_bytes(made.content)
        read()
    except InputError as error:
        raise AssertionError(f"{error}\n{made.dialect}\n{made.content[:600]!r}") from error


@given(
    written_campaigns(),
    st.sets(st.sampled_from(["units", "rotation", "target", "targets", "decimal", "separator"])),
    st.booleans(),
)
def test_what_is_not_stated_is_found_out_rightly_or_asked_for(path, made, dropped, known):
    options = {key: value for key, value in made.options.items() if key not in dropped}
    if "units" in dropped and "time_s" in made.options["units"]:
        # Time without a unit is in s, which a note says.
        options["units"] = {"time_s": made.options["units"]["time_s"]}
    outcome = []

    def read():
        found = read_measurement_table(path, ImportOptions(**options), robot_for(made) if known else None)
        assert_meant(found, made)
        outcome.append("read")

    over(path, made.content, read)
    event(outcome[0] if outcome else "asked")
