"""scipy's solve_ivp with events: DOP853 from wall to wall, in a box that it knows."""

import numpy as np

from runner.bench.kernels import EVENTS, fastest
from runner.bench.peers._work import GRAVITY, Answer, Peer, Work, judged

NEEDS = ("scipy",)


def solve(work: Work) -> Answer:
    from scipy.integrate import solve_ivp

    def fall(_, s):
        return s[3], s[4], s[5], 0.0, -GRAVITY, 0.0

    def wall(axis, side):
        def distance(_, s):
            return side * s[axis] - work.half

        distance.terminal, distance.direction = True, 1
        return distance

    walls = [wall(axis, side) for axis in range(3) for side in (1, -1)]
    end = np.empty((len(work.position), 3))

    def run():
        bounces = 0
        for ball, s in enumerate(np.hstack([work.position, work.velocity])):
            t = 0.0
            while True:
                flight = solve_ivp(fall, (t, work.duration), s, "DOP853", events=walls, rtol=1e-12, atol=1e-12)
                t, s = flight.t[-1], flight.y[:, -1]
                if flight.status != 1:
                    break
                hit = next(k for k, times in enumerate(flight.t_events) if len(times))
                s[3 + hit // 2] *= -1
                bounces += 1
            end[ball] = s[:3]
        return bounces

    bounces, seconds = fastest(run)
    return judged(work, seconds, end, bounces, EVENTS)


PEERS = [Peer("scipy, DOP853 with events, this box only", solve, "exact", EVENTS, within=1e-8, balls=10)]
