"""The demonstration runs the commands that it prints, in their order; test_afternoon.py goes the whole way with them."""

import shlex

import numpy as np
import pytest

from elastocal.command import demo, main

DONE = {"plan": 0, "check": 0, "diagnose": 0, "correct": 0, "certificate": 1}


@pytest.fixture
def run(elastocal, monkeypatch, tmp_path):
    """Run it with subcommands that only note what they were called with; what was called, and what was printed."""
    called = []

    def main_of_the_rest(self, args=None, **options):
        if options.get("standalone_mode", True):
            return whole(self, args, **options)
        called.append(list(args))
        return codes[args[0]]

    codes = dict(DONE)
    whole = main.InOrder.main
    monkeypatch.setattr(main.InOrder, "main", main_of_the_rest)
    monkeypatch.setattr(demo, "workplace", lambda: tmp_path)
    missed = {name: np.full(3, off) for name, off in (("uncorrected", 2e-3), ("corrected", 1e-4), ("noise alone", 9e-5))}
    for name, result in (("fill_sheet", 12), ("write_milling_path", 50), ("measured_errors", missed)):
        monkeypatch.setattr(f"elastocal_proof.blind.rehearsal.{name}", lambda *_, result=result: result)
    monkeypatch.setattr("elastocal.campaigns.reading.read_descriptions", lambda *_: ({}, ""))

    def ended(*words, **other):
        codes.update(other)
        return elastocal("demo", tmp_path / "cell", *words), called

    return ended


def test_what_is_printed_is_what_is_run_from_plan_to_certificate(run):
    result, called = run()
    assert result.exit_code == 0, result.output
    assert [words[0] for words in called] == list(DONE)
    typed = [shlex.split(line[2:])[1:] for line in result.stderr.splitlines() if line.startswith("$ elastocal")]
    assert typed == called
    assert "✓" in result.stderr and "2.00 mm RMS before, 0.100 mm after" in result.stderr
    assert "hidden in it: gear transmission error of joint" in result.stderr
    assert "gravity sag in the verdict is right too" in result.stderr


def test_a_step_that_fails_ends_it_with_its_exit_code(run):
    result, called = run(diagnose=3)
    assert result.exit_code == 3
    assert [words[0] for words in called] == ["plan", "check", "diagnose"]
