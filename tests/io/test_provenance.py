"""Provenance: the same for the same settings however they are written down, and fit for JSON."""

import json

import elastocal
from elastocal.io.provenance import provenance


def test_provenance_holds_version_settings_and_whatever_else_is_given_and_does_not_depend_on_their_order():
    settings = {"seed": 1, "loading": {"force_N": 1000, "offset_m": [0, 0.5, 0]}}
    found = provenance(settings, noise_um="200")
    assert found["elastocal_version"] == elastocal.__version__
    assert found["configuration"] == settings and found["noise_um"] == "200" and json.loads(json.dumps(found)) == found
    turned = {"loading": {"offset_m": (0, 0.5, 0), "force_N": 1000}, "seed": 1, "sources_sha256": "x"}
    assert provenance(turned) == provenance(settings) != provenance(settings | {"seed": 2})
