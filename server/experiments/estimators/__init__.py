"""`lightleash experiments estimators`: three estimators on the same data."""
