"""A diagnosis as files and back: one writer, one reader, and the same verdict from either."""

import json

import numpy as np
import pytest
from made_folders import PLAN, made_folder, made_table

from elastocal.diagnosis.diagnose import diagnose
from elastocal.diagnosis.judge import judge
from elastocal.diagnosis.next_experiment import propose
from elastocal.diagnosis.settings import Settings
from elastocal.io.storage import read_table, write_table
from elastocal.loop import diagnosis_tables as tables
from elastocal.loop.schemas import CANDIDATES, CONFOUNDING, MODELS, STEPS
from elastocal.loop.whole import cases_in


def there_and_back(path, schema, blocks):
    write_table(path, schema, blocks, {})
    return read_table(path, schema)


def came_back(diagnosis, folder):
    """The diagnosis of its files."""
    facts = json.loads(json.dumps(tables.diagnosis_facts(diagnosis)))
    steps = there_and_back(folder / "s.parquet", STEPS, tables.step_blocks(diagnosis))
    return tables.diagnosis_from(diagnosis.case, facts, steps)


def cases_of(folder, robots, robot, **changes):
    table = made_table(robot, "made", plan=PLAN, offset_of_joint_3=changes.pop("offset", 0.0))
    return cases_in(made_folder(folder / "made", robot, table=table, **changes), robots)


@pytest.fixture(scope="module")
def found(kuka, config_folder, tmp_path_factory):
    """A diagnosis with frames, an unknown target, springs and an effect, and its held-out case."""
    folder = tmp_path_factory.mktemp("tables")
    targets = {"3DoF": {"point": "3DoF", "offset_m": [0, 0, 0]}, "6DoF": {"point": "6DoF", "offset_m": "unknown"}}
    case, held_out = cases_of(folder, config_folder / "robots", kuka, offset=1e-3, frame="tracker", targets=targets)
    return diagnose(case, Settings(), 1), held_out


@pytest.fixture(scope="module")
def faulty(kuka, config_folder, tmp_path_factory):
    """A diagnosis that ended at a fault of the data: loads turned round."""
    table = made_table(kuka, "made")
    table |= {name: -table[name] for name in ("fx", "fy", "fz", "mx", "my", "mz")}
    folder = made_folder(tmp_path_factory.mktemp("faulty") / "made", kuka, table=table)
    case, held_out = cases_in(folder, config_folder / "robots")
    diagnosis = diagnose(case, Settings(), 1)
    assert diagnosis.evidence is None
    return diagnosis, held_out


@pytest.fixture(scope="module")
def unsure(kuka, config_folder, tmp_path_factory):
    """A diagnosis that names an effect which is not expected to make predictions better."""
    case, held_out = cases_of(tmp_path_factory.mktemp("unsure"), config_folder / "robots", kuka, offset=1e-3)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("elastocal.diagnosis.diagnose.expected_to_help", lambda problem, posterior, model: False)
        return diagnose(case, Settings(), 1), held_out


def test_an_effect_that_is_not_expected_to_help_is_named_and_the_model_stays_as_declared(unsure, kuka, tmp_path):
    diagnosis, held_out = unsure
    (entry,) = diagnosis.document["effects"]
    assert diagnosis.document["verdict"] == "named" and entry["name"] == "joint_offset" and not entry["adopted"]
    # What it would be is said all the same.
    assert abs(entry["parameters"][0]["value"] - 1e-3) < 1e-4
    assert [step.kind for step in diagnosis.steps] == ["frames", "declared"] and diagnosis.final is diagnosis.declared
    assert any("stays as declared" in warning for warning in diagnosis.document["warnings"])
    # Noise and convergence are those of the model that stays.
    noise = diagnosis.document["noise"]
    assert noise["factor"] == diagnosis.declared.noise.position_m / noise["position_m"]
    assert diagnosis.document["converged"]["final"] == diagnosis.declared.converged
    verdict = judge(diagnosis, held_out, 1).document
    assert verdict["heldout"]["before"] == verdict["heldout"]["after"] and verdict["effects"][0]["heldout_gain"] is None
    back = came_back(diagnosis, tmp_path)
    assert [step.kind for step in back.steps] == ["frames", "declared"]
    assert not any(effect["adopted"] for effect in judge(back, held_out, 1).document["effects"])
    # And the next experiment can be planned.
    assert propose(diagnosis, kuka.joint_limits, Settings(), np.random.default_rng(0)).best == ("joint_offset",)


