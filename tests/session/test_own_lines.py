"""A straight line of the user's own, written for one at a time, runs like a built-in one."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from scene_core.filter.policies import Policies
from scene_core.models import guard, registry
from scene_core.models.library import Library
from scene_core.models.plugins import UserModel, load_file
from scene_core.session import presets
from scene_core.session.commands import SwapModel
from scene_core.session.session import Session

ALONE = '''
from dataclasses import dataclass

import numpy as np

from scene_core.geometry.spaces import THREE_D
from scene_core.models.base import FeatureModel, Glyphs, Initialised, Primitive, Redefined
from scene_core.params import param


@dataclass(frozen=True)
class TwoPoints(FeatureModel):
    """Two homogeneous points, h = m + rho t of either end: one line at a time."""

    name, space, shape = "two points", THREE_D, "segment"
    state_labels = ("h1x", "h1y", "h1z", "rho1", "h2x", "h2y", "h2z", "rho2")
    state_units = ("", "", "", "1/m", "", "", "", "1/m")
    unmeasured = ("rho",)
    rho_mean: float = param(0.1, unit="1/m", lo=1e-6, hi=100.0)
    rho_sd: float = param(0.5, unit="1/m", lo=1e-6, hi=100.0)

    def prior(self):
        return np.full(2, self.rho_mean), self.rho_sd**2 * np.eye(2)

    def initialise(self, xws, X):
        (m1, m2) = (THREE_D.to_world(xws, one).X for one in (X[:4], X[4:]))
        return Initialised(np.array([*m1, *m2]))

    def primitive(self, y):
        h1x, h1y, h1z, rho1, h2x, h2y, h2z, rho2 = y
        return Primitive(np.array([h1x, h1y, h1z, rho1, h2x, h2y, h2z, rho2]))

    def redefine(self, y, xpdef):
        first, second = (THREE_D.to_local(xpdef, one) for one in (y[:4], y[4:]))
        by_y = np.block([[first.by_X, np.zeros((4, 4))], [np.zeros((4, 4)), second.by_X]])
        return Redefined(
            np.array([*first.X, *second.X]), by_y, np.concatenate([first.by_xp, second.by_xp])
        )

    def ends(self, y, t):
        return np.array([*(y[:4] + t[0] * (y[4:] - y[:4])), *(y[:4] + t[1] * (y[4:] - y[:4]))])

    def along(self, y, origin, rays):
        near = y[:3] - y[3] * origin
        step = y[4:7] - y[7] * origin - near
        plane = np.cross(near, step)
        places = []
        for ray in rays:
            across = np.cross(ray, plane)
            with np.errstate(divide="ignore", invalid="ignore"):
                places.append(-(across @ near) / (across @ step))
        return np.array(places)

    def graphics(self, y, Pyy):
        ends = np.array([y[:3] / max(y[3], 0.05), y[4:7] / max(y[7], 0.05)])
        return Glyphs(ends.mean(axis=0), np.eye(3) * np.trace(Pyy), ends)

    def ready(self, y, Pyy, xws):
        return bool(y[3] > 1e9)
'''
ENDS = ALONE[ALONE.index("    def ends") : ALONE.index("    def along")]
BATCHED = """    def ends(self, y, t):
        first, step = y[..., :4], y[..., 4:] - y[..., :4]
        return np.concatenate([first + t[..., :1] * step, first + t[..., 1:] * step], axis=-1)

"""
LINE = "estimator.policies.line"


@pytest.fixture
def folder(tmp_path: Path) -> Iterator[Path]:
    yield tmp_path
    registry.add(registry.Added())


def loaded(folder: Path, text: str = ALONE) -> UserModel:
    (folder / "lines.py").write_text(text, encoding="utf-8")
    (model,) = load_file(folder / "lines.py").models
    return model


def test_every_function_for_one_line_is_found_out_and_the_report_says_so(folder: Path) -> None:
    model = loaded(folder)
    assert model.problem == "" and model.cls is not None and model.report is not None
    alone = {"initialise", "primitive", "redefine", "ends", "along", "graphics", "ready"}
    assert guard.unbatched(model.cls) == alone
    assert f"unbatched: {', '.join(sorted(alone))}, called once for every feature" in (
        model.report.remarks
    )


def test_a_function_for_many_lines_is_left_alone(folder: Path) -> None:
    model = loaded(folder, ALONE.replace(ENDS, BATCHED))
    assert model.problem == "" and model.cls is not None
    assert guard.unbatched(model.cls) == {
        *("initialise", "primitive", "redefine", "along", "graphics", "ready")
    }


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (ENDS.replace("*(y[:4] + t[1]", "*(y[4:] + t[1]"), "ends and along tell the same places"),
        ("    def ends(self, y, t):\n        return y[:4]\n\n", "ends has shape (4,), not (8,)"),
        ("    def ends(self, y, t):\n        return y * np.nan\n\n", "ends is not finite"),
        ("", "raised NotImplementedError: two points is no line"),
    ],
)
def test_what_is_wrong_with_a_line_is_named(folder: Path, wrong: str, words: str) -> None:
    model = loaded(folder, ALONE.replace(ENDS, wrong))
    assert model.problem.startswith("lines.py, line 12: 'two points' does not conform: ")
    assert words in model.problem and "\n" not in model.problem


def test_a_scenario_runs_with_it_as_with_the_built_in_one(folder: Path) -> None:
    """Round the house, line by line: the same map as the homogeneous line's, from the first view
    to the extension of the segments."""
    (folder / "lines.py").write_text(ALONE, encoding="utf-8")
    Library(folder)
    sessions = []
    for name in ("two points", "homogeneous line"):
        session = Session(presets.build("house"))
        session.apply(SwapModel(LINE, name))
        for _ in range(20):
            session.advance()
        sessions.append(session)
    ours, theirs = (session.world for session in sessions)
    policies: Policies = ours.policies
    assert policies.line is not None and policies.line.name == "two points"
    assert len(ours.features) > 5 and ours.features.keys() == theirs.features.keys()
    assert sum(f.updates for f in ours.features.values()) > 100
    np.testing.assert_allclose(ours.gauss.x, theirs.gauss.x, atol=1e-6)
    for label, feature in ours.features.items():
        assert feature.model.name == "two points"
        np.testing.assert_allclose(feature.extent, theirs.features[label].extent, 1e-5, 1e-12)
    longer = [label for label, f in ours.features.items() if f.extent and np.ptp(f.extent) > 1.01]
    assert longer
