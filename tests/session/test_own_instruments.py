"""An instrument of the user's own is reloaded into a running session like any other model."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from scene_core import params
from scene_core.models import registry
from scene_core.models.library import Library
from scene_core.params import ParamError
from scene_core.session import presets
from scene_core.session.commands import SetParam, SwapModel
from scene_core.session.session import Session

GYRO = """
from dataclasses import dataclass
from scene_core.models.base import InternalMeasurement
from scene_core.models.internal.gyro import Gyro
from scene_core.params import param

@dataclass(frozen=True)
class Mine(Gyro):
    name = "mine"
    gain: float = param(1.0, lo=0.5, hi=2.0)
"""
ADDED = "estimator.instruments.mine.model"


@pytest.fixture
def folder(tmp_path: Path) -> Iterator[Path]:
    yield tmp_path
    registry.add(registry.Added())


def gyro_of_ones_own(folder: Path) -> tuple[Library, Session]:
    """The hand with a gyro of the user's own beside those it has."""
    (folder / "mine.py").write_text(GYRO, encoding="utf-8")
    library, session = Library(folder), Session(presets.build("gyro"))
    session.apply(SwapModel("estimator.instruments:hand", "add mine"))
    session.apply(SetParam(f"{ADDED}.sd", 0.02))
    session.advance()
    return library, session


def saved_as(library: Library, folder: Path, text: str) -> tuple[str, ...]:
    (folder / "mine.py").write_text(text, encoding="utf-8")
    return library.refresh() + library.refresh()


def test_a_saved_instrument_runs_in_its_new_version_in_belief_and_in_truth(folder: Path) -> None:
    library, session = gyro_of_ones_own(folder)
    old = session.world.instruments["mine"].model
    # Twice the turn rates, for the estimator and for the simulator alike.
    h = "    def h(self, needed):\n        hv, J = super().h(needed)\n"
    said = saved_as(library, folder, GYRO + h + "        return InternalMeasurement(2*hv, 2*J)\n")
    assert session.renew(said) == 2 and session.message.count("new version") == 2
    before = session.world
    session.advance()
    now = registry.model_class("internal", "mine")
    new, trace = session.world.instruments["mine"].model, session.trace
    assert type(new) is now and type(old) is not now and trace is not None
    assert (new.sd, new.gain) == (0.02, 1.0), "what was edited stays edited"  # type: ignore
    assert session.world.robots == before.robots and before.features.keys() <= (
        session.world.features.keys()
    )
    felt = trace.frame.internal
    assert abs(felt["mine"] - 2.0 * felt["gyro"]).max() < 0.05 and abs(felt["gyro"]).max() > 0.2
    updates = {u.instrument: u for record in trace.records for u in record.internals}
    assert updates["mine"].accepted and abs(updates["mine"].hv - felt["mine"]).max() < 0.2
    assert session.renew(()) == 0


def test_an_instrument_that_runs_on_nothing_any_more_goes_on_as_it_was(folder: Path) -> None:
    library, session = gyro_of_ones_own(folder)
    before = session.settings.experiment
    text = GYRO + "    needs = ('bgx', 'bgy', 'bgz')\n"
    assert session.renew(saved_as(library, folder, text)) == 0
    assert "'mine' goes on in its earlier version: 'mine' needs bgx" in session.message
    assert session.settings.experiment is before
    session.advance()


def test_an_instrument_comes_back_in_the_version_its_file_holds(folder: Path) -> None:
    library, session = gyro_of_ones_own(folder)
    session = Session(session.settings.experiment)
    session.apply(SwapModel("estimator.instruments:hand", "remove mine"))
    saved_as(library, folder, GYRO.replace("param(1.0", "param(1.5"))
    session.apply(SwapModel("estimator.instruments:hand", "add mine"))
    assert params.get(session.settings.experiment, f"{ADDED}.gain") == 1.5
    assert params.get(session.settings.experiment, f"{ADDED}.sd") == 0.02
    with pytest.raises(ParamError, match="'compass' can not take the place of 'mine'"):
        session.apply(SwapModel(ADDED, "compass"))
