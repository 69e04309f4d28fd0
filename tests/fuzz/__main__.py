"""A long fuzz: `python -m tests.fuzz TARGET --seconds 600 [--seed 1]`, or with coverage as its guide `--atheris` (extra `fuzz`).

Ends at the first input that does what it must not, which it keeps in found-TARGET; else tells how many it tried.
atheris keeps what leads to new code in learnt-TARGET/, and goes on from there.
"""

from __future__ import annotations

import argparse
import os
import signal
import sys
import tempfile
import time
import warnings
from pathlib import Path
from random import Random

from tests.fuzz import mutation

LONGEST = 5  # s of processor time that an input may take; alone they take milliseconds


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("target")
    parser.add_argument("--seconds", type=float, default=600)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--atheris", action="store_true")
    options = parser.parse_args()
    if options.atheris:
        import atheris

        with atheris.instrument_imports(include=["runner", "sim"]):
            from tests.fuzz.targets import TARGETS
    else:
        from tests.fuzz.targets import TARGETS
    keep, corpus = Path(f"found-{options.target}").resolve(), mutation.seeds(options.target)
    tried, learnt = watched(TARGETS[options.target], keep), Path(f"learnt-{options.target}").resolve()
    if options.atheris:
        learnt.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        warnings.simplefilter("error")
        if options.atheris:
            for number, data in enumerate(corpus):
                (learnt / str(number)).write_bytes(data)
            arguments = [sys.argv[0], f"-max_total_time={options.seconds:.0f}", f"-seed={options.seed + 1}", "-rss_limit_mb=2000"]
            atheris.Setup([*arguments, "-print_final_stats=1", "-verbosity=1", str(learnt)], tried)
            atheris.Fuzz()
            return
        random, count, end = Random(options.seed), 0, time.monotonic() + options.seconds
        while time.monotonic() < end:
            tried(mutation.mutated(random, corpus))
            count += 1
        print(f"{options.target}: {count:,} inputs in {options.seconds:.0f} s, {time.process_time():.0f} s of processor time")


def watched(target, keep: Path):
    """`target`, keeping the input that fails in the file `keep`, or that takes too long."""

    def late(*_):
        raise TimeoutError(f"more than {LONGEST} s")

    signal.signal(signal.SIGVTALRM, late)

    def tried(data: bytes) -> None:
        signal.setitimer(signal.ITIMER_VIRTUAL, LONGEST)
        try:
            target(data)
        except BaseException:
            keep.write_bytes(data)
            raise
        finally:
            signal.setitimer(signal.ITIMER_VIRTUAL, 0)

    return tried


if __name__ == "__main__":
    main()
