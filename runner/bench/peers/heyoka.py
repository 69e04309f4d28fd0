"""heyoka: Taylor series of a fall, to the roundings of a float, with its own search for events, in a box that it knows."""

from functools import partial

import numpy as np

from runner.bench.kernels import EVENTS, fastest
from runner.bench.peers._work import GRAVITY, Answer, Peer, Work, judged

NEEDS = ("heyoka",)


def solve(lanes: int, work: Work) -> Answer:
    """One ball after the other, or with `lanes` above 1 so many side by side, padded with copies of the last."""
    import heyoka as hy

    place, speed = hy.make_vars("x", "y", "z"), hy.make_vars("u", "v", "w")
    system = [*zip(place, speed), *((v, hy.expression(-GRAVITY if k == 1 else 0.0)) for k, v in enumerate(speed))]
    count = 0

    def turn(axis: int):
        def scalar(ta, _):
            nonlocal count
            ta.state[3 + axis] *= -1
            count += 1
            return True

        def side_by_side(ta, _, lane):
            nonlocal count
            ta.state[3 + axis, lane] *= -1
            count += first + lane < n
            return True

        return scalar if lanes == 1 else side_by_side

    kind = hy.t_event if lanes == 1 else hy.t_event_batch
    walls = [
        kind(place[k] - sign * work.half, callback=turn(k), direction=way)
        for k in range(3)
        for sign, way in ((1, hy.event_direction.positive), (-1, hy.event_direction.negative))
    ]
    start = np.hstack([work.position, work.velocity])
    n, first = len(start), 0
    start = np.vstack([start, np.repeat(start[-1:], -n % lanes, axis=0)])
    if lanes == 1:
        ta = hy.taylor_adaptive(system, start[0], t_events=walls)
    else:
        ta = hy.taylor_adaptive_batch(system, start[:lanes].T.copy(), t_events=walls)
    end = np.empty((len(start), 3))

    def run():
        nonlocal first, count
        count = 0
        for first in range(0, len(start), lanes):
            ta.state[:] = start[first : first + lanes].T.reshape(ta.state.shape)
            if lanes == 1:
                ta.time = 0.0
                ta.reset_cooldowns()
            else:
                ta.set_time(0.0)
                for lane in range(lanes):
                    ta.reset_cooldowns(lane)
            ta.propagate_until(work.duration)
            end[first : first + lanes] = ta.state[:3].reshape(3, lanes).T

    _, seconds = fastest(run)
    return judged(work, seconds, end[:n], count, EVENTS)


PEERS = [
    Peer("heyoka, this box only", partial(solve, 1), "exact", EVENTS, within=1e-11),
    Peer("heyoka, this box only, 40 s", partial(solve, 1), "exact", EVENTS, within=1e-11, duration=40.0),
    Peer("heyoka, this box only, 300 s", partial(solve, 1), "exact", EVENTS, within=1e-10, duration=300.0, balls=100),
    Peer("heyoka, 4 balls side by side, this box only", partial(solve, 4), "exact", EVENTS, within=1e-11),
]
