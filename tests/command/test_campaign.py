"""Where the result of a campaign is looked for."""

from types import SimpleNamespace

from elastocal.command import campaign


def test_robots_are_those_of_the_pipeline_and_results_those_of_the_workplace(tmp_path, monkeypatch):
    asked = []
    monkeypatch.setattr(campaign, "pipeline", lambda: tmp_path / "installed")
    monkeypatch.setattr(campaign, "workplace", lambda: tmp_path / "here")
    found = SimpleNamespace(name="cell7")
    monkeypatch.setattr("elastocal.loop.calibrated_files.load_diagnosed", lambda *where: asked.append(where) or found)
    campaign.diagnosed_campaign(tmp_path / "cell7")
    assert asked == [(tmp_path / "cell7", tmp_path / "installed" / "config" / "robots", tmp_path / "here" / "results" / "loop")]
