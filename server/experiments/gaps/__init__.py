"""`lightleash experiments gaps`: the closed loop against gaps in its links, in virtual time."""
