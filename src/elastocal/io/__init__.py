"""Files: Parquet tables with their schemas, checked YAML documents, JSON, atomic
writes, provenance.

Every room may import this one; it imports `elastocal.errors` alone.
"""
