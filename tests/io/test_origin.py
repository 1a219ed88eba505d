"""The origin of a file identifies its configuration."""

import hashlib
import json

import pytest

import elastocal
from elastocal.io.origin import (
    describe_provenance,
    digest_configuration,
    format_canonical_json,
)


def test_the_digest_of_a_configuration_does_not_depend_on_the_order_of_keys():
    configuration = {"a": 1, "b": {"c": [1.5, "µ"], "d": None}}
    reordered = {"b": {"d": None, "c": [1.5, "µ"]}, "a": 1}
    assert (
        format_canonical_json(configuration)
        == format_canonical_json(reordered)
        == '{"a":1,"b":{"c":[1.5,"µ"],"d":null}}'
    )
    assert (
        digest_configuration(configuration)
        == hashlib.sha256(format_canonical_json(reordered).encode("utf-8")).hexdigest()
    )
    with pytest.raises(ValueError, match="JSON"):
        format_canonical_json({"a": float("nan")})


def test_provenance_has_version_settings_and_facts_in_any_order_of_keys():
    settings = {"seed": 1, "loading": {"force_N": 1000, "offset_m": [0, 0.5, 0]}}
    provenance = describe_provenance(settings, noise_um="200")
    assert provenance["elastocal_version"] == elastocal.__version__
    assert (
        provenance["configuration"] == settings
        and provenance["noise_um"] == "200"
        and json.loads(json.dumps(provenance)) == provenance
    )
    reordered = {
        "loading": {"offset_m": (0, 0.5, 0), "force_N": 1000},
        "seed": 1,
        "sources_sha256": "x",
    }
    assert (
        describe_provenance(reordered)
        == describe_provenance(settings)
        != describe_provenance(settings | {"seed": 2})
    )
