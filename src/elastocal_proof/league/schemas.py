"""Schemas of the tables of the benchmark of methods; `schemas.csv` beside this file has
their columns."""

from elastocal.io.storage import read_schemas

SCHEMAS = read_schemas(__file__)
FOLDS = SCHEMAS["folds"]
MECHANISMS = SCHEMAS["mechanisms"]
ENTRIES = SCHEMAS["entries"]
