"""`lightleash survey`: where a robot's LEDs are, from a film of it at rest."""
