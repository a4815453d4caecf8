"""Studies of many runs: ensembles of rehearsals, over processes or a Dask cluster."""
