"""Sizes of effects: complete in the documentation, in units of the arm, with levers and
weights calculated by hand."""

from dataclasses import replace

import numpy as np
import pytest
from catalogue_lists import METHOD, SIZES, has_own_test, size_lines
from support import chain_of
from synthetic import equipped

from elastocal.effects.catalogue import candidates_on, list_bundled_effects
from elastocal.effects.sizes import full_torque_Nm, lever_m, link_width_m
from elastocal.mechanics.robot import Mass
from elastocal.mechanics.sites import build_sites

# Sized by what they do to the arm, or to the wrist alone.
ELASTIC = {
    "base_compliance",
    "compensator_stiffness",
    "cross_compliance",
    "flange_flexibility",
    "joint_dependent_stiffness",
}
ELASTIC |= {"joint_tilt", "link_elasticity", "stiffening"}


def plausible(robot):
    return {
        (key, p.name): p.plausible
        for key, candidate in candidates_on(build_sites(robot)).items()
        for p in candidate.parameters
    }


def test_the_documentation_has_the_table_of_all_sizes():
    """`make catalogue` writes the table; effects of other packages are not in it."""
    table = SIZES.search(METHOD.read_text(encoding="utf-8"))[2].splitlines()
    rows = {}
    for name, effect in list_bundled_effects().items():
        rows[name] = size_lines(effect)
        if has_own_test(effect) and not any(f"| {name}, " in row for row in table):
            # A new effect, which the next `make catalogue` enters.
            rows[name] = []
    assert table[2:] == [line for lines in rows.values() for line in lines]


def test_only_sizes_of_elastic_effects_scale_with_the_compliance_of_the_arm(fanuc):
    soft = replace(fanuc, compliance=100.0 * fanuc.compliance)
    stiff_sizes = plausible(fanuc)
    soft_sizes = plausible(soft)
    by_weight = {"compensator_torque", "link_weight"}
    for (key, name), size in stiff_sizes.items():
        effect = key.split("@")[0].split("[")[0]
        yields = effect in ELASTIC or (
            effect in by_weight and ("compliance" in name or "q" in name)
        )
        assert soft_sizes[key, name] / size == pytest.approx(
            100.0 if yields else 1.0
        ), (key, name)


def test_rigid_joints_get_the_typical_compliance_of_an_arm_of_this_load_and_reach(
    fanuc,
):
    rigid = replace(fanuc, compliance=0.0 * fanuc.compliance, payload_kg=165.0)
    for joint in range(6):
        ours = list_bundled_effects()["joint_tilt"].size(
            "tilt", build_sites(rigid), joint
        )
        assert 0.1 < ours / fanuc.compliance[joint] < 3.0


def test_parameters_have_the_sign_of_their_size(fanuc):
    effects = list_bundled_effects()
    (tilt,) = effects["joint_tilt"].parameters(
        "tilt", ["t"], "rad/(N m)", build_sites(fanuc), 0, over=4.0
    )
    assert (tilt.sign, tilt.plausible) == (1, pytest.approx(0.25 * fanuc.compliance[0]))
    assert (
        effects["stiffening"]
        .parameters("lost beyond", ["b"], "rad/(N m)", build_sites(fanuc), 0)[0]
        .sign
        == -1
    )


def test_a_bearing_wobbles_by_its_shift_over_its_diameter():
    """A tenth of the length of the arm; by hand."""
    sites = equipped(chain_of("Rz(q1) Tz(1) Ry(q2) Tx(2) Ry(q3) Tx(0.1) [hand]"))
    runout = list_bundled_effects()["bearing_runout"]
    assert link_width_m(sites) == pytest.approx(0.31)
    shift_m, wobble_rad = (runout.size(name, sites) for name in ("shift", "wobble"))
    assert wobble_rad == pytest.approx(shift_m / 0.31)
    # An arm without long links has bearings, too.
    assert link_width_m(equipped(chain_of("Rz(q1) Ry(q2) Tx(0.1) [hand]"))) == 0.03


def test_the_full_torque_has_at_least_the_lever_of_a_tool_and_includes_the_links():
    """Levers of the outstretched arm, by hand; the weight of a mass half way along its
    link."""
    # The weight of a robot that stands on the moon.
    sites = replace(
        equipped(chain_of("Rz(q1) Tz(1) Ry(q2) Tx(2) Ry(q3) Tx(0.1) [hand]")),
        gravity_m_s2=(0.0, 0.0, -1.62),
    )
    assert [lever_m(sites, joint) for joint in range(3)] == pytest.approx(
        [3.1, 2.1, 0.5]
    )
    g = 1.62
    # Eight kilograms a cubic metre of reach suit an arm whose rated load is not known.
    assert [full_torque_Nm(sites, joint) for joint in range(3)] == pytest.approx(
        np.array([3.1, 2.1, 0.5]) * 8 * 3.1**3 * g
    )
    loaded = replace(
        sites, payload_kg=10.0, masses=(Mass(2, 30.0, (-1.0, 0.0, 0.0), 0.1),)
    )
    # It turns joint 2 at a metre, and joint 1, whose axis stands upright, not at all;
    # it is before joint 3.
    torques = [full_torque_Nm(loaded, joint) for joint in range(3)]
    assert torques[0] == pytest.approx(31 * g) and torques[2] == pytest.approx(5 * g)
    # The longest lever is that of some poses, so almost that of the arm outstretched.
    assert 0.98 * 30 * g < torques[1] - 21 * g <= 30 * g
