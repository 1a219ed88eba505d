"""YAML documents are read, or refused in one line that names file, key and what is
allowed."""

import math

import pytest
import yaml
from durations import at_once
from support import changed, refused

from elastocal.io.documents import (
    DEEPEST,
    LARGEST_BYTES,
    MOST_VALUES,
    check_document,
    read_document,
    read_named_document,
    read_schema,
)

ROBOT = {
    "name": "one joint",
    "chain": "Rz(q1) Tx(l) [EE]",
    "lengths_m": {"l": 1.0},
    "joint_limits_deg": [[-180, 180]],
    "compliance_urad_per_Nm": [1.5],
    "links": {
        "tubes": [{"outer_diameter_m": 0.2, "wall_m": 0.01}],
        "youngs_modulus_GPa": 70,
        "shear_modulus_GPa": 26,
    },
}
STRATEGY = {
    "name": "x",
    "stages": [
        {"points": ["EE"], "joints": [1]},
        {"points": ["EE"], "joints": [2], "held": [1]},
    ],
}


def read(tmp_path, text):
    path = tmp_path / "a.yaml"
    path.write_text(text, encoding="utf-8")
    return read_document(path)


CAMPAIGN = {
    "campaign": "cell7",
    "robot": "kuka",
    "measured": "pose",
    "frame": "base",
    "targets": {"E": {"point": "6DoF", "offset_m": "unknown"}},
}


def numbers_in(schema, path=()):
    """Every place of a schema at which a number may stand."""
    if "number" in (schema.get("type") or ()):
        yield path, schema
    for key, inner in schema.get("properties", {}).items():
        yield from numbers_in(inner, (*path, key))
    for key in ("items", "additionalProperties", "then", "else"):
        if isinstance(schema.get(key), dict):
            yield from numbers_in(schema[key], (*path, key))


@pytest.mark.parametrize("name", ["robot", "campaign"])
def test_every_quantity_has_a_smallest_and_a_largest_value(name):
    """Without bounds, a solver would fail later with a message that lacks the key."""
    rules = dict(numbers_in(read_schema(name)))
    assert len(rules) > 4
    for path, rule in rules.items():
        assert {"minimum", "exclusiveMinimum"} & set(rule), path
        assert {"maximum", "exclusiveMaximum"} & set(rule), path


@pytest.mark.parametrize(
    ("path", "value", "key", "phrases"),
    [
        (("lengths_m", "l"), math.nan, "lengths_m.l", ["finite"]),
        (
            ("compliance_urad_per_Nn",),
            [1],
            "compliance_urad_per_Nn",
            ["unknown key", "'compliance_urad_per_Nm'?", "chain"],
        ),
        (
            ("links", "tubes", 0, "wall_m"),
            None,
            "links.tubes[0].wall_m",
            ["nothing", "metres"],
        ),
        (
            ("joint_limits_deg",),
            [[1]],
            "joint_limits_deg[0]",
            ["[1]", "allowed: 2 entries"],
        ),
        (
            ("compliance_urad_per_Nm",),
            [0],
            "compliance_urad_per_Nm[0]",
            ["found 0", "1e-06 to 100000"],
        ),
        (
            ("compliance_urad_per_Nm",),
            [True],
            "compliance_urad_per_Nm[0]",
            ["True", "number"],
        ),
        (("stages", 0, "joints"), [], "stages[0].joints", ["[]", "1 or more entries"]),
        (
            ("stages", 0, "joints"),
            [1, 1],
            "stages[0].joints",
            ["[1, 1]", "each entry once"],
        ),
        (("stages", 0, "joints"), [1.5], "stages[0].joints[0]", ["1.5", "integer"]),
    ],
)
def test_a_faulty_robot_or_strategy_is_refused_in_one_line(path, value, key, phrases):
    document, schema = (
        (STRATEGY, "strategy") if path[0] == "stages" else (ROBOT, "robot")
    )
    with refused("x.yaml", f"{key}:", *phrases):
        check_document(changed(document, path, value), schema, "x.yaml")


# Each alias stands for 501 values.
BOMB = "a: &a [" + "x, " * 500 + "x]\nb: [" + "*a, " * 400 + "*a]\n"


