"""Does a class obey the laws it claims?  The axioms of groups, retractions and actions, one small function each.

`check_group`, `check_retraction` and `check_action` go through the tables of laws, at several places, and report.
"""

from .check import check_action, check_group, check_retraction
from .report import Finding, Report

__all__ = ["Finding", "Report", "check_action", "check_group", "check_retraction"]
