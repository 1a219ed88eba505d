"""Reports of the study, of a campaign, of a plan and of a certificate: facts, templates
and pages.
"""
