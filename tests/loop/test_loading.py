"""What a campaign leaves out is written down for the steps that follow."""

import yaml
from made_folders import make_folder
from support import refused

from elastocal.campaigns.campaign_folder import read_campaign_folder
from elastocal.loop.loading import REMAINDERS, load_campaign
from elastocal.residual_model.regressions import REGRESSIONS


def test_descriptions_hold_what_a_campaign_may_leave_out(kuka, config_folder, tmp_path):
    folder = make_folder(tmp_path / "campaign", kuka)
    path = folder / "campaign.yaml"
    document = yaml.safe_load(path.read_text(encoding="utf-8"))
    for key in ("declared", "compliance", "holdout"):
        document.pop(key, None)
    path.write_text(yaml.safe_dump(document), encoding="utf-8")
    descriptions, _, held_out = load_campaign(
        read_campaign_folder(folder.as_posix(), config_folder / "robots")
    )
    said = descriptions["campaign"]
    assert (said["declared"], said["compliance"], said["holdout"]) == (
        [],
        "nominal",
        {"fraction": 0.3, "seed": 1},
    )
    assert len(held_out)


def test_a_regression_that_neither_the_package_nor_a_plug_in_has_is_refused(
    kuka, config_folder, tmp_path
):
    folder = make_folder(tmp_path / "campaign", kuka)
    path = folder / "campaign.yaml"
    document = yaml.safe_load(path.read_text(encoding="utf-8"))
    document["remainder"] = "tea_leaves"
    path.write_text(yaml.safe_dump(document), encoding="utf-8")
    with refused(path, "remainder", "ridge_harmonics"):
        load_campaign(read_campaign_folder(folder.as_posix(), config_folder / "robots"))


def test_the_names_that_remainder_may_have_are_those_of_the_regressions():
    assert set(REMAINDERS) == {"auto", "none", *REGRESSIONS}
