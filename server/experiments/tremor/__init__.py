"""`lightleash experiments tremor`: what of the hand's tremor comes through."""
