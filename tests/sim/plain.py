"""A slow, plain simulator written from the formulas alone: what the compiled one is held against."""

from __future__ import annotations

import numpy as np

from sim import shapes
from sim.forces import Drag, Spring, Uniform


def acceleration(scene, mass):
    """a(t, x, v) in m/s^2: gravity and every field that acts at age t and place x, over the mass."""

    def force(field, x, v):
        match field:
            case Uniform():
                return field.magnitude * np.array(field.direction) / np.linalg.norm(field.direction)
            case Drag():
                return -field.coefficient * v
            case Spring():
                return -field.stiffness * (x - np.array(field.center))

    def acts(field, t, x):
        inside = all(low < x["xyz".index(axis)] < high for axis, (low, high) in field.region.items())
        return inside and (field.until is None or t < field.until)

    def a(t, x, v):
        return scene.gravity + sum((force(f, x, v) / mass for f in scene.forces.values() if acts(f, t, x)), np.zeros(3))

    def rates(t, x):
        fields = [f for f in scene.forces.values() if acts(f, t, x)]
        stiffness = sum(f.stiffness for f in fields if isinstance(f, Spring))
        return stiffness / mass, sum(f.coefficient for f in fields if isinstance(f, Drag)) / mass

    a.rates = rates  # w2, b: what a loses with each metre and each m/s
    return a


def explicit_euler(h, t, x, v, a):
    return x + h * v, v + h * a(t, x, v)


def symplectic_euler(h, t, x, v, a):
    v = v + h * a(t, x, v)
    return x + h * v, v


def symplectic_euler_drift_first(h, t, x, v, a):
    x = x + h * v
    return x, v + h * a(t, x, v)


def rk4_original(h, t, x, v, a):
    a1 = a(t, x, v)
    k1 = h * v
    a2 = a(t + h / 2, x + k1 / 2, v + h * a1 / 2)
    k2 = h * (v + h * a2 / 2)
    a3 = a(t + h / 2, x + k2 / 2, v + h * a2 / 2)
    k3 = h * (v + h * a3 / 2)
    a4 = a(t + h, x + k3, v + h * a3)
    k4 = h * (v + h * a4)
    return x + (k1 + 2 * k2 + 2 * k3 + k4) / 6, v + h * (a1 + 2 * a2 + 2 * a3 + a4) / 6


def implicit_euler(h, t, x, v, a):
    w2, b = a.rates(t + h, x)
    v = (v + h * a(t + h, x, 0 * v)) / (1 + h * b + h * h * w2)
    return x + h * v, v


def velocity_verlet(h, t, x, v, a):
    x1 = x + h * v + h * h / 2 * a(t, x, v)
    _, b = a.rates(t + h, x1)
    return x1, (v + h / 2 * (a(t, x, v) + a(t + h, x1, 0 * v))) / (1 + h / 2 * b)


def rk4(h, t, x, v, a):
    def f(c, k):
        return np.array([(v + c * h * k[1]), a(t + c * h, x + c * h * k[0], v + c * h * k[1])])

    k1 = f(0, np.zeros((2, 3)))
    k2 = f(1 / 2, k1)
    k3 = f(1 / 2, k2)
    k4 = f(1, k3)
    return np.array([x, v]) + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def pefrl(h, t, x, v, a):
    xi, lam, chi = 0.1786178958448091, -0.2123418310626054, -0.06626458266981849
    drifts = [xi, chi, 1 - 2 * (chi + xi), chi, xi]
    kicks = [(1 - 2 * lam) / 2, lam, lam, (1 - 2 * lam) / 2, 0.0]
    for drift, kick in zip(drifts, kicks):
        t, x = t + drift * h, x + drift * h * v
        _, b = a.rates(t, x)
        z = b * kick * h
        # the diagonal Pade approximant (2, 2) of exp(-z), and what it leaves of the push
        v = ((1 - z / 2 + z * z / 12) * v + kick * h * a(t, x, 0 * v)) / (1 + z / 2 + z * z / 12)
    return x, v


METHODS = (explicit_euler, symplectic_euler, symplectic_euler_drift_first, rk4_original)
METHODS = {f.__name__: f for f in (*METHODS, implicit_euler, velocity_verlet, rk4, pefrl)}


