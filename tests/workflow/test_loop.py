"""Closing the loop on a user's own campaign: one command, one folder, and no more work
than an edit asks for."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
import yaml
from made_folders import make_folder, make_table
from study_folder import Study
from typer.testing import CliRunner

from elastocal.campaigns.importers import find_user_campaign
from elastocal.command.main import app
from elastocal.command.terminal import load_diagnosed_campaign
from elastocal.errors import InputError
from elastocal.report.outcome import describe_outcome
from elastocal.report.words import format_millimetres

CELL = "cells/made"
OWN = ("diagnose", "--config", f"campaign={CELL}")
OFFSET = 1e-3
STEPS = ["read_campaign", "diagnose_campaign", "judge_campaign"]
OF_THE_STUDY = "data/simulated/kuka/200um/measured.parquet"


@pytest.fixture(scope="module")
def diagnosed(kuka, tmp_path_factory):
    """The sources, a campaign of a robot whose joint 3 stands 1 mrad off, its
    diagnosis, and some data of the study."""
    study = Study.of_sources(tmp_path_factory.mktemp("loop") / "study")
    make_folder(
        study.path(CELL), kuka, table=make_table(kuka, "made", offset_of_joint_3=OFFSET)
    )
    study.run(OF_THE_STUDY, *OWN)
    return study


@pytest.fixture
def cell(diagnosed, tmp_path):
    """A copy, to be changed."""
    return diagnosed.copied_to(tmp_path / "study")


def report(study, name):
    return study.path(f"reports/loop/made/{name}")


def test_verdict_has_every_key_of_the_contract(diagnosed):
    verdict = json.loads(report(diagnosed, "verdict.json").read_text(encoding="utf-8"))
    heldout = verdict["heldout"]
    settings = verdict["settings"]
    assert (
        verdict["campaign"] == "made"
        and verdict["verdict"] == "class"
        and isinstance(verdict["warnings"], list)
    )
    told = {
        "probabilities",
        "misfit",
        "untestable",
        "held",
        "candidates_tested",
        "next_experiment",
        "accuracy",
        "noise",
    }
    assert told <= set(verdict) and verdict["converged"] == {
        "declared": True,
        "final": True,
    }
    assert {
        "noise_floor_rms_m",
        "reduction_ci95",
        "reduction_std_error",
        "poses",
        "outside_range",
    } <= set(heldout)
    assert heldout["after"]["rms_m"] < min(
        heldout["before"]["rms_m"], heldout["declared"]["rms_m"]
    )
    assert set(map(len, verdict["compliance_urad_per_Nm"].values())) == {6}
    assert (
        settings["alarm_level"]["value"] == 0.01 and settings["alarm_level"]["reason"]
    )
    (effect,) = verdict["effects"]
    # A link that is turned about the joint's axis moves the arm in the same way.
    assert (effect["name"], effect["joints"], effect["alternatives"]) == (
        "joint_offset",
        [3],
        ["link_geometry"],
    )
    assert (
        0.9 < effect["probability"] < 1 + 1e-9
        and 0 < effect["p_value"] < 0.05
        and 0 < effect["heldout_gain"] < 1
    )
    (parameter,) = effect["parameters"]
    assert (
        parameter["unit"] == "rad"
        and abs(parameter["value"] - OFFSET) < 5 * parameter["std_error"]
    )


def test_the_error_before_is_one_number_in_all_five_places(cell, monkeypatch):
    """Terminal, report, table behind the README, 3-D view and certificate."""
    monkeypatch.chdir(cell.folder)
    CliRunner().invoke(app, ["certificate", CELL, "--tolerance", "0.5mm"])
    before_mm = (
        1e3
        * json.loads(report(cell, "verdict.json").read_text())["heldout"]["before"][
            "rms_m"
        ]
    )
    terminal = " ".join(describe_outcome(["reports/loop/made/report.pdf"]))
    printed = format_millimetres(1e-3 * before_mm)
    assert f" {printed} → " in terminal
    page = report(cell, "report.html").read_text(encoding="utf-8")
    assert f'<span class="from">{printed}</span>' in page
    table = pd.read_csv(report(cell, "before_after.csv"))
    assert 1e3 * table["heldout_rms_m"][0] == pytest.approx(before_mm)
    drawn = json.loads(
        page.partition('<script type="application/json"')[2]
        .partition(">")[2]
        .partition("</script>")[0]
    )
    residuals = pq.read_table(report(cell, "residuals.parquet")).to_pandas()
    kept = residuals[~residuals["gross_error"]].reset_index(drop=True)
    kept[["x", "y", "z"]] = 1e-3 * np.array(drawn["before"])
    states = kept[kept["held_out"]].groupby(["pose", "load", "target"])
    errors_mm = np.linalg.norm(states[["x", "y", "z"]].mean(), axis=1)
    assert np.sqrt((errors_mm**2).mean()) == pytest.approx(before_mm, rel=1e-3)
    certificate = json.loads(report(cell, "certificate.json").read_text())
    assert certificate["errors"][0][1] == f"{before_mm:.3f} mm"
    assert certificate["errors"][1][1] == ""
    assert 1e3 * certificate["budget"][0]["rms_m"] == pytest.approx(before_mm)


# What each needs besides a campaign, and would write.
COMMANDS = {
    "certificate": ["--tolerance", "0.5mm"],
    "correct": ["path.csv", "--output", "targets.csv"],
    "export": ["--output", "out"],
}


def test_each_file_behind_a_report_that_was_changed_is_found_by_every_command(
    cell, monkeypatch
):
    """In one line, before it writes: edited and deleted, and by the commands, in
    turn."""
    own_files = cell.files(
        f"{CELL}/**/*",
        "results/**/made/**/*",
        "reports/**/made/**/*",
        "results/**/*made*",
    )
    # Texts for people are read by no job.
    files = [
        name
        for name in own_files
        if cell.path(name).is_file()
        and not name.startswith(("results/logs/", "results/timings/"))
    ]
    files = [
        *sorted({*files}),
        "src/elastocal/diagnosis/search.py",
        "config/robots/kuka.yaml",
    ]
    assert {name.split("/")[0] for name in files} == {
        "cells",
        "results",
        "reports",
        "src",
        "config",
    } and len(files) > 35
    monkeypatch.chdir(cell.folder)
    assert load_diagnosed_campaign(Path(CELL)).name == "made"
    for number, name in enumerate(files):
        path = cell.path(name)
        before = path.read_bytes()
        path.write_bytes(
            before[:-1] + bytes([before[-1] ^ 1])
        ) if number % 2 else path.unlink()
        command = [*COMMANDS][number // 2 % len(COMMANDS)]
        error = CliRunner().invoke(app, [command, CELL, *COMMANDS[command]]).exception
        assert isinstance(error, InputError) and len(str(error).splitlines()) == 1, (
            command,
            name,
            error,
        )
        assert cell.files("out", "targets.csv") == []
        path.write_bytes(before)
    assert cell.planned(OF_THE_STUDY, *OWN) == set()


def test_no_step_before_the_judgement_reads_held_out_poses(diagnosed):
    inputs = diagnosed.inputs_by_rule(*OWN)
    assert set(STEPS) <= set(inputs)
    readers = {
        rule for rule, files in inputs.items() if "held_out.parquet" in " ".join(files)
    }
    # The target asks whether each file is there, and reads none.
    assert readers - {"diagnose"} == {"judge_campaign"}
    # No other step reads the file of all poses.
    readers_of_all = set()
    for rule, files in inputs.items():
        if any(file.startswith(CELL) for file in files):
            readers_of_all.add(rule)
    assert readers_of_all == {"read_campaign"}
    # No step before the judgement reads a file that the judgement makes.
    judged = {
        f"reports/loop/made/{name}"
        for name in ("verdict.json", "before_after.csv", "residuals.parquet")
    }
    for rule in STEPS[: STEPS.index("judge_campaign")]:
        assert not inputs[rule] & judged


def rules_of(planned):
    return {job[0] for job in planned}


# Modules edited at once, the rules that run again, and those that do not.
EDITS = {
    "figures of the study and style of all figures": (
        ["figures/study", "figures/style"],
        set(),
        set(STEPS),
    ),
    "the judgement": (["diagnosis/judge"], set(STEPS[2:]), set(STEPS[:2])),
    "an effect": (["effects/gravity"], set(STEPS[1:]), {"simulate", "measure"}),
    "a fault": (["data_checks/faults"], set(STEPS[1:]), set(STEPS[:1])),
}


@pytest.mark.parametrize("edit", EDITS)
def test_edit_reruns_what_depends_on_it_of(edit, cell):
    modules, rerun, untouched = EDITS[edit]
    for module in modules:
        cell.edit(f"src/elastocal/{module}.py")
    planned = rules_of(cell.planned(OF_THE_STUDY, *OWN))
    assert rerun <= planned and not untouched & planned


def test_a_campaign_is_one_however_it_is_spelled(cell, config, monkeypatch):
    """The workflow asks this function, which is faster than a dry run of each."""
    cell.path("link").symlink_to(cell.path(CELL))
    monkeypatch.chdir(cell.folder)
    for spelled in (cell.path(CELL), f"{CELL}/", f"./cells/../{CELL}", "link"):
        campaigns = find_user_campaign(
            config | {"campaign": str(spelled)}, "config/robots", "results/loop"
        )
        paths = {name: campaign.path for name, campaign in campaigns.items()}
        assert paths == {"made": Path(CELL)}, spelled
    planned = cell.planned("diagnose", "--config", "campaign=./link/")
    assert planned <= {("diagnose",)}


def test_a_broken_campaign_ends_with_one_line(unstarted, kuka):
    make_folder(unstarted.path(CELL), kuka, table=make_table(kuka, "made"))
    file = unstarted.path(CELL) / "measurements.csv"
    table = pd.read_csv(file)
    table.loc[7, "y"] = np.nan
    table.to_csv(file, index=False, na_rep="nan")
    ended = unstarted.snakemake("-j2", *OWN)
    assert ended.returncode != 0
    lines = [
        line
        for line in ended.stderr.splitlines()
        if line.startswith(f"{CELL}/measurements.csv")
    ]
    # Once, last of all, by the run.
    assert lines == ended.stderr.splitlines()[-1:], ended.stderr
    assert (
        all(
            phrase in lines[0]
            for phrase in ("line 9", "column y", "nan", "; allowed: ")
        )
        and "Traceback" not in ended.stderr
    )
    log = (
        unstarted.path("results/logs/read_campaign/made.log")
        .read_text(encoding="utf-8")
        .splitlines()
    )
    assert (
        log == lines[:1]
        and unstarted.files("results/loop/**/*.*", "reports/loop/**/*.*") == []
    )


SAG = '''"""A sag of joint 2 that no other effect has."""

import numpy as np

from elastocal.effects.protocol import Parameter, effect


@effect("gravity", "another sag")
def sag(own, sites):
    """Yield one candidate."""
    parameters = [Parameter("sag", "rad", 1e-3)]
    yield own.candidate(
        (2,), parameters, lambda around: [{1: np.cos(5 * around.joint_angles[:, 1])}]
    )
'''


def test_a_new_effect_is_a_module_and_a_new_campaign_a_file_that_is_read_again_with_its_robot(
    cell,
):
    """Of the robot that is simulated and of the one that is declared, which are two."""
    cell.path("src/elastocal/effects/sag.py").write_text(SAG, encoding="utf-8")
    document = yaml.safe_load(
        cell.path("config/campaigns/kuka_extended_end_effector.yaml").read_text(
            encoding="utf-8"
        )
    )
    cell.path("config/campaigns/tiny.yaml").write_text(
        yaml.safe_dump(document | {"poses": 8}), encoding="utf-8"
    )
    cell.configure({"loop": {"campaigns": ["tiny"]}})
    candidates = "reports/loop/made/candidates.csv"
    training = "results/loop/tiny/training.parquet"
    cell.run(candidates, training, *OWN[1:])
    assert "\nsag@2," in cell.path(candidates).read_text(encoding="utf-8")
    measurements = pq.ParquetFile(cell.path(training)).read()
    assert set(measurements.column("pose").to_pylist()) < set(range(8))
    planned = cell.planned(
        "reports/loop/tiny/verdict.json", "reports/loop/campaigns.csv"
    )
    assert {job for job in planned if job[0] in STEPS} == {
        (step, "tiny") for step in STEPS[1:]
    }
    cell.replace(
        "config/robots/kuka.yaml",
        "compliance_urad_per_Nm: [",
        "compliance_urad_per_Nm: [1",
    )
    assert cell.planned(training) == {("read_campaign", "tiny")}


def test_a_campaign_waits_for_the_one_that_tests_its_test_and_two_may_test_each_other(
    unstarted,
):
    """Which reading the test looks for: ur5_random is tested on ur5_grid."""
    unstarted.configure(
        {"loop": {"measured": ["ur5_grid_on_random", "ur5_random", "ur5_grid"]}}
    )
    campaigns = "ur5_grid_on_random", "fanuc_cpa"
    planned = unstarted.planned(
        *(f"results/loop/{name}/training.parquet" for name in campaigns)
    )
    imported = {job[1] for job in planned if job[0] == "import_campaign"}
    assert imported == {
        "ur5_grid_on_random",
        "ur5_random",
        "ur5_grid",
        "fanuc_cpa",
        "fanuc_static",
    }
