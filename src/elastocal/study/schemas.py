"""Schemas of the tables of the study; `schemas.csv` beside this file has their columns."""

from elastocal.io.storage import read_schemas

SCHEMAS = read_schemas(__file__)
EXPERIMENTS = SCHEMAS["experiments"]
DEFLECTIONS = SCHEMAS["deflections"]
INITIAL = SCHEMAS["initial"]
WEIGHTS = SCHEMAS["weights"]
IDENTIFIED = SCHEMAS["identified"]
METRICS = SCHEMAS["metrics"]
REPLICATES = SCHEMAS["replicates"]
REPEATED = SCHEMAS["repeated"]
BUDGET = SCHEMAS["budget"]
SIMULATED_DESIGNS = SCHEMAS["simulated_designs"]
LADDER = SCHEMAS["ladder"]
USES = SCHEMAS["uses"]
