"""Where chunks of a long piece of work are done: in this process, in a pool of processes, on a Dask cluster.

The work is a pure function of (job, chunk), so that every engine gives the same results in the same order. Of a job of
any size only a window of chunks is outstanding: nothing grows with the work.

ordered_chunks.py  `in_order`: chunks in, results out
process_pool.py    processes on this machine
dask_cluster.py    Dask distributed
"""
