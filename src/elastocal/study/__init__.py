"""The simulation study, equations 11 to 15: a question is a file, with its functions,
its tables on disk and its jobs.

`equation_11` identifies, `metrics` and `evaluation` judge, `simulation` and `in_memory`
make the data. Imports `mechanics`, `io` and planning's criteria, nothing that measured
campaigns need.
"""
