"""Schema of the table that the closed loop writes; `schemas.csv` beside this file has its
columns."""

from elastocal.io.storage import read_schemas

SCHEMAS = read_schemas(__file__)
CLOSED_LOOP = SCHEMAS["closed_loop"]
