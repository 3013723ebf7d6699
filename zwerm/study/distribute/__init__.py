"""Studies on several machines: shards without a common scheduler (`shard`, `merging`), and a Dask cluster (`cluster`)."""
