"""Several campaigns side by side: progress by campaign, faults of one, a table of all."""

import re
import signal
import subprocess
import sys
import time

import pytest
from analysed_robots import analysed
from made_folders import make_folder
from made_loop_tables import CAMPAIGNS
from support import heed_interrupts

from elastocal.command import campaign, diagnosis_runs
from elastocal.verdict import write_verdict

# A stand-in for Python: it notes when it begins and ends, says what it does, and fails for
# a campaign named broken.
STAND_IN = """#!/bin/sh
case "$*" in *campaign={folder}/*) ;; *) exit 9 ;; esac
name="${{6##*/}}"
echo "Using workflow specific profile x"
echo "1 of 2: diagnose_campaign $name"
echo "begin $name" >> {folder}/noted
sleep {seconds}
echo "end $name" >> {folder}/noted
if [ "$name" = broken ]; then echo "broken: found a fault"; exit 3; fi
"""
NAMES = ("first", "broken", "last")


@pytest.fixture
def begin(tmp_path, monkeypatch):
    """Let Python be the stand-in, with reports of the campaigns that do not fail."""

    def prepare(seconds):
        stand_in = tmp_path / "python"
        stand_in.write_text(STAND_IN.format(folder=tmp_path, seconds=seconds))
        stand_in.chmod(0o755)
        monkeypatch.setattr(diagnosis_runs.sys, "executable", str(stand_in))
        for name in ("find_pipeline", "find_workplace"):
            monkeypatch.setattr(diagnosis_runs, name, lambda: tmp_path)
        verdict = next(iter(CAMPAIGNS.values()))
        for name in NAMES:
            make_folder(tmp_path / name, analysed("kuka"), name=name)
            reports = tmp_path / "reports" / "loop" / name
            reports.mkdir(parents=True)
            write_verdict(reports / "verdict.json", verdict)
        return [tmp_path / name for name in NAMES], verdict

    return prepare


def test_a_campaign_that_fails_stops_no_other_and_stands_in_the_table(begin, elastocal):
    folders, verdict = begin(0)
    result = elastocal("diagnose", *folders, "-j", 2)
    assert result.exit_code == 1
    for name in NAMES:
        assert f"{name}: 1 of 2: diagnose_campaign {name}" in result.stderr
    assert "profile" not in result.stderr
    header, *rows, reason = result.stdout.splitlines()
    assert header.split()[:2] == ["campaign", "verdict"]
    errors = [
        f"{1e3 * error.rms_m:.3f}"
        for error in (verdict.heldout.before, verdict.heldout.delivered)
    ]
    assert [row.split()[:-1] for row in rows] == [
        ["first", verdict.verdict, *errors],
        ["broken", "failed"],
        ["last", verdict.verdict, *errors],
    ]
    assert reason == "! broken: found a fault"


def test_the_exit_code_is_0_if_none_failed(begin, elastocal):
    folders, _ = begin(0)
    result = elastocal("diagnose", folders[0], folders[2], "-j", 2)
    assert result.exit_code == 0 and len(result.stdout.splitlines()) == 3


@pytest.mark.parametrize(("processes", "at_once"), [(1, 1), (3, 3)])
def test_one_campaign_runs_on_each_core(begin, elastocal, tmp_path, processes, at_once):
    folders, _ = begin(0.5)
    elastocal("diagnose", *folders, "-j", processes)
    events = re.findall(r"^begin|^end", (tmp_path / "noted").read_text(), re.MULTILINE)
    assert len(events) == 6
    assert events[: at_once + 1] == ["begin"] * at_once + ["end"]


def test_all_cores_are_taken_by_default(begin, monkeypatch, elastocal):
    folders, _ = begin(0)
    taken = []
    monkeypatch.setattr(campaign.os, "cpu_count", lambda: 2)
    monkeypatch.setattr(
        campaign,
        "diagnose_folders",
        lambda folders, processes, console: taken.append(processes) or [],
    )
    elastocal("diagnose", *folders)
    elastocal("diagnose", *folders, "-j", 8)
    assert taken == [2, 3]


def test_a_folder_that_is_no_campaign_stops_no_other(begin, elastocal, tmp_path):
    folders, _ = begin(0)
    result = elastocal("diagnose", tmp_path / "a{b", folders[0])
    assert result.exit_code == 1 and "a path without it" in result.stdout
    assert re.search(r"^first +\w", result.stdout, re.MULTILINE)


def test_two_campaigns_of_one_name_are_refused_before_any_begins(
    begin, refusal, tmp_path
):
    folders, _ = begin(0)
    make_folder(tmp_path / "copy", analysed("kuka"), name="first")
    assert "a name of its own" in refusal("diagnose", *folders, tmp_path / "copy")
    assert "a name of its own" in refusal("diagnose", folders[0], folders[0])
    assert not (tmp_path / "noted").exists()


def test_measurements_of_a_corrected_robot_belong_to_one_campaign(begin, refusal):
    folders, _ = begin(0)
    assert "one campaign" in refusal("diagnose", *folders, "--with", "measured.csv")


# Diagnoses campaigns with the stand-in, in a process that can be interrupted.
INTERRUPTED = """
import sys
from pathlib import Path
from rich.console import Console
from elastocal.command import diagnosis_runs
folder = Path(sys.argv[1])
diagnosis_runs.sys = type("System", (), {"executable": str(folder / "python")})
diagnosis_runs.find_pipeline = diagnosis_runs.find_workplace = lambda: folder
diagnosis_runs.diagnose_folders([*map(Path, sys.argv[2:])], 1, Console(stderr=True))
"""


def test_an_interrupt_begins_no_further_campaign(begin, tmp_path):
    folders, _ = begin(3)
    command = [sys.orig_argv[0], "-c", INTERRUPTED, tmp_path, *folders]
    process = subprocess.Popen(
        command, stderr=subprocess.DEVNULL, preexec_fn=heed_interrupts
    )
    while not (tmp_path / "noted").exists():
        assert process.poll() is None
        time.sleep(0.1)
    process.send_signal(signal.SIGINT)
    assert process.wait(timeout=60)
    assert (tmp_path / "noted").read_text() == "begin first\n"
