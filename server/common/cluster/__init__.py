"""Work spread over the workers of a Dask scheduler, all of which run the same code."""
