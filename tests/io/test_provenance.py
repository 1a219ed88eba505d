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
