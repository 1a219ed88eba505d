"""A diagnosis of training poses: noise, faults, effects one at a time, and the figures
of the verdict."""

from dataclasses import replace

import numpy as np
import pytest
from made_folders import PLAN, make_folder, make_table

from elastocal.data_checks.protocol import Fault
from elastocal.diagnosis import adoption, model_averaging
from elastocal.diagnosis import diagnose as diagnose_module
from elastocal.diagnosis.diagnose import diagnose
from elastocal.diagnosis.judge import judge
from elastocal.diagnosis.next_experiment import propose_experiment
from elastocal.diagnosis.settings import Settings
from elastocal.diagnosis.verdict import Hypothesis
from elastocal.fitting.noise import get_noise
from elastocal.loop.whole import read_cases
from elastocal.validation.held_out import compute_noise_floor

# Zero offset of joint 3, rad.
OFFSET = 1e-3
DECLARED_NOISE_M = (6e-5, 1e-6)


@pytest.fixture(scope="module")
def diagnoses_by_noise(kuka, config_folder, tmp_path_factory):
    """Diagnoses of measurements without repeats that scatter by 60 µm, by the declared
    noise in m."""
    diagnoses = {}
    for noise_m in DECLARED_NOISE_M:
        table = make_table(kuka, "made", plan=PLAN, offset_of_joint_3=OFFSET)
        is_first = np.equal(table["repeat"], 0)
        table = {name: np.asarray(column)[is_first] for name, column in table.items()}
        folder = make_folder(
            tmp_path_factory.mktemp("noise") / "made",
            kuka,
            table=table,
            noise={"position_m": noise_m},
            declared=["link_geometry"],
        )
        case, _ = read_cases(folder, config_folder / "robots")
        diagnoses[noise_m] = diagnose(case, Settings(), 1)
    return diagnoses


def test_a_model_that_is_kept_without_the_effect_found_has_the_noise_that_it_leaves(
    kuka, config_folder, tmp_path
):
    table = make_table(kuka, "made", plan=PLAN, offset_of_joint_3=OFFSET)
    folder = make_folder(tmp_path / "made", kuka, table=table, declared=[])
    case, _ = read_cases(folder, config_folder / "robots")
    diagnosis = diagnose(case, Settings(useful=1e9), 1)
    document = diagnosis.document
    assert [effect["adopted"] for effect in document["effects"]] == [False]
    assert document["kept"] == "declared"
    kept = diagnosis.final
    position_error_m = np.linalg.norm(kept.residual[:, :3], axis=1)
    noise_floor_m = compute_noise_floor(
        replace(kept, noise=get_noise(diagnosis.verdict.noise)),
        diagnosis.case.observations,
        kept.model,
        kept.estimate,
    )
    factor = document["noise"]["factor"]
    assert factor > 1.1
    scatter = np.sqrt((position_error_m**2).mean()) / noise_floor_m
    assert factor == pytest.approx(scatter, rel=0.1)


def list_geometry_priors(fitted):
    return {
        parameter.prior_std
        for owner, parameter in fitted.parameters
        if owner.startswith("link_geometry") and parameter.sized
    }


def test_priors_and_verdict_do_not_depend_on_the_declared_noise(diagnoses_by_noise):
    correct, too_small = (diagnoses_by_noise[noise_m] for noise_m in DECLARED_NOISE_M)
    priors = list_geometry_priors(correct.declared)
    assert list_geometry_priors(correct.final) == priors
    assert list_geometry_priors(too_small.declared) == priors
    assert list_geometry_priors(too_small.final) == priors
    # The wrong zero of a joint is a wrong geometry of its link, which is declared.
    assert correct.document["verdict"] == "adequate"
    assert too_small.document["verdict"] == "adequate"
    assert correct.document["noise"]["factor"] == pytest.approx(1.0, abs=0.3)
    assert too_small.document["noise"]["factor"] == pytest.approx(60.0, rel=0.3)
    np.testing.assert_allclose(
        np.sqrt(np.diag(correct.final.covariance)),
        np.sqrt(np.diag(too_small.final.covariance)),
        rtol=0.35,
    )
    assert correct.final.converged
    assert too_small.final.converged


