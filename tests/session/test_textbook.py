"""Whole runs, number by number, against an extended Kalman filter as the textbook has it.

It has every Jacobian by complex steps through equations written down here once more, one dense
covariance and Joseph's form, and shares nothing with the filter but the measurements, whose they
are, and what became of the features.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial

import numpy as np
import pytest

from scene_core.arrays import Mat, Vec
from scene_core.filter.records import Trace
from scene_core.filter.world import Mount, World
from scene_core.session import presets
from scene_core.session.edits import set_param
from scene_core.session.session import Session


def jacobian(f: Callable[[np.ndarray], np.ndarray], x: Vec) -> Mat:
    return np.stack([np.imag(f(x + 1e-30j * e)) / 1e-30 for e in np.eye(len(x))], axis=1)


def length(v: np.ndarray) -> complex:
    return np.sqrt((v * v).sum())


def angle(y: complex, x: complex) -> complex:
    turn = (x.real * y.imag - y.real * x.imag) / (x.real**2 + y.real**2)
    return np.arctan2(y.real, x.real) + 1j * turn


def rotation(q: np.ndarray) -> np.ndarray:
    a, b, c, d = q
    # fmt: off
    return np.array([[a*a + b*b - c*c - d*d, 2*(b*c - a*d), 2*(b*d + a*c)],
                     [2*(b*c + a*d), a*a - b*b + c*c - d*d, 2*(c*d - a*b)],
                     [2*(b*d - a*c), 2*(c*d + a*b), a*a - b*b - c*c + d*d]])
    # fmt: on


def composed(A: np.ndarray, B: np.ndarray) -> np.ndarray:
    (a, u), (b, v) = (A[3], A[4:]), (B[3], B[4:])
    q = np.r_[a * b - u @ v, a * v + b * u + np.cross(u, v)]
    return np.r_[A[:3] + rotation(A[3:]) @ B[:3], q]


def moved(pose: np.ndarray, u: np.ndarray) -> np.ndarray:
    a = length(u[3:])
    return composed(pose, np.r_[u[:3], np.cos(a / 2), np.sin(a / 2) / a * u[3:]])


def place(y: np.ndarray) -> np.ndarray:
    """(m, w) of a point or of one in inverse depth."""
    if len(y) == 3:
        return np.r_[y, 1.0]
    p, w, rho = y[3:]
    m = np.array([np.cos(p) * np.cos(w), np.cos(p) * np.sin(w), np.sin(p)])
    return np.r_[rho * y[:3] + m, rho]


def stretch(p: np.ndarray, k: np.ndarray) -> complex:
    r2 = (p * p).sum()
    return sum((d * r2 ** (i + 1) for i, d in enumerate(k[4:])), 1.0)


def ray(z: np.ndarray, k: np.ndarray) -> np.ndarray:
    out = (z - k[:2]) / k[2:4]
    p = out
    for _ in range(60):
        p = out / stretch(p, k)
    v = np.r_[p, 1.0]
    return v / length(v)


class Read(dict):
    """Parts of a state, and which of them an equation asks for."""

    def __init__(self, parts: dict[str, np.ndarray]) -> None:
        super().__init__(parts)
        self.names: set[str] = set()

    def __getitem__(self, name: str) -> np.ndarray:
        self.names.add(name)
        return super().__getitem__(name)


class Textbook:
    """x as named parts, and one P."""

    def __init__(self, world: World) -> None:
        self.parts = {b.name: world.gauss.mean(b.name).copy() for b in world.gauss.layout.blocks}
        self.P = world.gauss.P.copy()

    @property
    def x(self) -> Vec:
        return np.concatenate(list(self.parts.values()))

    @property
    def columns(self) -> dict[str, np.ndarray]:
        ends = np.cumsum([len(v) for v in self.parts.values()])
        return dict(zip(self.parts, np.split(np.arange(ends[-1]), ends[:-1]), strict=True))

    def linear(self, f: Callable[..., np.ndarray], noises: int = 0) -> tuple[Vec, Mat]:
        """f(parts, noise) and its dense Jacobian by x and the noise."""
        read = Read(self.parts)
        value = np.real(f(read, np.zeros(noises) + 0j))
        J, columns = np.zeros((len(value), len(self.P) + noises)), self.columns
        for name in read.names:
            by = jacobian(lambda v, i=name: f({**self.parts, i: v}, np.zeros(noises)), read[name])
            J[:, columns[name]] = by
        if noises:
            J[:, len(self.P) :] = jacobian(lambda v: f(self.parts, v), np.zeros(noises))
        return value, J

    def change(self, name: str, f: Callable[..., np.ndarray], Q: Mat | None = None) -> None:
        """One part becomes f(parts, noise), the noise of covariance Q; at the end where it is
        new."""
        Q = np.zeros((0, 0)) if Q is None else Q
        value, J = self.linear(f, len(Q))
        n, rows = len(self.P), {**self.columns, name: None}
        same = np.eye(n, n + len(Q))
        F = np.concatenate([J if at is None else same[at] for at in rows.values()])
        self.parts = {**self.parts, name: value}
        self.P = F[:, :n] @ self.P @ F[:, :n].T + F[:, n:] @ Q @ F[:, n:].T

    def normalise(self) -> None:
        for name in self.parts:
            if name.startswith("robot:") or name.endswith(":pose"):
                self.change(name, lambda m, _, i=name: np.r_[m[i][:3], m[i][3:] / length(m[i][3:])])

    def sensor(self, mount: Mount, parts: dict) -> tuple[np.ndarray, np.ndarray]:
        pose = parts[mount.pose_block] if mount.pose_block in parts else mount.pose
        k = parts[mount.calib_block] if mount.calib_block in parts else mount.sensor.calib0
        return composed(parts[f"robot:{mount.robot}"], pose), k

    def update(self, mount: Mount, found: dict[int, Vec]) -> None:
        def h(parts: dict, _: np.ndarray, label: int) -> np.ndarray:
            pose, k = self.sensor(mount, parts)
            X = place(parts[f"feature:{label}"])
            c = rotation(pose[3:]).T @ (X[:3] - X[3] * pose[:3])
            p = c[:2] / c[2]
            return k[:2] + k[2:4] * p * stretch(p, k)

        seen = [self.linear(partial(h, label=label)) for label in found]
        nu = np.concatenate([z - h for z, (h, _) in zip(found.values(), seen, strict=True)])
        H, x = np.concatenate([J for _, J in seen]), self.x
        R = np.eye(len(nu)) * vars(mount.sensor)["sd_px"] ** 2
        K = self.P @ H.T @ np.linalg.inv(H @ self.P @ H.T + R)
        A = np.eye(len(x)) - K @ H
        self.P = A @ self.P @ A.T + K @ R @ K.T
        x = x + K @ nu
        self.parts = {name: x[at] for name, at in self.columns.items()}
        self.normalise()
        self.restrict(found)

    def restrict(self, found: Iterable[int]) -> None:
        """Yaws on the circle, and no point behind its own ray."""
        for label in found:
            y = self.parts[f"feature:{label}"]
            if len(y) == 6:
                y[4] = (y[4] + np.pi) % (2.0 * np.pi) - np.pi
                y[5] = 0.001 if y[5] < 0.0 else y[5]

    def convert(self, label: int) -> None:
        name = f"feature:{label}"
        self.change(name, lambda m, _: (X := place(m[name]))[:3] / X[3])

    def start(self, label: int, mount: Mount, z: Vec, model: dict) -> None:
        def y(parts: dict, noise: np.ndarray) -> np.ndarray:
            pose, k = self.sensor(mount, parts)
            m = rotation(pose[3:]) @ ray(z + noise[:2], k)
            pitch = angle(m[2], np.sqrt(m[0] ** 2 + m[1] ** 2))
            return np.r_[pose[:3], pitch, angle(m[1], m[0]), model["rho_mean"] + noise[2]]

        sd = vars(mount.sensor)["sd_px"]
        self.change(f"feature:{label}", y, np.diag([sd, sd, model["rho_sd"]]) ** 2)

    def follow(self, trace: Trace) -> None:
        for robot, controls in trace.frame.controls.items():
            motion, name = vars(trace.start.robots[robot].motion), f"robot:{robot}"
            U = np.diag([motion["sd_position"]] * 3 + [motion["sd_angle"]] * 3) ** 2
            for control in controls:
                self.change(name, lambda m, n, i=name, u=control.u: moved(m[i], u + n), U)
            self.normalise()
        for record in trace.records:
            if record.phase == "update":
                accepted = (a for a in record.associations if a.verdict == "accepted")
                found = {a.label: a.z for a in accepted if a.z is not None}
                one_by_one = trace.start.policies.update.kind == "sequential"
                groups = [{label: z} for label, z in found.items()] if one_by_one else [found]
                for group in groups if found else ():
                    self.update(record.world.mounts[str(record.mount)], group)
                self.restrict(found)
            for event in record.events if record.phase == "manage" else ():
                assert event.kind in ("born", "converted") and event.label is not None
                if event.kind == "converted":
                    self.convert(event.label)
                    continue
                feature = record.world.features[event.label]
                landmark = vars(record.world.policies.landmark)
                self.start(event.label, record.world.mounts[feature.mount], feature.z0, landmark)


@pytest.mark.parametrize(
    ("name", "kind", "frames", "converted"),
    [
        ("cloister", "stacked", 20, 1),
        ("calibration", "stacked", 8, 0),
        ("two_robots", "stacked", 4, 0),
        ("calibration", "sequential", 4, 0),
    ],
)
def test_a_run_is_that_of_the_textbook(name: str, kind: str, frames: int, converted: int) -> None:
    """Births, updates and conversions, with a lens or a camera's pose in the state as well."""
    experiment = set_param(presets.build(name), "estimator.policies.update.kind", kind)
    session = Session(experiment, history_bytes=0)
    textbook, conversions = Textbook(session.world), 0
    for _ in range(frames):
        trace = session.advance()
        textbook.follow(trace)
        gauss = trace.world.gauss
        assert list(textbook.parts) == [b.name for b in gauss.layout.blocks]
        sd = np.sqrt(np.maximum(np.diag(gauss.P), 1e-12))
        np.testing.assert_allclose(textbook.x, gauss.x, rtol=0.0, atol=1e-10)
        np.testing.assert_allclose(
            textbook.P / np.outer(sd, sd), gauss.P / np.outer(sd, sd), rtol=0.0, atol=1e-8
        )
        conversions += sum(event.kind == "converted" for event in trace.events)
    assert conversions == converted
