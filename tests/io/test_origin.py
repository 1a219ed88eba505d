"""Which configuration a file names."""

import hashlib
import json

import pytest

import elastocal
from elastocal.io.origin import (
    describe_provenance,
    digest_configuration,
    format_canonical_json,
)


def test_equal_configurations_have_one_digest_however_they_are_ordered():
    one = {"a": 1, "b": {"c": [1.5, "µ"], "d": None}}
    other = {"b": {"d": None, "c": [1.5, "µ"]}, "a": 1}
    assert (
        format_canonical_json(one)
        == format_canonical_json(other)
        == '{"a":1,"b":{"c":[1.5,"µ"],"d":null}}'
    )
    assert (
        digest_configuration(one)
        == hashlib.sha256(format_canonical_json(other).encode("utf-8")).hexdigest()
    )
    with pytest.raises(ValueError, match="JSON"):
        format_canonical_json({"a": float("nan")})


def test_provenance_holds_version_settings_and_whatever_else_is_given_and_does_not_depend_on_their_order():
    settings = {"seed": 1, "loading": {"force_N": 1000, "offset_m": [0, 0.5, 0]}}
    found = describe_provenance(settings, noise_um="200")
    assert found["elastocal_version"] == elastocal.__version__
    assert (
        found["configuration"] == settings
        and found["noise_um"] == "200"
        and json.loads(json.dumps(found)) == found
    )
    turned = {
        "loading": {"offset_m": (0, 0.5, 0), "force_N": 1000},
        "seed": 1,
        "sources_sha256": "x",
    }
    assert (
        describe_provenance(turned)
        == describe_provenance(settings)
        != describe_provenance(settings | {"seed": 2})
    )
