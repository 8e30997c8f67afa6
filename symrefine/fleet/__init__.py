"""Many tasks, one result each: on this machine, on a Dask cluster or in shards; nothing is lost, nothing done twice."""
