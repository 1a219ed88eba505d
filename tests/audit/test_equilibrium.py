"""Where an arm stands under loads and weights: no small turn does work there."""

import json

import numpy as np
import pandas as pd
import pytest
from made_audits import CONFIGURATION

from elastocal_proof.audit.arm import Arm
from elastocal_proof.audit.audited import WRENCH, Audited
from elastocal_proof.audit.equilibrium import sagging

CHAIN = "Tz(0.4) Rz(q1) Tx(0.1) Ry(q2) Tx(0.7) Ry(q3) Tx(0.5) [hand]"
MASSES = [
    {"link": 0, "mass_kg": 90.0, "centre_m": [0.0, 0.0, 0.2], "relative_std": 0.1},
    {"link": 2, "mass_kg": 60.0, "centre_m": [0.4, 0.02, 0.03], "relative_std": 0.1},
    {"link": 3, "mass_kg": 25.0, "centre_m": [0.2, 0.0, -0.05], "relative_std": 0.1},
]
ROBOT = {"name": "three joints", "chain": CHAIN, "masses": MASSES, "gravity_m_s2": [0.5, -1.0, -9.7]}
SPRINGS, OFFSET = np.array([2e-6, 5e-6, 8e-6]), [0.0, 0.1, 0.02]
# Of the second link, as fitted.
MORE_KG, MORE_KG_M = 3.0, np.array([0.4, -0.2, 0.1])


@pytest.fixture
def run(tmp_path):
    for folder in ("results/loop/cell", "reports/loop/cell"):
        (tmp_path / folder).mkdir(parents=True)
    asked = {"targets": {"a": {"point": "hand", "offset_m": OFFSET}}}
    (tmp_path / "results/loop/cell/campaign.json").write_text(json.dumps({"campaign": asked, "robot": ROBOT}))
    verdict = {"compliance_urad_per_Nm": {"before": (1e6 * SPRINGS).tolist()}}
    (tmp_path / "reports/loop/cell/verdict.json").write_text(json.dumps(verdict))
    steps = [{"kind": "declared", "noise": {"position_m": 6e-5}}]
    (tmp_path / "results/loop/cell/diagnosis.json").write_text(json.dumps({"steps": steps}))
    names = ["c1", "c2", "c3", "mass_error_of_link_2", *(f"moment_error_{axis}_of_link_2" for axis in "xyz")]
    table = pd.DataFrame({"parameter": names, "value": [*SPRINGS, MORE_KG, *MORE_KG_M]})
    table["owner"] = 3 * ["joint_compliance"] + 4 * ["declared_weight"]
    table.assign(step=0, std_error=1e-8, held=[True] + 6 * [False]).to_parquet(tmp_path / "results/loop/cell/steps.parquet")
    return Audited(tmp_path, CONFIGURATION, {}, {}, 4)


def test_where_an_arm_stands_loads_and_weights_do_as_much_work_as_its_springs(run):
    draws = np.random.default_rng(4)
    angles, force = draws.uniform(-1, 1, 3), np.array([300.0, -200.0, -500.0])
    row = pd.DataFrame([[*angles, *force, 0, 0, 0, 0]], columns=["q1", "q2", "q3", *WRENCH, "target"])
    (stand,) = sagging(run, "cell").standing(row)
    # Weights as points: where the centre of each is, at the end of a chain of its own.
    masses = {2: (60.0 + MORE_KG, np.array([0.4, 0.02, 0.03]), MORE_KG_M), 3: (25.0, np.array([0.2, 0.0, -0.05]), np.zeros(3))}
    until = {2: "Tz(0.4) Rz(q1) Tx(0.1) Ry(q2)", 3: "Tz(0.4) Rz(q1) Tx(0.1) Ry(q2) Tx(0.7) Ry(q3)"}
    gravity, hand = np.array(ROBOT["gravity_m_s2"]), Arm({"chain": CHAIN})
    centres = {
        link: Arm({"chain": f"{until[link]} [at]"}, centre + beyond / mass) for link, (mass, centre, beyond) in masses.items()
    }

    def work(coordinates):
        found = force @ hand.pose(coordinates, "hand")[0]
        for link, (mass, _, _) in masses.items():
            found += mass * gravity @ centres[link].pose(coordinates[:link], "at")[0]
        return found

    # Where the work of another small turn is that against the springs.
    coordinates = angles
    for _ in range(20):
        torques = [(work(coordinates + step) - work(coordinates - step)) / 2e-5 for step in 1e-5 * np.eye(3)]
        coordinates = angles + SPRINGS * torques
    expected = Arm({"chain": CHAIN}, OFFSET).pose(coordinates, "hand")[0]
    moved = np.linalg.norm(expected - Arm({"chain": CHAIN}, OFFSET).pose(angles, "hand")[0])
    assert moved > 1e-3
    np.testing.assert_allclose(stand.position, expected, rtol=0, atol=1e-6 * moved)
    # Three evaluations of the loads come within a few cubes of deflection over reach.
    assert 0 < stand.left_m < 1e-4 * moved
    assert not stand.slack_m[:, 0].any() and stand.slack_m[:, 1:].any()


def test_springs_that_nobody_knows_are_not_put_under_loads(run):
    (run.folder / "reports/loop/cell/verdict.json").write_text(json.dumps({"compliance_urad_per_Nm": None}))
    assert sagging(run, "cell") is None
