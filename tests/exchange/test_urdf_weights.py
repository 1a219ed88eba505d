"""What is merged into the mass of a link, by hand; torques are in test_urdf."""

import numpy as np
import pytest
from made_urdf import joint, link, written

from elastocal.exchange import URDF_MASS_STD
from elastocal.exchange.urdf_chain import chain_between
from elastocal.exchange.urdf_reading import read_urdf
from elastocal.exchange.urdf_weights import gravity_in_base, weights_of


def weights(tmp_path, *parts, base="base", tip="hand", **more):
    urdf = read_urdf(written(tmp_path, *parts))
    return weights_of(urdf, chain_between(urdf, base, tip, (), "made.urdf"), **more)


ARM = (
    link("base", 9.0),
    link("arm", 2.0, (0.1, 0, 0)),
    link("hand", 0.0),
    joint("j1", "base", "arm", xyz=(0, 0, 1), axis=(0, 1, 0)),
    joint("end", "arm", "hand", "fixed", (1, 0, 0)),
)
GRIPPER = (link("grip", 1.0), joint("bolt", "hand", "grip", "fixed", (0, 0, 0.3)))


def test_what_is_bolted_on_weighs_with_the_link_that_carries_it(tmp_path):
    found = weights(tmp_path, *ARM, *GRIPPER)
    assert [entry["link"] for entry in found.masses] == [0, 1]
    assert found.masses[1] == {
        "link": 1,
        "mass_kg": 3.0,
        "centre_m": pytest.approx([(2 * 0.1 + 1) / 3, 0, 0.1]),
        "relative_std": URDF_MASS_STD,
    }
    assert found.notes == ()


def test_equal_masses_are_placeholders(tmp_path):
    parts = [link(name, 2.0) for name in "abcd"] + [joint(f"j{n}", "abcd"[n], "abcd"[n + 1]) for n in range(3)]
    found = weights(tmp_path, *parts, base="a", tip="d")
    assert found.masses == [] and "2 kg: placeholders" in found.notes[0]
    other = weights(tmp_path, link("a", 2.1), *parts[1:], base="a", tip="d")
    assert len(other.masses) == 4


def test_behind_a_passive_joint_a_mass_is_told(tmp_path):
    parts = (link("b"), link("c"), link("d", 1.0), joint("j1", "b", "c"), joint("j2", "c", "d", mimic=("j1", -1.0, 0.0)))
    found = weights(tmp_path, *parts, base="b", tip="d")
    assert "passive" in found.notes[0] and found.notes[0].endswith(" d")


def test_gravity_turns_with_a_base_that_does_not_stand_upright(tmp_path):
    wall = (link("wall"), joint("bolts", "wall", "base", "fixed", rpy=(0, np.pi / 2, 0)))
    urdf = read_urdf(written(tmp_path, *wall, *ARM))
    assert gravity_in_base(urdf, "base") == pytest.approx([9.80665, 0, 0])
    assert gravity_in_base(urdf, "wall") is None
