"""Where the result of a campaign is looked for."""

from elastocal.command import campaign


def test_results_and_robots_are_those_of_the_checkout(tmp_path, monkeypatch):
    asked = []
    monkeypatch.setattr(campaign, "checkout", lambda: tmp_path)
    monkeypatch.setattr("elastocal.loop.calibrated_files.load_diagnosed", lambda *where: asked.append(where))
    campaign.diagnosed_campaign(tmp_path / "cell7")
    assert asked == [(tmp_path / "cell7", tmp_path / "config" / "robots", tmp_path / "results" / "loop")]
