"""Warp on the CPU, float32: velocity Verlet in steps, a ray at every triangle, or the nearest point of its mesh, in every step."""

from runner.bench.kernels import STEPS, fastest
from runner.bench.peers._work import GRAVITY, Answer, Peer, Work, judged

NEEDS = ("warp",)


def _move(work: Work, launch) -> Answer:
    """Call launch(steps, out, bounces), warmed."""
    import warp as wp

    out, bounces = wp.empty(len(work.position), dtype=wp.vec3), wp.empty(len(work.position), dtype=int)
    launch(1, out, bounces)  # compiles
    _, seconds = fastest(lambda: launch(work.steps, out, bounces))
    return judged(work, seconds, out.numpy(), int(bounces.numpy().sum()), STEPS)


def by_rays(work: Work) -> Answer:
    import warp as wp

    @wp.kernel
    def move(
        x0: wp.array(dtype=wp.vec3), v0: wp.array(dtype=wp.vec3),
        planes: wp.array2d(dtype=wp.vec3), shifts: wp.array(dtype=wp.vec3),
        steps: int, h: float, x1: wp.array(dtype=wp.vec3), bounces: wp.array(dtype=int),
    ):  # fmt: skip
        ball = wp.tid()
        x, v, g = wp.vec3(x0[ball]), wp.vec3(v0[ball]), wp.vec3(0.0, -GRAVITY, 0.0)
        count = int(0)
        for _ in range(steps):
            left, hit = float(h), int(0)
            while hit >= 0:
                path = left * v + 0.5 * left * left * g
                nearest = float(1.0)
                hit = int(-1)
                for k in range(shifts.shape[0]):
                    toward = wp.dot(planes[k, 0], path)
                    if toward < 0.0:
                        s = (shifts[k][0] - wp.dot(planes[k, 0], x)) / toward
                        if s >= -1e-3 and s <= nearest:  # of a step: float32 rounds by so much
                            at = x + s * path
                            a = wp.dot(planes[k, 1], at) - shifts[k][1]
                            b = wp.dot(planes[k, 2], at) - shifts[k][2]
                            if a >= 0.0 and b >= 0.0 and a + b <= 1.0:
                                nearest = s
                                hit = k
                x = x + nearest * path
                v = v + nearest * left * g
                if hit >= 0:
                    n = planes[hit, 0]
                    v = v - 2.0 * wp.dot(v, n) * n
                    left = left * (1.0 - nearest)
                    count = count + 1
        x1[ball] = x
        bounces[ball] = count

    given = [wp.array(a, dtype=wp.vec3) for a in (work.position, work.velocity, work.planes, work.shifts)]
    n = len(work.position)
    return _move(work, lambda steps, out, bounces: wp.launch(move, n, [*given, steps, work.step, out, bounces], device="cpu"))


def by_mesh_query(work: Work) -> Answer:
    """A ball turns round in the step in which the nearest point of the mesh is within its radius."""
    import warp as wp

    @wp.kernel
    def move(
        x0: wp.array(dtype=wp.vec3), v0: wp.array(dtype=wp.vec3), mesh: wp.uint64, radius: float,
        steps: int, h: float, x1: wp.array(dtype=wp.vec3), bounces: wp.array(dtype=int),
    ):  # fmt: skip
        ball = wp.tid()
        x, v, g = wp.vec3(x0[ball]), wp.vec3(v0[ball]), wp.vec3(0.0, -GRAVITY, 0.0)
        count = int(0)
        for _ in range(steps):
            x = x + h * v + 0.5 * h * h * g
            v = v + h * g
            near = wp.mesh_query_point_no_sign(mesh, x, radius)
            if near.result:
                off = x - wp.mesh_eval_position(mesh, near.face, near.u, near.v)
                if wp.dot(off, v) < 0.0:
                    n = wp.normalize(off)
                    v = v - 2.0 * wp.dot(v, n) * n
                    count = count + 1
        x1[ball] = x
        bounces[ball] = count

    mesh = wp.Mesh(wp.array(work.vertices, dtype=wp.vec3, device="cpu"), wp.array(work.triangles.ravel(), dtype=int, device="cpu"))
    given = [wp.array(a, dtype=wp.vec3) for a in (work.position, work.velocity)] + [mesh.id, work.radius]
    n = len(work.position)
    return _move(work, lambda steps, out, bounces: wp.launch(move, n, [*given, steps, work.step, out, bounces], device="cpu"))


PEERS = [
    Peer("warp f32, a ray every step, Verlet", by_rays, "velocity_verlet", STEPS, within=1e-2),
    Peer(
        "warp f32, mesh query every step, Verlet", by_mesh_query, "velocity_verlet", STEPS, within=0.1,
        scene="heightfield 80,000", duration=1.0,  # in more, errors grow as in chaos
    ),
]  # fmt: skip
