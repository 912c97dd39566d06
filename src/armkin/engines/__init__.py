"""Engines that run chunks of a long job: this process, a pool of processes, or a Dask cluster.

The work is a pure function of (job, chunk), so that every engine gives the same results in the same order. Only a
window of chunks is outstanding at any time, so that memory does not grow with the job.

ordered_chunks.py  `in_order`: runs chunks and returns their results in order
process_pool.py    processes on this machine
threads.py         threads that share a batch
dask_cluster.py    Dask distributed
"""
