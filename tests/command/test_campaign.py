"""Where the result of a campaign is looked for, and by which libraries and pins it may have been made."""

import pytest
from analysed_robots import ROBOTS
from certified import record_jobs
from selected import slow_but

from elastocal.campaigns.reading import campaign_files
from elastocal.command import campaign
from elastocal.command.campaign import diagnosed_campaign
from elastocal.io.origin import environment


def test_robots_are_those_of_the_pipeline_and_results_those_of_the_workplace(checkout, tmp_path, monkeypatch):
    (tmp_path / "installed").mkdir()
    (tmp_path / "installed/config").symlink_to(ROBOTS.parent)
    monkeypatch.setattr(campaign, "pipeline", lambda: tmp_path / "installed")
    monkeypatch.setattr(campaign, "workplace", lambda: checkout)
    assert diagnosed_campaign(checkout / "made").name == "made"


WANTED = {
    "certificate": ["--tolerance", "0.5mm"],
    "correct": ["nowhere.csv", "--output", "targets.csv"],
    "export": ["--output", "out"],
}


def edited_pins(checkout):
    (checkout / "requirements").mkdir(exist_ok=True)
    (checkout / "requirements/run.lock").write_text("numpy==2.0\n", encoding="utf-8")
    return "requirements/run.lock none", "requirements/run.lock "


def another_numpy(_):
    record_jobs("made", campaign_files("made", ROBOTS), environment(".") | {"numpy": "1.0"})
    return "numpy 1.0", f"numpy {environment('.')['numpy']}"


@pytest.mark.parametrize("change", slow_but([another_numpy], [edited_pins, another_numpy]))
def test_results_of_another_environment_are_refused_by_every_command_unless_that_is_accepted(
    in_checkout, elastocal, refusal, capsys, change
):
    was, now = change(in_checkout)
    for command, words in WANTED.items():
        line = refusal(command, "made", *words)
        assert line.startswith(f"made: found results by {was}") and f"those of now, {now}" in line
        assert line.endswith("elastocal diagnose made; or --accept-environment")
    assert diagnosed_campaign(in_checkout / "made", True).name == "made"
    assert capsys.readouterr().err.startswith(f"warning: {in_checkout}/made: found results by {was}")
    for command, words in WANTED.items():
        result = elastocal(command, "made", *words, "--accept-environment")
        assert "nowhere" in str(result.exception) or result.exit_code == 0
    (in_checkout / "requirements/run.lock").unlink(missing_ok=True)
    record_jobs("made", campaign_files("made", ROBOTS))
