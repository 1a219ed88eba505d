"""The demonstration runs the commands that it prints, in their order; test_afternoon.py
goes the whole way with them."""

import shlex
from types import SimpleNamespace

import numpy as np
import pytest

from elastocal.command import demo, main

ORDER = ["plan", "check", "diagnose", "correct", "certificate"]


@pytest.mark.parametrize(("fails", "code"), [("certificate", 0), ("diagnose", 3)])
def test_what_is_printed_is_what_is_run_until_a_step_fails(
    elastocal, monkeypatch, tmp_path, fails, code
):
    """With subcommands that only note what they were called with; a certificate may
    fail."""
    called = []
    whole = main.InOrder.main

    def main_of_the_rest(self, args=None, **options):
        if options.get("standalone_mode", True):
            return whole(self, args, **options)
        called.append(list(args))
        return 3 if args[0] == fails else 0

    monkeypatch.setattr(main.InOrder, "main", main_of_the_rest)
    monkeypatch.setattr(demo, "find_workplace", lambda: tmp_path)
    missed = {
        name: np.full(3, off)
        for name, off in (
            ("uncorrected", 2e-3),
            ("corrected", 1e-4),
            ("noise alone", 9e-5),
        )
    }
    for name, result in (
        ("fill_sheet", 12),
        ("write_milling_path", 50),
        ("measured_errors", missed),
    ):
        monkeypatch.setattr(
            f"elastocal_proof.blind.rehearsal.{name}", lambda *_, result=result: result
        )
    monkeypatch.setattr(
        "elastocal.campaigns.campaign_folder.read_campaign_folder",
        lambda *_: SimpleNamespace(document={}),
    )
    result = elastocal("demo", tmp_path / "cell")
    assert (
        result.exit_code == code
        and [words[0] for words in called] == ORDER[: ORDER.index(fails) + 1]
    )
    assert [
        shlex.split(line[2:])[1:]
        for line in result.stderr.splitlines()
        if line.startswith("$ elastocal")
    ] == called
    if not code:
        assert (
            "✓" in result.stderr
            and "2.00 mm RMS before, 0.100 mm after" in result.stderr
        )
        assert "hidden in it: gear transmission error of joint" in result.stderr
