#!/bin/sh
# Data set by any tool that starts processes: examples/cluster/xargs.sh plan.toml out 4 2
# makes 4 shards in 2 processes, then manifest and card.
export LP_NUM_THREADS=1  # of Mesa's rasterizer: a process draws on its own core
seq 0 "$(($3 - 1))" | xargs -P "$4" -I N omnisim generate "$1" -o "$2" --shards N &&
	omnisim generate "$1" -o "$2"
