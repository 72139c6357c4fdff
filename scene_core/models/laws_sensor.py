"""What a sensor must obey."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scene_core.arrays import Vec
from scene_core.models.base import Sensor, completed
from scene_core.models.judge import (
    COUNT,
    DRAWS,
    Law,
    angles_of,
    first,
    judge_jacobians,
    not_batched_alike,
    not_covariance,
    not_equal,
    not_shaped,
    not_spread_like,
    own_scale,
    tried,
)


@dataclass(frozen=True)
class _Trial:
    """A sensor, and what it is tried at."""

    model: Sensor
    rng: np.random.Generator
    z: Vec
    """Measurements (COUNT, m) inside the limits."""
    n: Vec
    """What they leave open (COUNT, mn)."""

    @property
    def angles(self) -> np.ndarray:
        return angles_of(self.model.units)

    @property
    def k0(self) -> Vec:
        return np.asarray(self.model.calib0)

    @property
    def X(self) -> Vec:
        """The points (COUNT, d+1) that are measured."""
        return self.model.backproject(self.z, self.n, self.k0).X


def sensor_laws(model: Sensor, rng: np.random.Generator) -> list[Law]:
    """The laws of a sensor, ready to be tried."""
    m, d, k0 = model.measurement_size, model.space.d, np.asarray(model.calib0)
    lo, hi = np.array(model.limits).T
    # Inside the limits and off their edges; a bar's middle, or a range of zero, has no direction.
    z = lo + (hi - lo) * rng.uniform(0.08, 0.92, (COUNT, m))
    n = rng.uniform(0.0, 2.0, (COUNT, len(model.unmeasured)))
    if n.size:
        n[0] = 0.0
    if m + n.shape[-1] > d:
        # More numbers than a point can cause: only those of some point come back as they were.
        X = model.backproject(z, n, k0).X
        X[:, d] = rng.uniform(0.2, 1.5, COUNT)
        z = model.project(X, k0).h
    return tried(_Trial(model, rng, z, n), _LAWS)


def _declared(t: _Trial) -> str:
    model, m = t.model, t.model.measurement_size
    length = np.array([len(model.calib_labels)])
    return first(
        [
            not_shaped("labels", model.labels, (m,)),
            not_shaped("limits", model.limits, (m, 2)),
            not_equal("calib0's length", np.array(t.k0.shape), length),
            "" if model.pane in ("image", "polar", "bar") else f"no pane '{model.pane}'",
        ]
    )


def _projection(t: _Trial) -> str:
    X, k0, project = t.X, t.k0, t.model.project
    problems = [not_shaped("h", project(X, k0).h, t.z.shape)]
    for x in X:
        names = ("dh_by_dX", "dh_by_dk")
        scales = (np.maximum(1.0, np.abs(x)), own_scale(k0))
        h, scaled = project(x, k0).h, project(2.5 * x, k0).h
        problems += [
            judge_jacobians(names, project, (x, k0), t.angles, scales),
            not_equal("h of a multiple of X", scaled, h, t.angles),
        ]
    return first(problems)


def _finite(t: _Trial) -> str:
    d = t.model.space.d
    X = np.concatenate([np.eye(d + 1), -np.eye(d + 1)[:d], t.rng.standard_normal((9, d + 1))])
    X[:, d] = np.abs(X[:, d])
    parts = t.model.project(X, t.k0)
    if all(np.isfinite(part).all() for part in parts if part is not None):
        return ""
    return "project is not finite for points it can not see"


def _backprojection(t: _Trial) -> str:
    model, d, X = t.model, t.model.space.d, t.X
    problems = [not_equal("project(backproject(z))", model.project(X, t.k0).h, t.z, t.angles)]
    if d > 1:
        length = np.linalg.norm(X[:, :d], axis=-1)
        problems.append(not_equal("length of the ray", length, np.ones(COUNT)))
    if (X[:, d] < 0.0).any():
        problems.append("w is negative")
    names, flat = ("dX_by_dz", "dX_by_dn", "dX_by_dk"), np.zeros(d + 1, dtype=bool)
    for zi, ni in zip(t.z, t.n, strict=True):
        scales = (np.maximum(1e-2, np.abs(zi)), np.ones(len(ni)), own_scale(t.k0))
        args = (zi, ni, t.k0)
        problems.append(judge_jacobians(names, model.backproject, args, flat, scales))
    return first(problems)


def _noise(t: _Trial) -> str:
    model, z, m = t.model, t.z, t.model.measurement_size
    none, turned = np.zeros_like(z), z + 2.0 * np.pi * t.angles
    problems = [
        not_covariance("R", model.R(z), m),
        not_shaped("R", model.R(z), (COUNT, m, m)),
        not_equal("nu(h, h)", model.nu(z, z).nu, none),
        not_equal("nu after a full turn", model.nu(z, turned).nu, none),
        judge_jacobians(("dnu_by_dh", "dnu_by_dz"), model.nu, (z[0], z[1]), t.angles),
    ]
    return first([*problems, _not_difference(model, z[0], z[1])])


def _not_difference(model: Sensor, h: Vec, z: Vec) -> str:
    """Why nu does not change as z - h does, which the update and the gate take for granted."""
    by = dict(zip("hz", completed(model.nu(h, z), model.nu, h, z)[1:], strict=True))
    for name, sign in (("z", 1.0), ("h", -1.0)):
        wanted = sign * np.eye(model.measurement_size)
        if wrong := not_equal(f"dnu_by_d{name}", np.asarray(by[name]), wanted, tol=1e-6):
            return (
                f"{wrong}: it has to be {'I' if sign > 0 else '-I'}, because H and R are those of "
                "h and z; return nu = z - h, angles wrapped, and put what bends it into project"
            )
    return ""


def _visible(t: _Trial) -> str:
    model, X, pose = t.model, t.X, t.model.space.identity()
    fault = model.visibility(t.z, X, pose, np.tile(pose, (COUNT, 1)), X)
    if np.shape(fault) != (COUNT,) or np.asarray(fault).dtype.kind not in "iu":
        return "visibility does not return whole numbers, one per point"
    return not_shaped("the selection score", model.selection_score(model.R(t.z)), (COUNT,))


def _noisy(t: _Trial) -> str:
    X = np.tile(t.X[1], (DRAWS, 1))
    h = t.model.project(X[0], t.k0).h
    return not_spread_like(t.model.h_noisy(X, t.k0, t.rng), h, t.model.R(h), t.angles)


def _batched(t: _Trial) -> str:
    model, k0 = t.model, t.k0
    return first(
        [
            not_batched_alike("project", model.project, (t.X, k0), (True, False)),
            not_batched_alike("backproject", model.backproject, (t.z, t.n, k0), (1, 1, 0)),
        ]
    )


_LAWS = (
    ("labels, limits and calibration have matching lengths", _declared),
    ("project has the right Jacobians and is of degree zero", _projection),
    ("project stays finite everywhere", _finite),
    ("backproject inverts project, with unit rays and the right Jacobians", _backprojection),
    ("R is a covariance, nu is z - h, angles wrap", _noise),
    ("visibility returns fault flags", _visible),
    ("h_noisy spreads as R says", _noisy),
    ("batched is the same as one by one", _batched),
)
