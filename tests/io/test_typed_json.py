"""Dataclasses survive JSON, and the error of a wrong document names the key."""

import json
from dataclasses import dataclass, field
from typing import Any

import jsonschema
import pytest

from elastocal.errors import InputError
from elastocal.io.typed_json import (
    OMITTED_BY_DEFAULT,
    build_json_schema,
    from_document,
    to_document,
)


@dataclass(frozen=True)
class Point:
    """A point."""

    name: str
    coordinates: tuple[float, float]


@dataclass(frozen=True)
class Circle:
    """A circle."""

    centre: Point
    radius_m: float


@dataclass(frozen=True)
class Drawing:
    """A drawing."""

    shapes: tuple[Point | Circle, ...]
    weights: dict[str, float]
    scale: float | None
    options: dict[str, Any] | None
    closed: bool = field(default=False, metadata=OMITTED_BY_DEFAULT)


ORIGIN = Point("origin", (0.0, 0.0))
DRAWING = Drawing((ORIGIN, Circle(ORIGIN, 2.0)), {"pen": 1}, None, {"any": [1, "x"]})


@pytest.mark.parametrize("closed", [False, True])
def test_a_dataclass_survives_json(closed):
    drawing = Drawing(DRAWING.shapes, {}, 0.5, None, closed)
    document = json.loads(json.dumps(to_document(drawing)))
    assert ("closed" in document) == closed
    assert from_document(Drawing, document, "file") == drawing
    jsonschema.validate(document, build_json_schema(Drawing))


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"scale": "large"}, "scale"),
        ({"scale": True}, "scale"),
        ({"weights": {"pen": "heavy"}}, "weights.pen"),
        ({"weights": []}, "weights"),
        ({"shapes": [{"name": "no coordinates"}]}, "shapes[0]"),
        ({"shapes": [{"name": "origin", "coordinates": [0.0]}]}, "shapes[0].coord"),
        ({"shapes": "all"}, "shapes"),
        ({"colour": "red"}, "colour"),
    ],
)
def test_a_wrong_document_is_refused_by_key_and_by_schema(changes, key):
    document = to_document(DRAWING) | changes
    with pytest.raises(InputError) as error:
        from_document(Drawing, document, "file")
    assert error.value.key.startswith(key) and error.value.source == "file"
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(document, build_json_schema(Drawing))


def test_a_missing_key_is_named():
    document = to_document(DRAWING)
    del document["weights"]
    with pytest.raises(InputError, match="weights"):
        from_document(Drawing, document, "file")
