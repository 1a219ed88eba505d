"""What training poses say of a campaign: noise, faults, effects one at a time, and the
figures of the verdict."""

from dataclasses import replace

import numpy as np
import pytest
from made_folders import PLAN, make_folder, make_table

from elastocal.data_checks.protocol import Fault
from elastocal.diagnosis import diagnose as module
from elastocal.diagnosis import model_averaging
from elastocal.diagnosis.diagnose import diagnose
from elastocal.diagnosis.judge import judge
from elastocal.diagnosis.next_experiment import propose_experiment
from elastocal.diagnosis.settings import Settings
from elastocal.loop.whole import read_cases

OFFSET = 1e-3


@pytest.fixture(scope="module")
def diagnosed(kuka, config_folder, tmp_path_factory):
    """Diagnoses by the noise that is declared, m, of measurements that scatter by 60 um
    without repeats."""
    found = {}
    for declared_m in (6e-5, 1e-6):
        folder = tmp_path_factory.mktemp("noise") / "made"
        table = make_table(kuka, "made", plan=PLAN, offset_of_joint_3=OFFSET)
        first = [repeat == 0 for repeat in table["repeat"]]
        table = {
            name: [value for value, kept in zip(values, first, strict=True) if kept]
            for name, values in table.items()
        }
        changes = {"noise": {"position_m": declared_m}, "declared": ["link_geometry"]}
        case, _ = read_cases(
            make_folder(folder, kuka, table=table, **changes), config_folder / "robots"
        )
        found[declared_m] = diagnose(case, Settings(), 1)
    return found


def test_a_model_that_is_kept_without_what_was_found_has_the_noise_that_it_leaves(
    kuka, config_folder, tmp_path
):
    table = make_table(kuka, "made", plan=PLAN, offset_of_joint_3=OFFSET)
    case, _ = read_cases(
        make_folder(tmp_path / "made", kuka, table=table, declared=[]),
        config_folder / "robots",
    )
    kept = diagnose(case, Settings(useful=1e9), 1)
    assert [effect["adopted"] for effect in kept.document["effects"]] == [
        False
    ] and kept.document["kept"] == "declared"
    factor = kept.document["noise"]["factor"]
    assert factor > 1.1 and factor == pytest.approx(
        np.sqrt(kept.document["misfit"]["before"])
    )


def _priors(fitted):
    return {
        parameter.prior_std
        for owner, parameter in fitted.parameters
        if owner.startswith("link_geometry") and parameter.sized
    }


def test_sizes_and_verdict_do_not_follow_the_noise_that_was_declared(diagnosed):
    right = diagnosed[6e-5]
    wrong = diagnosed[1e-6]
    assert (
        _priors(right.declared)
        == _priors(right.final)
        == _priors(wrong.declared)
        == _priors(wrong.final)
    )
    # The wrong zero of a joint is a wrong geometry of its link, which is declared.
    assert right.document["verdict"] == wrong.document["verdict"] == "adequate"
    assert right.document["noise"]["factor"] == pytest.approx(1.0, abs=0.3)
    assert wrong.document["noise"]["factor"] == pytest.approx(60.0, rel=0.3)
    errors = [np.sqrt(np.diag(each.final.covariance)) for each in (right, wrong)]
    np.testing.assert_allclose(errors[0], errors[1], rtol=0.35)
    assert right.final.converged and wrong.final.converged


@pytest.mark.parametrize("error_rad", [0.0, 3e-4])
def test_an_error_that_all_measurements_of_a_pose_share_is_noise_of_the_model_and_said(
    error_rad, kuka, config_folder, tmp_path
):
    """Joints that stand otherwise in each pose than they report, by the same in all of
    its measurements."""
    table = make_table(kuka, "made", plan=replace(PLAN, poses=40))
    drawn = error_rad * np.random.default_rng(3).standard_normal(
        (max(table["pose"]) + 1, 6)
    )
    table |= {
        f"q{joint}": table[f"q{joint}"] + drawn[table["pose"], joint - 1]
        for joint in range(1, 7)
    }
    case, _ = read_cases(
        make_folder(tmp_path / "made", kuka, table=table), config_folder / "robots"
    )
    found = diagnose(case, Settings(), 1)
    said = [line for line in found.document["warnings"] if "err together" in line]
    assert found.document["verdict"] == "adequate"
    assert len(said) == (error_rad > 0)
    # To the steps of its grid, of which neighbours differ by a factor of two.
    assert found.final.noise.pose_rad == pytest.approx(error_rad, rel=0.8)
    assert found.document["noise"]["pose_rad"] == found.final.noise.pose_rad


@pytest.fixture(scope="module")
def case(cases):
    return cases[0]


