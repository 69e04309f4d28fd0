"""Taichi on one core: velocity Verlet in steps, a ray at every triangle in every step, float64."""

from runner.bench.kernels import STEPS, fastest
from runner.bench.peers._work import GRAVITY, Answer, Peer, Work, judged

NEEDS = ("taichi",)


def solve(work: Work) -> Answer:
    import taichi as ti

    ti.init(arch=ti.cpu, cpu_max_num_threads=1, default_fp=ti.f64)
    vec = ti.types.vector(3, ti.f64)
    m, n = len(work.triangles), len(work.position)
    planes, x0, v0, x1 = (ti.Vector.field(3, ti.f64, shape) for shape in ((m, 3), n, n, n))
    shifts, bounces = ti.Vector.field(3, ti.f64, m), ti.field(ti.i32, n)
    for field, values in ((planes, work.planes), (shifts, work.shifts), (x0, work.position), (v0, work.velocity)):
        field.from_numpy(values)

    @ti.kernel
    def move(steps: ti.i32, h: ti.f64):
        g = vec(0, -GRAVITY, 0)
        for ball in range(n):
            x, v, count = x0[ball], v0[ball], 0
            for _ in range(steps):
                left, hit = h, 0
                while hit >= 0:
                    path = left * v + left * left / 2 * g
                    nearest, hit = 1.0, -1
                    for k in range(m):
                        toward = planes[k, 0].dot(path)
                        if toward < 0:
                            s = (shifts[k][0] - planes[k, 0].dot(x)) / toward
                            if -1e-9 <= s <= nearest:
                                at = x + s * path
                                a, b = planes[k, 1].dot(at) - shifts[k][1], planes[k, 2].dot(at) - shifts[k][2]
                                if a >= 0 and b >= 0 and a + b <= 1:
                                    nearest, hit = s, k
                    x += nearest * path
                    v += nearest * left * g
                    if hit >= 0:
                        v -= 2 * v.dot(planes[hit, 0]) * planes[hit, 0]
                        left *= 1 - nearest
                        count += 1
            x1[ball], bounces[ball] = x, count

    move(1, work.step)  # compiles
    ti.sync()

    def run():
        move(work.steps, work.step)
        ti.sync()

    _, seconds = fastest(run)
    return judged(work, seconds, x1.to_numpy(), int(bounces.to_numpy().sum()), STEPS)


PEERS = [Peer("taichi, a ray every step, Verlet", solve, "velocity_verlet", STEPS, within=1e-3)]
