"""The simulation study: strategies, identification, Cramér-Rao bounds, metrics, tables; its steps are in `steps`.

Equations 11 to 15. Imports `mechanics` and `io`, nothing that measured campaigns need.
"""
