"""MuJoCo: spheres that slide between six planes, their contacts stiff springs, in its own loop over balls and steps."""

import numpy as np

from runner.bench.kernels import STEPS, fastest
from runner.bench.peers._work import GRAVITY, Answer, Peer, Work, judged

NEEDS = ("mujoco",)

# contacts without friction or loss: the springs as stiff as a step of 1 ms follows
MODEL = """
<mujoco>
  <option timestep="{step}" gravity="0 -{gravity} 0"/>
  <default><geom condim="1" solref="-{stiffness} 0" solimp="0.95 0.95 0.001"/></default>
  <worldbody>
    {walls}
    <body>
      <joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/><joint type="slide" axis="0 0 1"/>
      <geom type="sphere" size="{radius}" mass="1"/>
    </body>
  </worldbody>
</mujoco>
"""
STIFFNESS = 1e5  # 1/s^2


def solve(work: Work) -> Answer:
    import mujoco
    from mujoco import rollout

    half = work.half + work.radius
    walls = [f'<geom type="plane" size="0 0 1" pos="{_row(-half * n)}" zaxis="{_row(n)}"/>' for n in (*np.eye(3), *-np.eye(3))]
    model = mujoco.MjModel.from_xml_string(
        MODEL.format(step=work.step, gravity=GRAVITY, stiffness=STIFFNESS, radius=work.radius, walls="\n    ".join(walls))
    )
    data = mujoco.MjData(model)
    start = np.zeros((len(work.position), mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)))
    start[:, 1:4], start[:, 4:7] = work.position, work.velocity
    (states, _), seconds = fastest(lambda: rollout.rollout(model, data, start, nstep=work.steps))
    place = states[:, :, 1:4]
    touching = np.abs(place) > work.half
    bounces = np.count_nonzero(touching[:, 1:] & ~touching[:, :-1])
    return judged(work, seconds, place[:, -1], int(bounces), STEPS)


def _row(vector: np.ndarray) -> str:
    return " ".join(map(str, vector))


PEERS = [Peer("MuJoCo, six planes", solve, "symplectic_euler", STEPS, within=2.0, balls=100)]
