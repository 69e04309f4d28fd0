"""The exact solver against heyoka, an integrator by Taylor series with its own search for events."""

import numpy as np
import pytest

from sim.forces import Drag, Spring, Uniform
from sim.shapes import Plane
from sim.simulate import Scene
from tests.sim.helpers import balls, swept

heyoka = pytest.importorskip("heyoka")

MASS, R, E, DAMPING = 1.3, 0.06, 0.97, 0.05
STIFFNESS, CENTER, COEFFICIENT = 3.0, (0.3, -0.2, 0.5), 0.4
AIR = {"air": Drag(COEFFICIENT)}
WELL = {"well": Spring(STIFFNESS, center=CENTER)}
SLAB = {"slab": Uniform(direction=(0, 1, 2), magnitude=4.0, region={"x": (0.4, 1.5)})}
FLOOR = {"floor": Plane()}


def peer(scene, x, v, times):
    """Positions (times, 3) m."""
    place = heyoka.make_vars("x", "y", "z")
    speed = heyoka.make_vars("u", "v", "w")
    push, w2, b = np.array(scene.gravity), 0.0, 0.0
    slab = np.zeros(3)
    for field in scene.forces.values():
        f0, k, c = field.affine()
        if field.region:
            slab, faces = f0 / MASS, field.region["x"]
        else:
            push, w2, b = push + f0 / MASS, w2 + k / MASS, b + c / MASS
    on = heyoka.par[0]
    system = list(zip(place, speed))
    system += [(speed[k], push[k] + on * slab[k] - w2 * place[k] - b * speed[k]) for k in range(3)]

    def bounce(ta, _):
        ta.state[[3, 5]] *= 1 - DAMPING
        ta.state[4] *= -E
        return True

    def cross(face, low):
        def callback(ta, sign):
            ta.pars[0] = 1.0 if (sign > 0) == low else 0.0
            return True

        return heyoka.t_event(place[0] - face, callback=callback)

    events = [cross(faces[0], True), cross(faces[1], False)] if slab.any() else []
    if scene.surfaces:
        events.append(heyoka.t_event(place[1] - R, callback=bounce, direction=heyoka.event_direction.negative))
    start = [*x, *v]
    pars = [1.0 if faces[0] < x[0] < faces[1] else 0.0] if slab.any() else []
    # the least tolerance, so that its steps round only
    ta = heyoka.taylor_adaptive(system, start, pars=pars, t_events=events, tol=1e-18)
    out = np.empty((len(times), 3))
    for i, t in enumerate(times):
        ta.propagate_until(t)
        out[i] = ta.state[:3]
    return out


@pytest.mark.parametrize("surfaces", [{}, FLOOR], ids=["free", "floor"])
@pytest.mark.parametrize(
    "forces", [{}, AIR, WELL, AIR | WELL, SLAB, SLAB | AIR | WELL], ids=["gravity", "drag", "spring", "both", "region", "all"]
)
def test_exact_is_what_heyoka_finds(forces, surfaces):
    scene = Scene(surfaces=surfaces, forces=forces, restitution=E, damping=DAMPING)
    x, v = (0.1, 1.0, 0.3), (0.7, 0.4, -0.4)
    flight = swept(scene, balls(x, v, mass=MASS, radius=R), duration=10.0, every=0.1)
    wanted = peer(scene, x, v, flight.trajectory.time)
    assert bool(surfaces) == bool(len(flight.bounces))
    # heyoka rounds by 1e-16 of up to 500 m at each of some hundred steps
    assert np.abs(flight.trajectory.position[:, 0] - wanted).max() < 1e-11