@pytest.mark.parametrize("error_rad", [0.0, 3e-4])
def test_an_error_that_all_measurements_of_a_pose_share_is_noise_and_is_reported(
    error_rad, kuka, config_folder, tmp_path
):
    """In each pose the joints deviate from the angles that they report, by the same
    amount in all measurements of the pose."""
    table = make_table(kuka, "made", plan=replace(PLAN, poses=40))
    generator = np.random.default_rng(3)
    errors = error_rad * generator.standard_normal((max(table["pose"]) + 1, 6))
    for joint in range(1, 7):
        name = f"q{joint}"
        table[name] = table[name] + errors[table["pose"], joint - 1]
    folder = make_folder(tmp_path / "made", kuka, table=table)
    case, _ = read_cases(folder, config_folder / "robots")
    diagnosis = diagnose(case, Settings(), 1)
    assert diagnosis.document["verdict"] == "adequate"
    warnings = [w for w in diagnosis.document["warnings"] if "are correlated" in w]
    assert len(warnings) == (error_rad > 0)
    # Neighbours in the grid of the pose error differ by a factor of two.
    pose_rad = diagnosis.final.noise.pose_rad
    assert pose_rad == pytest.approx(error_rad, rel=0.8)
    assert diagnosis.document["noise"]["pose_rad"] == pose_rad


@pytest.fixture(scope="module")
def case(cases):
    return cases[0]


def test_steps_lead_from_the_frames_to_the_compliances_to_the_effect(diagnosis):
    """The campaign asks to identify the compliances. Its frame is the base, so that the
    first step has nothing to fit."""
    keys_by_step = []
    for step in diagnosis.steps:
        keys_by_step.append([effect.key for effect in step.fitted.model.effects])
    (compliances,) = keys_by_step[1]
    assert compliances.startswith("joint_compliance")
    assert keys_by_step == [[], [compliances], [compliances, "joint_offset@3"]]
    assert diagnosis.declared is diagnosis.steps[1].fitted
    assert diagnosis.final is diagnosis.steps[2].fitted
    offset = diagnosis.final.estimate.coefficients[-1][0]
    std_error = np.sqrt(diagnosis.final.covariance[-1, -1])
    assert offset == pytest.approx(OFFSET, abs=4 * std_error)


@pytest.mark.parametrize(
    ("verdict", "names"), [("named", ["fault_0"]), ("several", ["fault_0", "fault_1"])]
)
def test_faulty_data_end_the_diagnosis_at_the_declared_model(
    verdict, names, case, monkeypatch
):
    faults = [Fault(name, (), "as measured", (), (1.0, 1.0)) for name in names]
    monkeypatch.setattr(diagnose_module, "find_faults", lambda campaign: faults)
    monkeypatch.setattr(diagnose_module, "_settle_rows", None)
    diagnosis = diagnose(case, Settings(), 1)
    document = diagnosis.document
    assert diagnosis.evidence is None
    assert diagnosis.final is diagnosis.declared
    assert document["verdict"] == verdict
    assert [effect["name"] for effect in document["effects"]] == names
    assert document["probabilities"] is None
    assert document["misfit"] is None
    assert document["candidates_tested"] == 0


def test_frames_alone_are_kept_if_they_predict_left_out_poses_better(
    kuka, config_folder, tmp_path, monkeypatch
):
    table = make_table(kuka, "made", offset_of_joint_3=OFFSET)
    folder = make_folder(
        tmp_path / "made", kuka, table=table, declared=["link_geometry"]
    )
    case, held_out = read_cases(folder, config_folder / "robots")
    settings = replace(Settings(), numbers_a_parameter=np.inf)
    usual = diagnose(case, settings, 1)
    assert usual.document["kept"] != "frames"
    assert not any("left out in turn" in w for w in usual.document["warnings"])
    # The standard error of the difference of the squares is 0.2. Let the declared model
    # lose by less than that, then by more.
    for excess in (0.15, 0.25):

        def predict_residuals(fitted, _, group, excess=excess):
            squares = np.full(group.max() + 1, 3.0)
            if fitted.model.effects:
                deviations = np.linspace(-1.0, 1.0, len(squares))
                deviations *= 0.2 * np.sqrt(len(squares)) / deviations.std(ddof=1)
                squares += deviations + excess
            return np.outer(np.sqrt(squares[group]), [1.0, 0.0, 0.0])

        monkeypatch.setattr(adoption, "predict_left_out_residuals", predict_residuals)
        # Whether effects are adopted is another question.
        monkeypatch.setattr(adoption, "describe_missing_gain", lambda *_: [])
        diagnosis = diagnose(case, settings, 1)
        assert (diagnosis.document["kept"] == "frames") == (excess > 0.2)
    assert diagnosis.steps[-1].kind == "kept"
    assert diagnosis.final.model.effects == ()
    assert any(
        "left out in turn" in warning and "frames and targets alone" in warning
        for warning in diagnosis.document["warnings"]
    )
    heldout = judge(diagnosis, held_out, 1).document["heldout"]
    before_m = heldout["before"]["rms_m"]
    assert heldout["after"]["rms_m"] == pytest.approx(before_m, rel=1e-3)
    enough_numbers = replace(settings, numbers_a_parameter=0.0)
    assert diagnose(case, enough_numbers, 1).document["kept"] != "frames"


