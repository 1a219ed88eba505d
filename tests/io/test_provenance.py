"""Provenance: the same for the same settings, another for others, and fit for JSON."""

import json

import elastocal
from elastocal.io.provenance import provenance

SETTINGS = {"seed": 1, "loading": {"force_N": 1000, "offset_m": [0, 0.5, 0]}}


def test_provenance_holds_version_settings_and_whatever_else_is_given():
    found = provenance(SETTINGS, noise_um="200")
    assert found["elastocal_version"] == elastocal.__version__
    assert found["configuration"] == SETTINGS and found["noise_um"] == "200"
    assert json.loads(json.dumps(found)) == found


def test_digest_does_not_depend_on_the_order_of_keys_or_on_tuples():
    turned = {"loading": {"offset_m": (0, 0.5, 0), "force_N": 1000}, "seed": 1}
    assert provenance(turned) == provenance(SETTINGS)


def test_another_setting_has_another_digest():
    digests = {provenance(SETTINGS | {"seed": seed})["configuration_sha256"] for seed in (1, 2, 3)}
    assert len(digests) == 3 and provenance(SETTINGS)["configuration_sha256"] in digests


def test_the_digest_of_the_sources_is_no_setting():
    assert provenance({"seed": 1, "sources_sha256": "abc"}) == provenance({"seed": 1})
