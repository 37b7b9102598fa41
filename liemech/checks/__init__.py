"""Does a class obey the laws it claims?  Groups, retractions, actions, systems and methods; one
small function for each law.

The checks go through the tables of laws, at several points, and report.
"""

from .check import check_action, check_group, check_method, check_retraction, check_system
from .laws.poisson_laws import check_poisson
from .poisson_defect import poisson_defect
from .poisson_field import check_poisson_field
from .report import Finding, Observation, Report

__all__ = [
    "Finding",
    "Observation",
    "Report",
    "check_action",
    "check_group",
    "check_method",
    "check_poisson",
    "check_poisson_field",
    "check_retraction",
    "check_system",
    "poisson_defect",
]
