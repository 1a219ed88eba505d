"""Measured campaigns: their files, which are checked as they are read, simulated
campaigns, and importers of public data. Nothing is fitted.
"""
