"""A stereo camera and measured body rates in a room with a motion capture system: Starry Night.

Source: T. Barfoot, University of Toronto, course AER1513, data set 3.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.io import loadmat
from scipy.io.matlab import MatReadError

from scene_core.arrays import Mat, Vec, frozen
from scene_core.filter.ports import SourceError
from scene_core.geometry import quaternion
from scene_core.sources.recorded import Log, Logged, fixed
from scene_core.sources.tables import fingerprint

SHAPES: Mapping[str, tuple[int | str, ...]] = {
    "t": (1, "K"),
    **{"theta_vk_i": (3, "K"), "r_i_vk_i": (3, "K")},
    **{"w_vk_vk_i": (3, "K"), "v_vk_vk_i": (3, "K")},
    **{"rho_i_pj_i": (3, "L"), "y_k_j": (4, "K", "L")},
    **{"C_c_v": (3, 3), "rho_v_c_v": (3, 1)},
    **dict.fromkeys(("fu", "fv", "cu", "cv", "b"), (1, 1)),
}
"""Arrays of the file; K frames, L landmarks."""
UNSEEN = -1.0
"""Where a landmark was not seen."""


@dataclass(frozen=True)
class StarryNight(Logged):
    """Pixels (uL, vL, uR, vR) of identified landmarks, velocity and turn rate in the body.

    Every frame comes with the rates held since the one before: the mean of the samples at its two
    ends. The true path and landmarks are those of the motion capture system.
    """

    path: str
    """The file dataset3.mat."""
    robot: str = "robot"
    """The robot's name."""
    mount: str = "stereo"
    """The sensor's name."""

    @property
    def camera(self) -> Mapping[str, float]:
        """fu, fv, cu, cv [px] and the baseline b [m]."""
        return {name: self._arrays()[name].item() for name in ("fu", "fv", "cu", "cv", "b")}

    @property
    def camera_pose(self) -> Vec:
        """(7,) pose of the left camera in the vehicle: p_c = C (p_v - rho)."""
        a = self._arrays()
        q = quaternion.from_matrix(a["C_c_v"].T)
        return frozen(np.concatenate([a["rho_v_c_v"][:, 0], q]))

    def _arrays(self) -> Mapping[str, np.ndarray]:
        return _read(self.path, fingerprint(self.path))

    def _log(self) -> Log:
        return _log(self.path, fingerprint(self.path))


@lru_cache(maxsize=2)
def _read(path: str, _: tuple) -> Mapping[str, np.ndarray]:
    """The arrays of the file. Raises SourceError for what is missing, misshapen or not finite."""
    try:
        arrays = loadmat(path)
    except (MatReadError, ValueError, NotImplementedError, OSError) as e:
        raise SourceError(f"{path} is no MATLAB file that can be read: give dataset3.mat") from e
    sizes: dict[str, int] = {}
    for name, shape in SHAPES.items():
        found = arrays.get(name)
        words = " x ".join(str(size) for size in shape)
        if not isinstance(found, np.ndarray) or found.dtype.kind not in "fiu":
            raise SourceError(f"{path} has no array of numbers '{name}' ({words})")
        wanted = [
            size if isinstance(size, int) else sizes.setdefault(size, found.shape[axis])
            for axis, size in enumerate(shape)
            if axis < found.ndim
        ]
        if list(found.shape) != wanted or found.ndim != len(shape):
            raise SourceError(
                f"{path}: '{name}' is {' x '.join(map(str, found.shape))}, expected {words} "
                "(K frames, L landmarks, the same for all arrays)"
            )
        bad = np.argwhere(~np.isfinite(found))
        if len(bad):
            at = ", ".join(str(i + 1) for i in bad[0])
            raise SourceError(f"{path}: '{name}' is not finite at ({at}): correct or remove it")
    return {name: np.asarray(arrays[name], dtype=np.float64) for name in SHAPES}


@lru_cache(maxsize=2)
def _log(path: str, key: tuple) -> Log:
    a = _read(path, key)
    t = a["t"][0]
    back = np.flatnonzero(np.diff(t) <= 0.0)
    if len(back):
        k = int(back[0]) + 2
        raise SourceError(f"{path}: 't' does not grow at its element {k}: sort the recording")
    y = np.moveaxis(a["y_k_j"], 0, -1)
    seen = (y != UNSEEN).all(axis=-1)
    names = np.arange(1, y.shape[1] + 1)
    q = quaternion.from_rotation_vector(a["theta_vk_i"].T)[0]
    return Log(
        times=frozen(t - t[0]),
        z=tuple(frozen(z[s]) for z, s in zip(y, seen, strict=True)),
        ids=tuple(fixed(names[s]) for s in seen),
        labels=("vx", "vy", "vz", "wx", "wy", "wz"),
        u=frozen(_held(np.concatenate([a["v_vk_vk_i"], a["w_vk_vk_i"]]).T)),
        poses=frozen(np.concatenate([a["r_i_vk_i"].T, q], axis=1)),
        points=frozen(a["rho_i_pj_i"].T),
        point_ids=fixed(names),
    )


def _held(rates: Mat) -> Mat:
    """(K, 6) the mean of every sample and the one before; the first has none before."""
    return np.concatenate([rates[:1], 0.5 * (rates[:-1] + rates[1:])])
