"""A measured campaign: its files, checked as they are read; simulated ones; other
people's data and their importers. Nothing is fitted.
"""