@pytest.mark.parametrize(
    ("text", "line", "phrases"),
    [
        (BOMB, "line 2", ["more values", str(MOST_VALUES), "aliases"]),
        ("a: &a [*a]\n", "line 1", ["alias *a", "no other anchor"]),
        ("a: &a [x]\nb: &b [*a]\n", "line 2", ["alias *a", "no other anchor"]),
        ("[" * 100_000, "line 1", ["in each other", f"{DEEPEST} deep"]),
        (
            "#" * (LARGEST_BYTES + 1),
            "",
            [f"more than {LARGEST_BYTES} bytes", f"at most {LARGEST_BYTES}"],
        ),
        (
            "x: 1\na: !!python/object/apply:os.system [true]\n",
            "line 2",
            ["tag", "without tags"],
        ),
        ("a: 1\nb: x\0\n", "line 2", ["control character", "x00"]),
        ("a: 1\n---\nb: 2\n", "line 2", ["found another document"]),
        ('\n<?xml version="1.0"?>\n<robot>', "", ["XML", "elastocal import urdf"]),
        ("x: 1\na: @x\n", "line 2", ["found character that cannot start"]),
        (
            "campaign: a\nrobot: b\ncampaign: c\n",
            "line 3",
            ["'campaign' again", "first in line 1"],
        ),
        ("a: 1\nseed: 1_0\n", "line 2", ["found 1_0", "decimal"]),
        (f"seed: {'9' * 5000}\n", "line 1", ["999", "18 digits"]),
    ],
)
def test_a_text_that_is_no_plain_document_is_refused_at_once(
    tmp_path, text, line, phrases
):
    with at_once(), refused(f"{tmp_path / 'a.yaml'}: {line}", line, *phrases):
        read(tmp_path, text)


def test_decimal_numbers_are_read(tmp_path):
    values = read(tmp_path, "[6e-5, 6E5, -1.5e5, 1.e3, .5, 17, +3, '1e5', a1e5]")
    assert values == [6e-5, 6e5, -1.5e5, 1e3, 0.5, 17, 3, "1e5", "a1e5"]


STEERING = [
    "a\x1b[2Jb",
    "a\u202eb",
    "a\u2067b",
    "a\u200bb",
    "a\nb",
    "a\tb",
    "a\x85b",
    "a\ufeffb",
]
FORMULAS = ["=1+1", "@SUM(A1)", "+x", "-x", "＝1"]


@pytest.mark.parametrize("text", [*STEERING, *FORMULAS])
def test_control_characters_and_spreadsheet_formulas_are_refused_everywhere(
    tmp_path, text
):
    """They are refused in keys and values, and in every kind of document; the message
    shows escapes."""
    allowed = (
        "printable characters on one line"
        if text in STEERING
        else f"does not begin with {text[0]}"
    )
    target = {"point": "6DoF", "offset_m": "unknown"}
    for document, schema, key in (
        (CAMPAIGN | {"targets": {text: target}}, "campaign", "targets"),
        (CAMPAIGN | {"declared": [text]}, "campaign", "declared[0]"),
        (ROBOT | {"name": text}, "robot", "name"),
    ):
        with refused("a.yaml", key, allowed):
            check_document(document, schema, "a.yaml")
    document = read(tmp_path, yaml.safe_dump(ROBOT | {"name": text}, sort_keys=False))
    with refused(tmp_path / "a.yaml", "line 1, name", allowed):
        check_document(document, "robot", (tmp_path / "a.yaml").as_posix())


@pytest.mark.parametrize("name", ["../robots/one", "one.yaml", "", ".", "x" * 5000])
def test_a_document_is_found_by_its_name_and_not_by_a_path(tmp_path, name):
    (tmp_path / "robots").mkdir()
    (tmp_path / "robots" / "one.yaml").write_text(
        yaml.safe_dump(ROBOT), encoding="utf-8"
    )
    assert (
        read_named_document(tmp_path, "robots", "robot", "one", "config.yaml") == ROBOT
    )
    with refused("config.yaml", "robots", "one"):
        read_named_document(tmp_path, "robots", "robot", name, "config.yaml")


@pytest.mark.parametrize(
    ("text", "key", "allowed"),
    [
        (
            "name: x\nstages:\n- points: [EE]\n  joints: [1]\n- points: [EE]\n  joints: [a]\n",
            "line 6, stages[1].joints[0]: ",
            "",
        ),
        ("\n\nnmae: x\n", "line 3, nmae: ", "name"),
        ("name: x\nstages:\n", "line 2, stages: found nothing", "1 or more entries"),
        ("name: x\n", "yaml: stages: found nothing", ""),
        ("- 1\n", "yaml: found [1]", "keys with values"),
    ],
)
def test_a_refused_key_is_named_with_its_line(tmp_path, text, key, allowed):
    path = tmp_path / "a.yaml"
    with refused(path, key, allowed):
        check_document(read(tmp_path, text), "strategy", path.as_posix())
