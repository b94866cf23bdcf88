#!/bin/sh
# Data set on a Slurm cluster: sbatch --array=0-99 examples/cluster/slurm.sh plan.toml out
# A task makes every hundredth shard. What is there stays: send it again after a failure. Plan and
# folder are on a file system that all machines see.
#SBATCH --cpus-per-task=1
#SBATCH --mem=2G
export LP_NUM_THREADS=1  # of Mesa's rasterizer: a task draws on its own core
number=$SLURM_ARRAY_TASK_ID
shards=${3:-$SLURM_ARRAY_TASK_COUNT}
while [ "$number" -lt "$shards" ]; do
	omnisim generate "$1" -o "$2" --shards "$number" || exit
	number=$((number + SLURM_ARRAY_TASK_COUNT))
done
