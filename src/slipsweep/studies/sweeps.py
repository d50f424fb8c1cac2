"""A sweep, whatever shakes the plane."""

from typing import Any

from slipsweep.grid.plans import Plan, plan_sweep
from slipsweep.motion.records import Record


def plan_of(**given: Any) -> Plan:
    """Plan of a sweep; keyword arguments and errors of `slipsweep.sweep`, as `plans.plan_sweep` takes them."""
    if isinstance(given.get("excitation"), Record):
        from slipsweep.studies.record_sweeps import plan_record  # brings a kernel along that others do not need

        return plan_record(**given)
    return plan_sweep(**given)
