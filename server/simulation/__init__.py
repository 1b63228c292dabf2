"""The closed loop in virtual time, for experiments, sweeps and tests."""
