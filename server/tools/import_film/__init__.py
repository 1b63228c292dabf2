"""`lightleash import`: a film of any phone and its motion samples become a recording."""
