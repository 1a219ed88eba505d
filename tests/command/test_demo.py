"""The demonstration runs the commands that it prints, in their order; test_afternoon.py
goes the whole way with them."""

import shlex
from types import SimpleNamespace

import numpy as np
import pytest

from elastocal.command import demo, main

STEPS = ["plan", "check", "diagnose", "correct", "certificate", "verify"]
ERRORS = {
    "uncorrected": np.full(3, 2e-3),
    "corrected": np.full(3, 1e-4),
    "noise alone": np.full(3, 9e-5),
}


@pytest.fixture
def run_demo(elastocal, monkeypatch, tmp_path):
    """Runs the demonstration with subcommands that only note their arguments.

    One of them fails with exit code 3. Returns the result and the noted arguments.
    """
    run_application = main.InOrder.main
    rehearsal = "elastocal_proof.blind.rehearsal"
    monkeypatch.setattr(f"{rehearsal}.fill_sheet", lambda *_: 12)
    monkeypatch.setattr(f"{rehearsal}.write_milling_path", lambda *_: 50)
    monkeypatch.setattr(f"{rehearsal}.measure_errors", lambda *_: ERRORS)
    monkeypatch.setattr(f"{rehearsal}.measure_targets", lambda *_: 50)
    monkeypatch.setattr(demo, "find_workplace", lambda: tmp_path)
    monkeypatch.setattr(
        "elastocal.campaigns.campaign_folder.read_campaign_folder",
        lambda *_: SimpleNamespace(document={}),
    )

    def run(failing_step):
        noted = []

        def note_subcommand(self, args=None, **options):
            if options.get("standalone_mode", True):
                return run_application(self, args, **options)
            noted.append(list(args))
            return 3 if args[0] == failing_step else 0

        monkeypatch.setattr(main.InOrder, "main", note_subcommand)
        return elastocal("demo", tmp_path / "cell"), noted

    return run


@pytest.mark.parametrize(
    ("failing_step", "exit_code"), [("verify", 0), ("diagnose", 3)]
)
def test_the_printed_commands_are_run_until_a_step_fails(
    run_demo, failing_step, exit_code
):
    """The verification may fail, as the certificate may."""
    result, noted = run_demo(failing_step)
    assert result.exit_code == exit_code
    steps = [arguments[0] for arguments in noted]
    assert steps == STEPS[: STEPS.index(failing_step) + 1]
    lines = result.stderr.splitlines()
    commands = [line[2:] for line in lines if line.startswith("$ elastocal")]
    assert [shlex.split(command)[1:] for command in commands] == noted


def test_the_answer_compares_the_errors_and_tells_the_hidden_defects(run_demo):
    result, _ = run_demo("verify")
    assert "✓" in result.stderr
    assert "2.00 mm RMS before, 0.100 mm after" in result.stderr
    assert "hidden in it: gear transmission error of joint" in result.stderr
