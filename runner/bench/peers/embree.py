"""Embree, float32: the first triangle that a ray meets, one a ball and step, as a tracer of rays would look for contacts."""

import numpy as np

from runner.bench.kernels import fastest
from runner.bench.peers._work import Answer, Peer, Work, rms

NEEDS = ("embreex",)
RAYS, SEED = 100_000, 1


def solve(work: Work) -> Answer:
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene

    corners = work.vertices[work.triangles]
    scene = EmbreeScene()
    TriangleMesh(scene, corners.astype("f4"))
    random = np.random.default_rng(SEED)
    start = work.position[random.integers(len(work.position), size=RAYS)].astype("f4")
    ahead = random.uniform((-1, -1, -1), (1, -1, 1), (RAYS, 3)).astype("f4")  # down, so that each meets the field
    found, seconds = fastest(lambda: scene.run(start, ahead, output=True))
    # where the ray crosses the plane of the triangle that was found; one that found none has no such place
    triangle = corners[found["primID"]]
    normal = np.cross(triangle[:, 1] - triangle[:, 0], triangle[:, 2] - triangle[:, 0])
    s = np.sum((triangle[:, 0] - start) * normal, axis=1) / np.sum(ahead * normal, axis=1)
    off = np.where(found["primID"] >= 0, found["tfar"] - s, np.inf)
    return Answer(seconds, RAYS, rms(off[:, None] * ahead))


PEERS = [
    Peer("Embree f32, rays", solve, "symplectic_euler", "rays/s", within=1e-4, scene=scene, duration=1.0)
    for scene in ("heightfield 5,000", "heightfield 80,000")
]
