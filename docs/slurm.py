"""A sweep on a Slurm cluster, in a folder that all nodes share: python slurm.py FILE

Needs `pip install 'carom[cluster]' dask-jobqueue` in an environment that the nodes see, too. Runs on the login node, or in a small
job of its own, and keeps JOBS jobs going as long as there are runs left. Started again it goes on with the rest.
"""

import sys

from dask_jobqueue import SLURMCluster

from runner import sweep

CORES, JOBS = 32, 10  # of a job; at once

with SLURMCluster(
    # To adapt: where, and how much. A run needs some 400 MB, and what its frames take.
    queue="normal",
    account=None,
    cores=CORES,
    memory="64GB",
    walltime="04:00:00",
    interface=None,  # "ib0", say: the network that nodes reach each other by
    # A process for each core: a run takes one. Workers leave before the job ends, and give their runs to others.
    processes=CORES,
    worker_extra_args=["--no-dashboard", "--lifetime", "230m", "--lifetime-stagger", "4m"],
    scheduler_options={"dashboard": False},
) as cluster:
    cluster.adapt(minimum_jobs=JOBS, maximum_jobs=JOBS)  # not scale: a job that has ended is replaced
    table = sweep(sys.argv[1], cluster=cluster.scheduler_address)
    print(f"{table.num_rows} runs in the summary")