def test_steps_go_from_the_frames_alone_to_the_springs_to_the_effect(diagnosis):
    """Springs are declared as to be identified; the frame is the base, so that the
    first step has nothing to fit."""
    effects = [
        [effect.key for effect in step.fitted.model.effects] for step in diagnosis.steps
    ]
    springs = [key for key in effects[1] if key.startswith("joint_compliance")]
    assert effects == [[], springs, [*springs, "joint_offset@3"]] and len(springs) == 1
    assert (
        diagnosis.declared is diagnosis.steps[1].fitted
        and diagnosis.final is diagnosis.steps[2].fitted
    )
    size = diagnosis.final.estimate.coefficients[-1][0]
    assert size == pytest.approx(
        OFFSET, abs=4 * np.sqrt(diagnosis.final.covariance[-1, -1])
    )


@pytest.mark.parametrize(
    ("verdict", "names"), [("named", ["fault_0"]), ("several", ["fault_0", "fault_1"])]
)
def test_measurements_at_fault_end_the_diagnosis_at_the_declared_model(
    verdict, names, case, monkeypatch
):
    found = [Fault(name, (), "as measured", (), (1.0, 1.0)) for name in names]
    monkeypatch.setattr(module, "find_faults", lambda campaign: found)
    monkeypatch.setattr(module, "_settle_rows", None)
    diagnosis = diagnose(case, Settings(), 1)
    document = diagnosis.document
    assert diagnosis.evidence is None and diagnosis.final is diagnosis.declared
    assert (
        document["verdict"] == verdict
        and [entry["name"] for entry in document["effects"]] == names
    )
    assert (
        document["probabilities"],
        document["misfit"],
        document["candidates_tested"],
    ) == (None, None, 0)


def test_frames_alone_are_kept_where_they_predict_left_out_poses_better(
    kuka, config_folder, tmp_path, monkeypatch
):
    table = make_table(kuka, "made", offset_of_joint_3=OFFSET)
    folder = make_folder(
        tmp_path / "made", kuka, table=table, declared=["link_geometry"]
    )
    case, held_out = read_cases(folder, config_folder / "robots")
    settings = replace(Settings(), numbers_a_parameter=np.inf)
    usual = diagnose(case, settings, 1)
    assert usual.document["kept"] != "frames" and not any(
        "left out in turn" in line for line in usual.document["warnings"]
    )
    # Were they to lose by less and by more than the standard error of the difference, a
    # fifth.
    off = np.linspace(-1.0, 1.0, 25)
    off /= off.std(ddof=1)
    for excess in (0.15, 0.25):
        squares = np.full(25, 3.0), 3.0 + off + excess
        monkeypatch.setattr(
            module,
            "predict_left_out_squares",
            lambda each, _, squares=squares: squares[bool(each.model.effects)],
        )
        found = diagnose(case, settings, 1)
        assert (found.document["kept"] == "frames") == (excess > 0.2)
    assert found.steps[-1].kind == "kept" and found.final.model.effects == ()
    assert any(
        "left out in turn" in line and "frames and targets alone" in line
        for line in found.document["warnings"]
    )
    heldout = judge(found, held_out, 1).document["heldout"]
    assert heldout["after"]["rms_m"] == pytest.approx(
        heldout["uncalibrated"]["rms_m"], rel=1e-3
    )
    assert (
        diagnose(case, replace(settings, numbers_a_parameter=0.0), 1).document["kept"]
        != "frames"
    )


def test_an_effect_that_is_not_expected_to_help_is_named_and_the_model_stays_as_declared(
    cases, kuka, monkeypatch
):
    monkeypatch.setattr(
        model_averaging, "is_expected_to_help", lambda problem, posterior, model: False
    )
    diagnosis = diagnose(cases[0], Settings(), 1)
    held_out = cases[1]
    (entry,) = diagnosis.document["effects"]
    assert (
        diagnosis.document["verdict"] == "named"
        and entry["name"] == "joint_offset"
        and not entry["adopted"]
    )
    # What it would be is said all the same.
    assert abs(entry["parameters"][0]["value"] - 1e-3) < 1e-4
    assert [step.kind for step in diagnosis.steps] == [
        "frames",
        "declared",
    ] and diagnosis.final is diagnosis.declared
    assert any(
        "stays as declared" in warning for warning in diagnosis.document["warnings"]
    )
    # The noise is that of the model that stays.
    noise = diagnosis.document["noise"]
    assert noise["factor"] == diagnosis.declared.noise.position_m / noise["position_m"]
    verdict = judge(diagnosis, held_out, 1).document
    assert (
        verdict["heldout"]["before"] == verdict["heldout"]["after"]
        and verdict["effects"][0]["heldout_gain"] is None
    )
    # And the next experiment can be planned.
    _, experiment = propose_experiment(diagnosis, np.random.default_rng(0))
    assert experiment.best == ("joint_offset",)
