"""A finished run as other programs can read it: Workflow Run RO-Crate, software list, data package of the tables.

Knows the records of jobs (`elastocal.io.records`) and files; nothing here runs or judges anything.
"""
