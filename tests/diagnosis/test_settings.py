"""Tests of the settings: verdict.json has each with its reason, and they can be read
back."""

import json
from dataclasses import fields, replace

from elastocal.diagnosis.settings import Settings


def test_the_document_has_every_setting_with_its_value_and_a_reason():
    settings = replace(Settings(), alarm_level=0.1)
    document = json.loads(json.dumps(settings.document()))
    assert list(document) == [entry.name for entry in fields(Settings)]
    assert document["alarm_level"]["value"] == 0.1
    for name, entry in document.items():
        assert set(entry) == {"value", "reason"}, name
        assert len(entry["reason"].split()) > 3, name
        value = getattr(settings, name)
        assert entry["value"] == (list(value) if isinstance(value, tuple) else value)


def test_settings_are_read_back_from_their_document():
    settings = replace(Settings(), alarm_level=0.1, scales=(0.5, 1.0))
    document = json.loads(json.dumps(settings.document()))
    assert Settings.from_document(document) == settings
