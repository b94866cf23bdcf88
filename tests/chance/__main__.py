"""Many scenes by chance: `python -m tests.chance --scenes 1000 --seed 1 --only lenses`."""

import argparse
import time
from collections import Counter

from tests.chance.run import KINDS, check_scenes

PRINT_EVERY = 20  # scenes


def _main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.chance", description=__doc__)
    parser.add_argument("--scenes", type=int, default=100, help="how many of each kind")
    parser.add_argument("--first", type=int, default=0, help="number of the first one")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", choices=KINDS, help="one kind")
    options = parser.parse_args()
    failed, last = False, options.first + options.scenes
    for kind in [options.only] if options.only else KINDS:
        counts, begin_s = Counter(), time.perf_counter()
        for number in range(options.first, last, PRINT_EVERY):
            some, findings = check_scenes(
                kind, options.seed, range(number, min(number + PRINT_EVERY, last))
            )
            counts += some
            failed |= bool(findings)
            print(*findings, f"{kind} after number {number}: {dict(counts)}", sep="\n", flush=True)
        print(f"{options.scenes} scenes with {kind}, {time.perf_counter() - begin_s:.0f} s")
    return int(failed)


if __name__ == "__main__":
    raise SystemExit(_main())
