"""YAML documents: read, and refused in one line that names file, key and what is allowed."""

import pytest
import yaml
from support import changed, refused

from elastocal.errors import InputError
from elastocal.io.documents import check_document, one_line, read_document, read_schema

ROBOT = {
    "name": "one joint",
    "chain": "Rz(q1) Tx(l) [EE]",
    "lengths_m": {"l": 1.0},
    "joint_limits_deg": [[-180, 180]],
    "compliance_urad_per_Nm": [1.5],
    "links": {"tubes": [{"outer_diameter_m": 0.2, "wall_m": 0.01}], "youngs_modulus_GPa": 70, "shear_modulus_GPa": 26},
}
STRATEGY = {"name": "x", "stages": [{"points": ["EE"], "joints": [1]}, {"points": ["EE"], "joints": [2], "held": [1]}]}


def test_documents_are_read(tmp_path):
    path = tmp_path / "x.yaml"
    path.write_text("name: µ-robot\nlengths_m: {l1: 0.5}\n", encoding="utf-8")
    assert read_document(path) == {"name": "µ-robot", "lengths_m": {"l1": 0.5}}


def test_missing_file_is_refused_in_one_line(tmp_path):
    with refused(tmp_path / "nothing.yaml", "", "No such file", "readable"):
        read_document(tmp_path / "nothing.yaml")


def test_folder_is_refused_in_one_line(tmp_path):
    with refused(tmp_path, "", "readable"):
        read_document(tmp_path)


@pytest.mark.parametrize(
    ("text", "line"),
    [("name: x\nstages: [1, 2\njoints: 3\n", "line 3"), ("name: x\n\tstages: 1\n", "line 2"), ("a: b: c\n", "line 1")],
)
def test_bad_yaml_is_refused_in_one_line_that_names_the_line(tmp_path, text, line):
    path = tmp_path / "bad.yaml"
    path.write_text(text)
    with refused(path, line, "YAML"):
        read_document(path)


@pytest.mark.parametrize("content", [b"name: \xb5-robot\n", b"\x00\x01\x02", b"\xff\xfe\x00"])
def test_file_that_is_no_text_is_refused_in_one_line(tmp_path, content):
    # A micro sign in Latin-1 is the likeliest of them.
    path = tmp_path / "binary.yaml"
    path.write_bytes(content)
    with refused(path, ""):
        read_document(path)


@pytest.mark.parametrize("name", ["config", "robot", "strategy"])
def test_every_key_of_every_schema_is_described(name):
    def properties(schema):
        for key, value in schema.get("properties", {}).items():
            yield key, value
            yield from properties(value)
        if isinstance(schema.get("items"), dict):
            yield from properties(schema["items"])

    schema = read_schema(name)
    assert schema["additionalProperties"] is False
    for key, value in properties(schema):
        assert value.get("description"), key


def test_good_documents_pass():
    check_document(ROBOT, "robot", "robots/x.yaml")
    check_document(STRATEGY, "strategy", "strategies/x.yaml")


@pytest.mark.parametrize(
    ("path", "value", "key", "words"),
    [
        (("compliance_urad_per_Nn",), [1], "compliance_urad_per_Nn", ["unknown key", "'compliance_urad_per_Nm'?", "chain"]),
        (("links", "tubes", 0, "wall"), 0.01, "links.tubes[0].wall", ["unknown key", "'wall_m'?", "outer_diameter_m"]),
        (("zzz",), 1, "zzz", ["unknown key", "(chain, compensator, compliance_urad_per_Nm"]),
        (("chain",), None, "chain", ["nothing", "chain notation"]),
        (("links", "youngs_modulus_GPa"), None, "links.youngs_modulus_GPa", ["nothing", "GPa"]),
        (("links", "tubes", 0, "wall_m"), None, "links.tubes[0].wall_m", ["nothing", "metres"]),
        (("name",), 7, "name", ["found 7", "string", "maker and model"]),
        (("chain",), ["Rz(q1)"], "chain", ["['Rz(q1)']", "string"]),
        (("lengths_m", "l"), "1 m", "lengths_m.l", ["'1 m'", "number", "metres"]),
        (("joint_limits_deg",), [[1]], "joint_limits_deg[0]", ["[1]", "2 or more entries"]),
        (("joint_limits_deg",), [[1, 2, 3]], "joint_limits_deg[0]", ["[1, 2, 3]", "2 or fewer entries"]),
        (("joint_limits_deg",), [], "joint_limits_deg", ["[]", "1 or more entries"]),
        (("compliance_urad_per_Nm",), [0], "compliance_urad_per_Nm[0]", ["found 0", "more than 0"]),
        (("compliance_urad_per_Nm",), [-1.5], "compliance_urad_per_Nm[0]", ["-1.5", "more than 0"]),
        (("compliance_urad_per_Nm",), [True], "compliance_urad_per_Nm[0]", ["True", "number"]),
        (("links", "tubes", 0, "wall_m"), "thin\nwalled", "links.tubes[0].wall_m", ["thin", "number"]),
    ],
)
def test_faulty_robot_is_refused_in_one_line(path, value, key, words):
    with refused("robots/x.yaml", f"{key}:", *words):
        check_document(changed(ROBOT, path, value), "robot", "robots/x.yaml")


