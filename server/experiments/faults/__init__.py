"""`lightleash experiments faults`: every fault of the hazard table, in virtual time and live."""
