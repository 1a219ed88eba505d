"""Everyone who diagnoses a campaign comes to the same verdict on it: rules, blind proof, benchmarks, notebooks."""

import ast
import json
import sys
from pathlib import Path

import numpy as np
import pytest
from loop_scripts import ANALYSIS, Files, _Job, _Named, run_loop
from made_folders import PLAN, made_folder, made_table

from elastocal.diagnosis import judge as judging
from elastocal.diagnosis.judge import judge
from elastocal.diagnosis.settings import Settings
from elastocal.loop.whole import cases_in, diagnosed
from elastocal_proof.blind import verdicts

ROOT = Path(__file__).resolve().parents[2]
ROBOTS, BENCHMARKS = ROOT / "config" / "robots", ROOT / "benchmarks"
SEED = 1
# Where a campaign is diagnosed, and the test below that has its verdict.
CALLERS = {
    "src/elastocal/loop/whole.py": "the one call",
    "src/elastocal_proof/blind/verdicts.py": "blind proof",
    "src/elastocal_proof/blind/closed_loop.py": "makes the call on the case that `cases_in` gives, and corrects by its fits",
    "src/elastocal/loop/diagnosis_tables.py": "rules",
    "src/elastocal_proof/league/methods.py": "makes the call on the training poses of each fold of the league",
    "benchmarks/engine.py": "benchmark of the engine",
    "benchmarks/remainder_loop.py": "closes the loop on the one call's regression",
}


def trees_in(text):
    """What a file says, and the scripts that it keeps as texts."""
    tree = ast.parse(text)
    yield tree
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and "\nimport " in node.value:
            yield ast.parse(node.value)


def test_every_caller_of_the_diagnosis_is_compared_here():
    found = set()
    for folder in ("src", "workflow", "benchmarks"):
        for path in (ROOT / folder).rglob("*.py"):
            text = path.read_text(encoding="utf-8")
            calls = (
                (n for tree in trees_in(text) for n in ast.walk(tree) if isinstance(n, ast.Call)) if "diagnose" in text else ()
            )
            names = {getattr(call.func, "id", getattr(call.func, "attr", "")) for call in calls}
            if names & {"diagnose", "diagnosed"}:
                found.add(path.relative_to(ROOT).as_posix())
    assert found == set(CALLERS)


@pytest.fixture(scope="module")
def both(kuka, tmp_path_factory):
    """Joint 3 stands a milliradian beyond what it reports; or nothing is missing, so that the seed is seen in the alarm."""
    found = {}
    for kind, offset in (("named", 1e-3), ("adequate", 0.0)):
        table = made_table(kuka, "made", plan=PLAN, offset_of_joint_3=offset)
        folder = made_folder(tmp_path_factory.mktemp(kind) / "made", kuka, table=table)
        verdict = as_json(diagnosed(folder.as_posix(), ROBOTS.as_posix(), SEED))
        assert verdict["verdict"] == kind
        found[kind] = folder, verdict
    assert [effect["name"] for effect in found["named"][1]["effects"]] == ["joint_offset"]
    assert 0.02 < found["adequate"][1]["probabilities"]["alarm_p_value"] < 0.98
    return found


@pytest.fixture
def folder(both):
    return both["named"][0]


@pytest.fixture
def expected(both):
    """The verdict of the one call."""
    return both["named"][1]


def as_json(document):
    return json.loads(json.dumps(document, allow_nan=False))


def same(one, other, path="verdict"):
    """Equal documents, numbers to what remains where a fit ends: a thousandth of a standard error."""
    assert type(one) is type(other) or {type(one), type(other)} <= {int, float}, path
    if isinstance(one, dict):
        assert list(one) == list(other), path
        for key in one:
            same(one[key], other[key], f"{path}.{key}")
    elif isinstance(one, list):
        assert len(one) == len(other), path
        for number, pair in enumerate(zip(one, other, strict=True)):
            same(*pair, f"{path}[{number}]")
    elif isinstance(one, float):
        assert one == pytest.approx(other, rel=1e-3, abs=1e-9), path
    else:
        assert one == other, path


def same_case(one, other):
    """Equal in all that a diagnosis looks at; laws by their names."""
    for mine, theirs in ((one.campaign.measurements, other.campaign.measurements), (one.observations, other.observations)):
        for name, values in vars(mine).items():
            if name != "states":
                np.testing.assert_array_equal(values, getattr(theirs, name), err_msg=name)
    for name, values in vars(one.observations.states).items():
        np.testing.assert_array_equal(values, getattr(other.observations.states, name), err_msg=name)
    for name in ("name", "measured", "frame", "targets", "compliance", "declared", "noise", "holdout"):
        assert getattr(one.campaign, name) == getattr(other.campaign, name), name
    assert one.campaign.robot.chain == other.campaign.robot.chain
    assert list(one.candidates) == list(other.candidates)
    assert [effect.key for effect in one.model.effects] == [effect.key for effect in other.model.effects]
    np.testing.assert_array_equal(one.model.nominal_compliance, other.model.nominal_compliance)
    for name in ("fitted_frames", "rows", "targets", "time_zero_s", "row_span"):
        assert getattr(one.model, name) == getattr(other.model, name), name