@pytest.mark.parametrize(
    ("path", "value", "key", "words"),
    [
        (("stages", 1, "hold"), [1], "stages[1].hold", ["unknown key", "'held'?"]),
        (("stages", 0, "points"), None, "stages[0].points", ["nothing", "measuring points"]),
        (("stages", 0, "joints"), [], "stages[0].joints", ["[]", "1 or more entries"]),
        (("stages", 0, "joints"), [1, 1], "stages[0].joints", ["[1, 1]", "each entry once"]),
        (("stages", 0, "joints"), [0], "stages[0].joints[0]", ["found 0", "1 or more"]),
        (("stages", 0, "joints"), [1.5], "stages[0].joints[0]", ["1.5", "integer"]),
        (("stages", 0, "joints"), "1-6", "stages[0].joints", ["'1-6'", "array"]),
        (("stages",), [], "stages", ["[]", "1 or more entries"]),
    ],
)
def test_faulty_strategy_is_refused_in_one_line(path, value, key, words):
    with refused("strategies/x.yaml", f"{key}:", *words):
        check_document(changed(STRATEGY, path, value), "strategy", "strategies/x.yaml")


@pytest.mark.parametrize("document", [None, [], "text", 3])
def test_document_that_is_no_mapping_is_refused_in_one_line(document):
    with refused("robots/x.yaml", "", "object"):
        check_document(document, "robot", "robots/x.yaml")


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_numbers_that_are_not_finite_are_refused(value):
    # YAML writes them as .nan and .inf.
    with refused("robots/x.yaml", "lengths_m.l"):
        check_document(changed(ROBOT, ("lengths_m", "l"), value), "robot", "robots/x.yaml")


def test_error_is_one_line_whatever_goes_into_it():
    error = InputError("file.yaml", "key", "two\nlines", "some\n\n  thing")
    assert str(error) == "file.yaml: key: found two lines; allowed: some thing"
    assert (error.source, error.key, error.found, error.allowed) == ("file.yaml", "key", "two\nlines", "some\n\n  thing")
    assert str(InputError("file.yaml", "", "nothing", "a file")) == "file.yaml: found nothing; allowed: a file"
    assert isinstance(error, ValueError)


@pytest.mark.parametrize("start", ["<robot name='x'>", '\n<?xml version="1.0"?>\n<robot>'])
def test_a_urdf_for_a_document_is_told_how_it_is_imported(tmp_path, start):
    path = tmp_path / "robot.yaml"
    path.write_text(start, encoding="utf-8")
    with refused(path, "", "XML", "elastocal import urdf"):
        read_document(path)


@pytest.mark.parametrize("value", ["a: b", "# a", 6e-5, [1, [2.5, None]], {"ü": "x" * 300}, "", True])
def test_a_value_on_one_line_reads_back(value):
    text = one_line(value)
    assert "\n" not in text and yaml.safe_load(f"key: {text}") == {"key": value}


def test_a_date_stays_the_text_that_it_is(tmp_path):
    (tmp_path / "a.yaml").write_text("measured_on: 2026-11-20\nat: 2026-11-20 10:00:00\n", encoding="utf-8")
    assert read_document(tmp_path / "a.yaml") == {"measured_on": "2026-11-20", "at": "2026-11-20 10:00:00"}