@pytest.mark.parametrize("kind", ["found", "faulty"])
def test_a_diagnosis_comes_back_and_is_judged_the_same(kind, request, tmp_path):
    diagnosis, held_out = request.getfixturevalue(kind)
    back = came_back(diagnosis, tmp_path)
    assert [(step.name, step.kind) for step in back.steps] == [(step.name, step.kind) for step in diagnosis.steps]
    for mine, theirs in zip(back.steps, diagnosis.steps, strict=True):
        assert mine.fitted.parameters == theirs.fitted.parameters, mine.name
        assert vars(mine.fitted.noise).keys() == vars(theirs.fitted.noise).keys()
        assert mine.fitted.noise.pose_rad == theirs.fitted.noise.pose_rad
        # It is fitted again from where it ended: to a thousandth of a standard error.
        np.testing.assert_allclose(mine.fitted.residual, theirs.fitted.residual, atol=1e-7)
        deviation = np.sqrt(np.diag(theirs.fitted.covariance))
        np.testing.assert_allclose(np.sqrt(np.diag(mine.fitted.covariance)), deviation, rtol=1e-2)
        assert mine.fitted.held.tolist() == theirs.fitted.held.tolist()
    one, other = (judge(each, held_out, 1) for each in (diagnosis, back))
    for name in ("before", "after"):
        assert one.document["heldout"][name] == pytest.approx(other.document["heldout"][name], rel=1e-3)
    same = [
        {key: document[key] for key in document if key not in ("heldout", "effects", "repeatable")}
        for document in (one.document, other.document)
    ]
    assert (one.document["repeatable"] or {}) == pytest.approx(other.document["repeatable"] or {}, rel=1e-3)
    assert json.loads(json.dumps(same[0])) == json.loads(json.dumps(same[1]))
    assert [row["step"] for row in one.rows] == [row["step"] for row in other.rows]


def test_models_table_is_the_posterior(found, tmp_path):
    diagnosis, _ = found
    table = there_and_back(tmp_path / "m.parquet", MODELS, [tables.model_columns(diagnosis)])
    assert table["probability"].sum() == pytest.approx(1.0)
    assert (np.diff(table["probability"]) <= 0).all() and table["model"].tolist() == list(range(len(table["model"])))
    assert "joint_offset" in table["mechanisms"][0] and "joint_offset@3" in table["units"][0]
    assert table["mechanisms"][table["units"] == ""].tolist() == ["nothing"]
    # What a model states counts in the verdict's probabilities, whatever its parts are.
    for name, probability in diagnosis.evidence.conclusion.mechanisms.items():
        having = [name in stated.split(" + ") for stated in table["mechanisms"]]
        assert table["probability"][having].sum() == pytest.approx(probability, abs=1e-9)


def test_every_candidate_is_in_the_table_tested_or_with_a_reason(found, tmp_path):
    diagnosis, _ = found
    table = there_and_back(tmp_path / "c.parquet", CANDIDATES, [tables.candidate_columns(diagnosis)])
    assert set(table["candidate"]) == set(diagnosis.case.candidates)
    tested = np.isfinite(table["log_bayes_factor"])
    assert (tested == (table["note"] == "")).all() and tested.any() and not tested.all()
    assert (np.diff(table["log_bayes_factor"][tested]) <= 0).all()
    assert (table["probability"][tested] >= 0).all() and (table["noncentrality"][tested] > 0).all()
    assert table["candidate"][table["chosen"]].tolist() == ["joint_offset@3"]
    assert table["probability"][table["chosen"]][0] > 0.9 and table["angle_deg"][table["chosen"]][0] < 1e-3
    for key, joints, effect in zip(table["candidate"], table["joints"], table["effect"], strict=True):
        assert joints == "+".join(map(str, diagnosis.case.candidates[key].joints)) and key.startswith(effect)


def test_tables_of_a_faulty_campaign_have_no_rows_but_for_the_candidates(faulty, tmp_path):
    diagnosis, _ = faulty
    assert len(there_and_back(tmp_path / "m.parquet", MODELS, [tables.model_columns(diagnosis)])["model"]) == 0
    assert len(there_and_back(tmp_path / "f.parquet", CONFOUNDING, [tables.confounding_columns(diagnosis)])["one"]) == 0
    candidates = there_and_back(tmp_path / "c.parquet", CANDIDATES, [tables.candidate_columns(diagnosis)])
    assert set(candidates["note"]) == {"the measurements are at fault"} and not candidates["chosen"].any()
