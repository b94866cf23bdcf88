"""Many scenes by chance: `python -m tests.chance --scenes 1000 --seed 1 --only lenses`."""

import argparse
import time
from collections import Counter

from tests.chance.run import KINDS

PRINT_EVERY = 20  # scenes


def _main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.chance", description=__doc__)
    parser.add_argument("--scenes", type=int, default=100, help="how many of each kind")
    parser.add_argument("--first", type=int, default=0, help="number of the first one")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", choices=list(KINDS), help="one kind")
    options = parser.parse_args()
    failed = False
    for kind in [options.only] if options.only else KINDS:
        counts, begin_s = Counter(), time.perf_counter()
        for number in range(options.first, options.first + options.scenes):
            some, findings = KINDS[kind](options.seed, number)
            counts += some
            for line in findings:
                failed = True
                print(line, flush=True)
            if number % PRINT_EVERY == PRINT_EVERY - 1:
                print(f"{kind} up to number {number}: {dict(counts)}", flush=True)
        spent_s = time.perf_counter() - begin_s
        print(f"{options.scenes} scenes with {kind}, {spent_s:.0f} s: {dict(counts)}", flush=True)
    return int(failed)


if __name__ == "__main__":
    raise SystemExit(_main())
