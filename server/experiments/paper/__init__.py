"""`lightleash experiments paper`: the paper's section V flown again, beside its figures.

`setup.published` is what the paper says; `server.simulation.sensors` and `setup.flight` are the
set-up, one file per experiment flies it, one draws it as the paper does; `setup.assumptions` is
what the paper leaves open.
"""
