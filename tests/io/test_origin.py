"""Which configuration a file names."""

import hashlib

import pytest

from elastocal.io.origin import canonical_json, configuration_sha256


def test_equal_configurations_have_one_digest_however_they_are_ordered():
    one, other = {"a": 1, "b": {"c": [1.5, "µ"], "d": None}}, {"b": {"d": None, "c": [1.5, "µ"]}, "a": 1}
    assert canonical_json(one) == canonical_json(other) == '{"a":1,"b":{"c":[1.5,"µ"],"d":null}}'
    assert configuration_sha256(one) == hashlib.sha256(canonical_json(other).encode("utf-8")).hexdigest()
    with pytest.raises(ValueError, match="JSON"):
        canonical_json({"a": float("nan")})
