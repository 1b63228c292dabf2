"""`lightleash experiments paper`: the paper's section V flown again, beside its figures.

`published` is what the paper says; `leader` and `flight` are the set-up, one file per experiment
flies it, one draws it as the paper does; `assumptions` is what the paper leaves open.
"""
