"""The blind benchmark as a workflow: no truth is read before the diagnosis, scores do not
rerun it, a changed truth is refused."""

import pytest

pytestmark = pytest.mark.slow
BLIND = ("blind", "--config", "blind=smoke")
# All that an analyst does: none of these may have a truth among its inputs.
ANALYSIS = {"diagnose_cases"}
AFTERWARDS = {"seal_cases", "oracle_cases", "score_cases"}
SEALED = "data/sealed/smoke_1"


@pytest.fixture
def copy(small_proof, tmp_path):
    """A copy, to be changed."""
    return small_proof.copied_to(tmp_path / "study")


def rules(planned):
    return {job[0] for job in planned}


def reads_sealed_file(files):
    return any("sealed" in file for file in files if not file.startswith("src/"))


def test_no_diagnosing_rule_has_a_sealed_file_among_its_inputs(small_proof):
    inputs = small_proof.inputs_by_rule(*BLIND)
    readers = {rule for rule, files in inputs.items() if reads_sealed_file(files)}
    assert readers == AFTERWARDS
    assert set(inputs) >= ANALYSIS and not readers & ANALYSIS
    # Nor anything that was made of one, but the manifest.
    assert not any("oracle" in file for rule in ANALYSIS for file in inputs[rule])
    assert "reports/blind/manifest.sha256" in inputs["diagnose_cases"]
    assert {"results/blind/smoke_1.json", "reports/blind/manifest.sha256"} <= inputs[
        "oracle_cases"
    ]


def test_a_finished_proof_has_nothing_to_do(small_proof):
    assert small_proof.planned(*BLIND) == set()


EDITS = {
    "the scores": (
        "src/elastocal_proof/blind/scores.py",
        {"score_cases", "draw_blind", "write_blind_page"},
    ),
    "the figures of the proof": (
        "src/elastocal_proof/blind/summary.py",
        {"score_cases", "draw_blind", "write_blind_page"},
    ),
    "the oracle": (
        "src/elastocal_proof/blind/oracle.py",
        {"oracle_cases", "score_cases"},
    ),
    "a target": ("config/blind.yaml", {"score_cases", "write_blind_page"}),
}


@pytest.mark.parametrize("edit", EDITS)
def test_edit_reruns_scores_and_no_diagnosis_of(edit, copy):
    path, expected = EDITS[edit]
    if edit == "a target":
        copy.replace(
            path,
            "at most 4 %, high: 0.04, acceptable",
            "at most 5 %, high: 0.05, acceptable",
        )
    else:
        copy.edit(path)
    planned = rules(copy.planned(*BLIND))
    assert planned >= expected
    assert not planned & ({"make_cases", "seal_cases"} | ANALYSIS)


@pytest.mark.parametrize("module", ["oracle", "summary"])
def test_a_truth_that_was_edited_ends_in_one_line_with_its_file(copy, module):
    truth = copy.files(f"{SEALED}/*.json")[0]
    copy.append(truth, "\n")
    # It is not sealed anew: what reads it next refuses it.
    copy.edit(f"src/elastocal_proof/blind/{module}.py")
    ended = copy.snakemake("-j1", *BLIND)
    assert ended.returncode != 0
    said = [line for line in ended.stderr.splitlines() if line.startswith(truth)]
    assert len(set(said)) == 1 and said[-1] == ended.stderr.splitlines()[-1], (
        ended.stderr[-3000:]
    )
    assert "found other contents than were written" in said[0]
    assert "Traceback" not in ended.stderr