def test_an_effect_that_is_not_expected_to_help_is_named_and_not_adopted(
    cases, monkeypatch
):
    monkeypatch.setattr(
        model_averaging, "is_expected_to_help", lambda problem, posterior, model: False
    )
    diagnosis = diagnose(cases[0], Settings(), 1)
    document = diagnosis.document
    (effect,) = document["effects"]
    # A turned link before the joint makes the same displacements on this campaign.
    assert document["verdict"] == "class"
    assert effect["alternatives"] == ["link_geometry"]
    assert effect["name"] == "joint_offset"
    assert not effect["adopted"]
    # Its size is stated all the same.
    assert abs(effect["parameters"][0]["value"] - 1e-3) < 1e-4
    assert [step.kind for step in diagnosis.steps] == ["frames", "declared"]
    assert diagnosis.final is diagnosis.declared
    assert any("stays as declared" in warning for warning in document["warnings"])
    # The noise is that of the model that is kept.
    noise = document["noise"]
    assert noise["factor"] == diagnosis.declared.noise.position_m / noise["position_m"]
    verdict = judge(diagnosis, cases[1], 1).document
    assert verdict["heldout"]["declared"] == verdict["heldout"]["after"]
    assert verdict["effects"][0]["heldout_gain"] is None
    # The next experiment can be planned, too.
    _, experiment = propose_experiment(diagnosis, np.random.default_rng(0))
    assert experiment.best == ("joint_offset",)


class AlternatingSearch:
    """A stand-in for a search: about each model it finds the next one of a cycle, with
    the probabilities of both."""

    def __init__(self, evidence, probabilities):
        self.evidence = evidence
        self.probabilities = probabilities
        self.starts = []

    def __call__(self, context, subset, start):
        self.starts.append(start.named)
        about = start.named or ("second",)
        ranked = sorted(self.probabilities[about].items(), key=lambda entry: -entry[1])
        hypotheses = tuple(Hypothesis(names, share, 0) for names, share in ranked)
        conclusion = replace(
            self.evidence.conclusion, hypotheses=hypotheses, best=hypotheses[0]
        )
        return replace(self.evidence, conclusion=conclusion)


@pytest.mark.parametrize(
    ("of_first_about_second", "kept", "rounds"), [(0.9, "first", 3), (0.6, "second", 4)]
)
def test_a_search_between_two_models_settles_on_the_more_probable_one(
    diagnosis, monkeypatch, of_first_about_second, kept, rounds
):
    """About the first model, the second has a probability of 0.8. A search that follows
    whatever is found alternates to its limit of rounds."""
    first, second = ("first",), ("second",)
    search = AlternatingSearch(
        diagnosis.evidence,
        {
            first: {first: 0.2, second: 0.8},
            second: {first: of_first_about_second, second: 1 - of_first_about_second},
        },
    )
    monkeypatch.setattr(diagnose_module, "_search", search)
    monkeypatch.setattr(diagnose_module, "_is_linear", lambda *arguments: False)
    settings = Settings(linearizations=9)
    context = diagnose_module._Context(diagnosis.case, settings, 1, print)
    subset = diagnose_module.select_initial_subset(diagnosis.case, settings)
    start = diagnose_module._SearchRound(0, subset.declared, None)
    evidence = diagnose_module._search_until_settled(context, subset, start)
    assert evidence.settled
    assert evidence.conclusion.best.named == (kept,)
    assert len(search.starts) == rounds
