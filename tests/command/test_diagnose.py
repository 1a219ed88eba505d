import subprocess

from typer.testing import CliRunner

from elastocal.command.main import app


def test_diagnose_runs_the_target_of_the_campaign_in_the_checkout(tmp_path, monkeypatch):
    calls = []

    def run(words, cwd, check):
        calls.append((words, cwd))
        return subprocess.CompletedProcess(words, 3)

    monkeypatch.setattr(subprocess, "run", run)
    result = CliRunner().invoke(app, ["diagnose", str(tmp_path), "-j", "1"])
    assert result.exit_code == 3
    ((words, cwd),) = calls
    assert words[1:] == ["-m", "snakemake", "-j1", "diagnose", "--config", f"campaign={tmp_path}"]
    assert (cwd / "Snakefile").is_file()
