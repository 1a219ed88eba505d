"""Which commit, configuration and seed a file names."""

import hashlib

import pytest

from elastocal.io.origin import Origin, canonical_json, configuration_sha256


def test_equal_configurations_have_one_digest_however_they_are_ordered():
    one, other = {"a": 1, "b": {"c": [1.5, "µ"], "d": None}}, {"b": {"d": None, "c": [1.5, "µ"]}, "a": 1}
    assert canonical_json(one) == canonical_json(other) == '{"a":1,"b":{"c":[1.5,"µ"],"d":null}}'
    assert configuration_sha256(one) == hashlib.sha256(canonical_json(other).encode("utf-8")).hexdigest()


@pytest.mark.parametrize("change", [{"a": 2}, {"a": 1.5}, {"a": "1"}, {"b": 1}, {"a": 1, "b": None}])
def test_another_configuration_has_another_digest(change):
    assert configuration_sha256(change) != configuration_sha256({"a": 1})


def test_what_is_no_number_is_refused():
    with pytest.raises(ValueError, match="JSON"):
        canonical_json({"a": float("nan")})


def test_its_words_name_all_three():
    assert Origin("c0ffee-dirty", "d16e57", 7).words == "commit c0ffee-dirty, configuration SHA-256 d16e57, seed 7"
