"""A base that is not quite where it is declared is found as that, and no step between rows is made of it."""

import numpy as np
import pytest
from made_folders import PLAN, made_folder, made_table
from scipy.spatial.transform import Rotation

from elastocal.diagnosis.diagnose import diagnose
from elastocal.diagnosis.settings import Settings
from elastocal.loop.whole import cases_in

SHIFT, TURN = np.array([1e-4, -5e-5, 8e-5]), np.array([-2.6e-4, -1.3e-4, 0.0])


def seen_from_elsewhere(table):
    """What a tracker measures of a robot whose base is shifted and tilted against the frame that it is registered to."""
    position = np.column_stack([table[axis] for axis in "xyz"])
    moved = Rotation.from_rotvec(TURN).apply(position) + SHIFT
    return table | dict(zip("xyz", moved.T, strict=True))


def document(kuka, config_folder, folder, moved, **changes):
    table = made_table(kuka, "made", plan=PLAN)
    made_folder(folder, kuka, table=seen_from_elsewhere(table) if moved else table, **changes)
    return diagnose(cases_in(folder, config_folder / "robots")[0], Settings(), 1).document


def test_a_tilted_base_is_named_with_its_tilt(kuka, config_folder, tmp_path):
    found = document(kuka, config_folder, tmp_path / "tilted", moved=True)
    (effect,) = found["effects"]
    assert (found["verdict"], effect["name"], effect["adopted"]) == ("named", "base_placement", True)
    values = {entry["name"].split()[-1]: entry for entry in effect["parameters"]}
    for name, true in zip(("dx", "dy", "dz", "rx", "ry"), (*SHIFT, *TURN[:2]), strict=True):
        assert values[name]["value"] == pytest.approx(true, abs=4 * values[name]["std_error"]), name


def test_a_base_where_it_is_declared_is_none(kuka, config_folder, tmp_path):
    assert document(kuka, config_folder, tmp_path / "right", moved=False)["verdict"] == "adequate"
