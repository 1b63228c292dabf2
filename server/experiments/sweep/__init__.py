"""`lightleash experiments sweep`: many closed-loop sessions over any configuration key and seeds.

In virtual time and, unless told otherwise, without pictures: LEDs' rays with noise go straight to
the filter. One file per idea: `server.simulation.sweep_keys` what can be swept, `sweep_file`
reading and checking, `server.simulation.session` one of them, `workers` who flies, `results` what
is kept, `summary` and `picture` what is shown.
"""
