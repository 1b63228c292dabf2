"""`lightleash robot identify`: a robot's numbers, by flights that were recorded."""
