"""A long fuzz: `python -m tests.fuzz TARGET --seconds 600 [--seed 1]`, or with coverage as its guide `--atheris` (extra `fuzz`).

The seconds are of processor time, with atheris by the clock.

Ends at the first input that does what it must not, which it keeps in found-TARGET; else tells how many it tried.
atheris keeps what leads to new code in learnt-TARGET/, and goes on from there.
"""

from __future__ import annotations

import argparse
import gc
import os
import sys
import tempfile
import time
import warnings
from pathlib import Path
from random import Random

from tests.fuzz import mutation
from tests.fuzz.watch import Watched, memory

TOLD = 60  # s between two lines on how far it is


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("target")
    parser.add_argument("--seconds", type=float, default=600)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--atheris", action="store_true")
    options = parser.parse_args()
    sys.dont_write_bytecode = True
    if options.atheris:
        import atheris

        with atheris.instrument_imports(include=["runner", "sim", "ruamel", "trimesh.exchange"]):
            import trimesh  # noqa: F401 - else meshfile imports it later, without its coverage

            from tests.fuzz import targets
    else:
        from tests.fuzz import targets
    keep, learnt = Path(f"found-{options.target}").resolve(), Path(f"learnt-{options.target}").resolve()
    if options.atheris:
        learnt.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        targets.prepare()
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", DeprecationWarning)  # Python does not tell users of them
        target = Watched(targets.TARGETS[options.target])
        told = time.monotonic()

        def tried(data: bytes) -> None:
            nonlocal told
            try:
                target(data)
            except BaseException:
                keep.write_bytes(data)
                raise
            if time.monotonic() > told + TOLD:
                told = time.monotonic()
                tell()

        def tell() -> None:
            print(
                f"{options.target}: {target.inputs:,} inputs in {time.process_time():.0f} s of processor time; the slowest took "
                f"{target.longest:.2f} s, {target.slowest[:200]!r}; {memory() // 1000} MB",
                flush=True,
            )

        for data in mutation.seeds(options.target):
            tried(data)
        gc.freeze()  # the libraries' own: to look through it takes ten times as long as a mesh
        if options.atheris:
            for number, data in enumerate(mutation.seeds(options.target)):
                (learnt / str(number)).write_bytes(data)

            def changed(data: bytes, most: int, seed: int) -> bytes:
                random = Random(seed)
                if random.random() < 0.4:
                    return atheris.Mutate(data, most)
                return mutation.mutated(random, options.target, data)[:most]

            arguments = [sys.argv[0], f"-max_total_time={options.seconds:.0f}", f"-seed={options.seed + 1}", "-rss_limit_mb=2000"]
            arguments += [f"-max_len={mutation.LONGEST}", "-print_final_stats=1", "-verbosity=1", str(learnt)]
            atheris.Setup(arguments, tried, custom_mutator=changed)
            atheris.Fuzz()
            return
        random = Random(options.seed)
        while time.process_time() < options.seconds:
            tried(mutation.mutated(random, options.target))
        tell()


if __name__ == "__main__":
    main()