class OneCall:
    """In the place of the one call: notes what it is asked and gives the verdict that is there already."""

    def __init__(self, verdict):
        self.verdict, self.asked = verdict, []

    def __call__(self, folder, robots, seed, settings=None):
        self.asked.append((folder, (ROOT / robots).resolve(), seed, settings or Settings()))
        return self.verdict


def run_of(step, tmp_path, monkeypatch, verdict, **parts):
    """Result of one step of the blind proof, and what it asked of the one call."""
    path, one_call = tmp_path / "verdicts.json", OneCall(verdict)
    monkeypatch.setattr(verdicts, "diagnosed", one_call)
    params = _Named(seed=SEED, robots=ROBOTS.as_posix())
    step(_Job(output=_Named(verdicts=path.as_posix()), params=params, wildcards=_Named(block="block"), **parts))
    return json.loads(path.read_text(encoding="utf-8")), one_call.asked


@pytest.mark.parametrize("kind", ["named", "adequate"])
def test_rules_come_to_the_same_verdict_with_their_tables_between_the_steps(kind, both, tmp_path):
    folder, expected = both[kind]
    run_loop(folder, ROBOTS, tmp_path, ANALYSIS)
    by_rules = json.loads(Path(Files(tmp_path).verdict).read_text(encoding="utf-8"))
    # What to measure next is proposed by the rules alone, beside the verdict.
    del by_rules["next_experiment"]
    same(by_rules, expected)


def test_blind_proof_writes_the_verdict_of_the_one_call(folder, expected, tmp_path, monkeypatch):
    blind = _Named(blind=folder.parent.as_posix())
    found, asked = run_of(verdicts.diagnose_cases, tmp_path, monkeypatch, expected, input=blind)
    assert found == [expected]
    assert asked == [(folder.as_posix(), ROBOTS, SEED, Settings())]


@pytest.mark.parametrize("kind", ["named", "adequate"])
def test_benchmark_of_the_engine_times_the_same_verdict(kind, both, monkeypatch, capsys):
    """The script that it gives to a process of its own, in this one: the two calls by hand."""
    folder, expected = both[kind]
    tree = ast.parse((BENCHMARKS / "engine.py").read_text(encoding="utf-8"))
    assigned = (node for node in tree.body if isinstance(node, ast.Assign))
    (script,) = (ast.literal_eval(n.value) for n in assigned if getattr(n.targets[0], "id", "") == "SCRIPT")
    seen = []

    def judged(*parts):
        seen.append(judge(*parts))
        return seen[-1]

    monkeypatch.setattr(judging, "judge", judged)
    monkeypatch.setattr(sys, "argv", ["script", ROBOTS.as_posix(), folder.as_posix()])
    exec(compile(script, "SCRIPT", "exec"), {})
    assert json.loads(capsys.readouterr().out)["measurements"] == len(cases_in(folder, ROBOTS)[0].observations)
    (verdict,) = seen
    # A benchmark of the engine states no accuracy of a corrected robot, nor what each cause costs, nor what is misplaced.
    wanted = {
        name: value for name, value in expected.items() if name not in ("accuracy", "uncorrected_m", "misplaced", "physics")
    }
    wanted["effects"] = [{name: v for name, v in effect.items() if name != "cost_m"} for effect in expected["effects"]]
    same(as_json(verdict.document), wanted)


def test_oracle_that_knows_the_effect_which_is_found_has_the_same_errors_on_held_out_poses(folder, expected):
    pytest.importorskip("mujoco", reason="the blind proof needs the extra `blind`")
    from elastocal_proof.blind.oracle import oracle

    known = oracle({"defects": [{"effect": "joint_offset", "joints": [3]}]}, expected, folder, ROBOTS, SEED)
    assert known["candidates"] == ["joint_offset@3"] and known["p_value"] < 1e-6
    # The engine has a prior on the size and may have a pose error: both cost next to nothing here.
    assert known["heldout"] == pytest.approx(expected["heldout"]["after"], rel=1e-2)
    without = oracle({"defects": []}, expected, folder, ROBOTS, SEED)
    assert without["heldout"] == expected["heldout"]["before"]
