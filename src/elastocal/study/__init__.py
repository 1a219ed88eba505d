"""The simulation study, equations 11 to 15: each file is one question, with its
functions, its tables on disk and its jobs.

`equation_11` identifies, `metrics` and `evaluation` score, `simulation` and `in_memory`
make the data. The study imports `mechanics`, `io`, and from `application` the design
criteria and the inverse kinematics, but nothing that measured campaigns need.
"""
