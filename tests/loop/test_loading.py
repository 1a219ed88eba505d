"""Reading a campaign adds the defaults of optional keys for the later steps."""

import yaml
from made_folders import make_folder
from support import refused

from elastocal.campaigns.campaign_folder import read_campaign_folder
from elastocal.loop.loading import REMAINDERS, load_campaign
from elastocal.residual_model.regressions import REGRESSIONS


def test_descriptions_have_the_defaults_of_optional_keys(kuka, config_folder, tmp_path):
    folder = make_folder(tmp_path / "campaign", kuka)
    path = folder / "campaign.yaml"
    document = yaml.safe_load(path.read_text(encoding="utf-8"))
    for key in ("declared", "compliance", "holdout"):
        document.pop(key, None)
    path.write_text(yaml.safe_dump(document), encoding="utf-8")
    descriptions, _, held_out = load_campaign(
        read_campaign_folder(folder.as_posix(), config_folder / "robots")
    )
    campaign = descriptions["campaign"]
    assert (campaign["declared"], campaign["compliance"], campaign["holdout"]) == (
        [],
        "nominal",
        {"fraction": 0.3, "seed": 1},
    )
    assert len(held_out)


def test_an_unknown_regression_is_refused(kuka, config_folder, tmp_path):
    folder = make_folder(tmp_path / "campaign", kuka)
    path = folder / "campaign.yaml"
    document = yaml.safe_load(path.read_text(encoding="utf-8"))
    document["remainder"] = "tea_leaves"
    path.write_text(yaml.safe_dump(document), encoding="utf-8")
    with refused(path, "remainder", "ridge_harmonics"):
        load_campaign(read_campaign_folder(folder.as_posix(), config_folder / "robots"))


def test_remainder_may_name_every_regression():
    assert set(REMAINDERS) == {"auto", "none", *REGRESSIONS}
