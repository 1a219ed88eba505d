"""Files: Parquet tables with their schemas, checked YAML documents, JSON, atomic
writes, provenance.

Every package may import this one.
"""