class Walls:
    """The surfaces of a scene as planes and triangles, and rays against them."""

    def __init__(self, scene):
        self.planes, soup, self.two_sided, self.surface = [], [], [], []
        for number, shape in enumerate(scene.surfaces.values()):
            if isinstance(shape, shapes.Plane):
                normal = np.array(shape.normal) / np.linalg.norm(shape.normal)
                self.planes.append((np.array(shape.point), normal, number))
                continue
            vertices, triangles = shape.mesh()
            soup.append(vertices[triangles])
            self.two_sided += [shape.two_sided] * len(triangles)
            self.surface += [number] * len(triangles)
        self.a, self.b, self.c = np.concatenate([np.zeros((0, 3, 3)), *soup]).transpose(1, 0, 2)
        self.two_sided, self.surface = np.array(self.two_sided, bool), np.array(self.surface, int)

    def met(self, x, heading):
        """(distance, normal facing x, surface) wherever the ray x + s heading, s >= 0, meets a side that can be hit.

        Triangles by Moeller and Trumbore 1997, doi:10.1080/10867651.1997.10487468.
        """
        found = []
        for point, normal, surface in self.planes:
            if normal @ (x - point) >= 0 > normal @ heading:
                found.append((normal @ (point - x) / (normal @ heading), normal, surface))
        if not len(self.a):
            return found
        e1, e2, s = self.b - self.a, self.c - self.a, x - self.a
        p, q = np.cross(heading, e2), np.cross(s, e1)
        determinant = np.sum(e1 * p, axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            u, v = np.sum(s * p, axis=1) / determinant, q @ heading / determinant
            distance = np.sum(e2 * q, axis=1) / determinant
        faced = (determinant > 0) | self.two_sided & (determinant < 0)
        for k in np.flatnonzero(faced & (u >= 0) & (v >= 0) & (u + v <= 1) & (distance >= 0)):
            normal = np.cross(e1[k], e2[k])
            normal *= -np.sign(normal @ heading) / np.linalg.norm(normal)
            found.append((distance[k], normal, self.surface[k]))
        return found

    def first_hit(self, x, v, radius, h):
        """(delay, normal, surface) of the original's rule within a step h, or None."""
        speed = np.linalg.norm(v)
        if speed == 0:
            return None
        heading = v / speed
        hits = [(d - radius / abs(n @ heading), n, surface) for d, n, surface in self.met(x, heading)]
        hits = [hit for hit in hits if 0 <= hit[0] <= speed * h]
        if not hits:
            return None
        distance, normal, surface = min(hits, key=lambda hit: hit[0])
        return distance / speed, normal, surface

    def crossed(self, x0, x1):
        """How many faces a centre passes through on its straight way."""
        return sum(s < 1 for s, _, _ in self.met(x0, x1 - x0))


class Flight:
    """Ball i of `balls`: its states at `times` (NaN where it is not alive), its impacts, the faces it passed."""

    def __init__(self, scene, balls, i, method, h, times):
        self.a, self.step, self.walls = acceleration(scene, balls.mass), METHODS[method], Walls(scene)
        self.radius, self.damping = balls.radius, scene.damping
        mass_law = (scene.wall_mass - balls.mass) / (scene.wall_mass + balls.mass)
        self.e = mass_law if scene.restitution is None else scene.restitution
        self.h, self.grid = h, [(balls.position[i], balls.velocity[i])]
        self.bounces, self.crossed = [], 0  # (age, surface, position, normal, velocity before, velocity after)

        ages = times - balls.released[i]
        end = min(ages[-1], balls.lifetime)
        for n in range(self.whole(end)):
            self.grid.append(self.hop(h, n * h, *self.grid[-1], keep=True))
        self.at_end = self.at(end, keep=True)
        alive = (ages > -1e-12) & (ages < balls.lifetime - 1e-12)  # times are multiples of 1e-6 here
        states = [self.at(max(age, 0.0)) if is_alive else np.full((2, 3), np.nan) for age, is_alive in zip(ages, alive)]
        self.position, self.velocity = np.array(states).transpose(1, 0, 2)

    def whole(self, age):
        return int(np.floor(age / self.h + 1e-9))

    def at(self, age, keep=False):
        """The state at an age between steps: by a shorter step, that leaves no trace unless the flight ends with it."""
        n = self.whole(age)
        rest = age - n * self.h
        return self.hop(rest, n * self.h, *self.grid[n], keep) if rest > 1e-12 else self.grid[n]

    def hop(self, h, t, x, v, keep):
        hit = self.walls.first_hit(x, v, self.radius, h) if len(self.walls.a) or self.walls.planes else None
        if hit is None:
            x1, v1 = self.step(h, t, x, v, self.a)
            stops = [x, x1]
        else:
            delay, n, surface = hit
            touch = x + delay * v
            vn = (v @ n) * n
            after = (1 - self.damping) * (v - vn) - self.e * vn
            x1, v1 = touch + (h - delay) * after, after + h * self.a(t, x, v)
            stops = [x, touch, x1]
            if keep:
                self.bounces.append((t + delay, surface, touch, n, v, after))
        if keep:
            self.crossed += sum(self.walls.crossed(p, q) for p, q in zip(stops, stops[1:]))
        return x1, v1
