"""The table of priors: complete, in the documentation as in the code, and in units of the arm."""

import re
from dataclasses import replace
from pathlib import Path

import pytest

from elastocal.effects.catalogue import candidates_on
from elastocal.effects.sizes import SIZES, size_of, sized
from elastocal.mechanics.sites import sites_of

METHOD = Path(__file__).parents[2] / "docs" / "method.md"
# Sized by what they do to the arm, or to the wrist alone.
ELASTIC = {"base_compliance", "compensator_stiffness", "cross_compliance", "flange_flexibility", "joint_dependent_stiffness"}
ELASTIC |= {"joint_tilt", "link_elasticity", "stiffening"}


def plausible(robot):
    return {
        (key, p.name): p.plausible for key, candidate in candidates_on(sites_of(robot)).items() for p in candidate.parameters
    }


def test_documentation_prints_the_table():
    lines = [
        f"| {s.effect}, {s.quantity} | {s.share:g} | {s.of} | {'+-'[s.sign < 0] if s.sign else ''} | {s.most:g} | {s.reason} |"
        for s in SIZES
    ]
    (table,) = re.findall(r"<details>.*?</details>", METHOD.read_text(encoding="utf-8"), re.DOTALL)
    assert [line for line in lines if line not in table] == [] and table.count("\n| ") == len(lines) + 1


def test_what_yields_is_sized_by_the_compliance_of_the_arm_and_nothing_else_is(fanuc):
    soft = replace(fanuc, compliance=100.0 * fanuc.compliance)
    stiff_sizes, soft_sizes = plausible(fanuc), plausible(soft)
    by_weight = {"compensator_torque", "link_weight"}
    for (key, name), size in stiff_sizes.items():
        effect = key.split("@")[0].split("[")[0]
        yields = effect in ELASTIC or (effect in by_weight and ("compliance" in name or "q" in name))
        assert soft_sizes[key, name] / size == pytest.approx(100.0 if yields else 1.0), (key, name)


def test_rigid_joints_are_sized_as_those_of_an_arm_of_this_load_and_reach(fanuc):
    rigid = replace(fanuc, compliance=0.0 * fanuc.compliance, payload_kg=165.0)
    for joint in range(6):
        ours = size_of("joint_tilt", "tilt", sites_of(rigid), joint)
        assert 0.1 < ours / fanuc.compliance[joint] < 3.0


def test_parameters_have_the_sign_of_the_table(fanuc):
    (tilt,) = sized("joint_tilt", "tilt", ["t"], "rad/(N m)", sites_of(fanuc), 0, over=4.0)
    assert (tilt.sign, tilt.plausible) == (1, pytest.approx(0.25 * fanuc.compliance[0]))
    assert sized("stiffening", "lost beyond", ["b"], "rad/(N m)", sites_of(fanuc), 0)[0].sign == -1
