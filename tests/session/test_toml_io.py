"""An experiment survives being written and read, and a file that does not fit says why."""

from __future__ import annotations

import contextlib
import dataclasses
import tomllib
from functools import cache
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scene_core import params
from scene_core.params import ParamError, Spec
from scene_core.session import presets, toml_io, units
from scene_core.session.config import Experiment, InstrumentSettings
from scene_core.session.edits import set_param, with_seed
from scene_core.session.roles import role_options, swapped
from scene_core.session.session import Session
from tests.session.test_session import fingerprint

NAMES = presets.loadable()
build = cache(presets.build)


def values(spec: Spec) -> st.SearchStrategy[object]:
    """Valid values of a parameter."""
    if spec.choices is not None:
        return st.sampled_from(spec.choices)
    if isinstance(spec.value, bool):
        return st.booleans()
    if isinstance(spec.value, str):
        return st.text(max_size=20)
    if isinstance(spec.value, int):
        lo, hi = int(spec.lo or 0), int(1000 if spec.hi is None else spec.hi)
        return st.integers(lo, hi)
    number = st.floats(spec.lo, spec.hi, allow_nan=False, allow_infinity=False)
    if spec.rows:
        return st.integers(1, 3).flatmap(lambda d: st.lists(st.tuples(*[number] * d), max_size=4))
    if isinstance(spec.value, tuple):
        return st.tuples(*[number] * len(spec.value))
    return number


@pytest.mark.parametrize("name", NAMES)
def test_presets_survive(name: str) -> None:
    experiment = build(name)
    assert toml_io.loads(toml_io.dumps(experiment, experiment)) == experiment


@given(st.data())
@settings(max_examples=60, deadline=None)
def test_edited_experiments_survive(data: st.DataObject) -> None:
    base = build(data.draw(st.sampled_from(NAMES)))
    specs = [*params.schema(base.estimator, "estimator"), *params.schema(base.source, "source")]
    edited = base
    for spec in data.draw(st.lists(st.sampled_from(specs), max_size=4)):
        value = data.draw(values(spec))
        # Each value is in its range; two may still contradict each other: a least, and a most.
        with contextlib.suppress(ParamError):
            edited = set_param(edited, spec.path, value)
    edited = with_seed(edited, data.draw(st.integers(0, 2**31 - 1)))
    text = toml_io.dumps(edited, base)
    assert toml_io.loads(text) == edited
    differ = {s.path for s in specs if params.get(edited, s.path) != params.get(base, s.path)}
    marks = text.count("# changed") - (edited.seed != base.seed)
    assert marks == len(differ)


def test_swapped_experiments_survive() -> None:
    base = build("cloister")
    for option in role_options(base):
        for name in option.options:
            try:
                edited, _ = swapped(base, base, option.role, name)
            except ParamError:
                continue
            assert toml_io.loads(toml_io.dumps(edited, base)) == edited


def test_a_true_arm_that_became_a_body_survives() -> None:
    """Its foot had a spread of its own, which a body does not have."""
    base: Any = build("arm")
    assert "foot:rx" in base.source.robots["arm"].start_sd
    edited, _ = swapped(base, base, "source.robots.arm.motion", "inertial")
    assert toml_io.loads(toml_io.dumps(edited, base)) == edited


@pytest.mark.parametrize("side", ["estimator", "source"])
def test_a_standard_deviation_in_a_file_is_not_below_zero(side: str) -> None:
    ahead, table, after = toml_io.dumps(build("calibration")).partition(
        f"[{side}.mounts.camera.calib_sd]"
    )
    wrong = ahead + table + after.replace("fu_px = 8.0", "fu_px = -8.0", 1)
    words = rf"\[{side}.mounts.camera.calib_sd\]: fu_px = -8 is outside \[0, inf\]"
    with pytest.raises(ParamError, match=words):
        toml_io.loads(wrong)


def test_instruments_and_limits_survive() -> None:
    from scene_core.models.internal.gyro import Gyro

    base = build("room")
    estimator = dataclasses.replace(
        base.estimator, instruments={"imu": InstrumentSettings("hand", Gyro())}
    )
    edited = dataclasses.replace(base, estimator=estimator, frames=17, align="sim3")
    assert toml_io.loads(toml_io.dumps(edited, base)) == edited


def test_a_read_experiment_runs_bit_for_bit_the_same() -> None:
    original = set_param(build("nomad"), "estimator.robots.nomad.motion.sd_v", 0.1 + 0.2)
    read = toml_io.loads(toml_io.dumps(original))
    sessions = Session(original), Session(read)
    for session in sessions:
        for _ in range(20):
            session.advance()
    assert fingerprint(sessions[0]) == fingerprint(sessions[1])


def test_every_parameter_is_explained_and_keys_carry_units() -> None:
    experiment = build("room")
    text = toml_io.dumps(experiment)
    for spec in params.schema(experiment.estimator):
        assert spec.help, f"{spec.path} has no help text"
    assert "sd_accel_m_per_s2 = 1.0" in text and "kd1_per_px2 = " in text
    motion = tomllib.loads(text)["estimator"]["robots"]["hand"]["motion"]
    assert motion["model"] == "impulse"


@pytest.mark.parametrize(
    ("name", "unit", "key"),
    [
        ("sd_accel", "m/s²", "sd_accel_m_per_s2"),
        ("kd1", "1/px²", "kd1_per_px2"),
        ("max_angle", "rad", "max_angle_rad"),
        ("sd_px", "px", "sd_px"),
        ("noise", "rad/s/√Hz", "noise_rad_per_s_per_sqrtHz"),
        ("dx_mm", "mm", "dx_mm"),
        ("k2", "1/mm⁴", "k2_per_mm4"),
        ("budget", "", "budget"),
    ],
)
def test_units_in_keys(name: str, unit: str, key: str) -> None:
    assert units.key(name, unit) == key


def test_changed_values_show_the_scenarios() -> None:
    base = build("nomad")
    edited = set_param(base, "estimator.robots.nomad.motion.sd_v", 0.5)
    marked = [row for row in toml_io.dumps(edited, base).splitlines() if "# changed" in row]
    assert marked == ["sd_v = 0.5 # changed, preset: 0.14"]


def broken(old: str, new: str) -> str:
    text = toml_io.dumps(build("nomad"))
    assert old in text
    return text.replace(old, new, 1)


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("sd_v = 0.14", "sd_v = -1", r"\[estimator.robots.nomad.motion\].*-1 is outside \[0, 2\]"),
        ("sd_v = 0.14", "sd_v = 'a'", r"sd_v = 'a': give a number"),
        ("sd_v = 0.14", "sd_v = true", r"sd_v = True: give a number"),
        ("sd_v = 0.14", "sd_v = nan", r"sd_v = nan: give a finite number"),
        ("sd_v = 0.14", "sd_x = 0.14", r"no key 'sd_x' here: it may have speed_scale, sd_v"),
        ('"planar nomad"', '"warp drive"', r"model = 'warp drive': choose one of .*unicycle"),
        ('kind = "simulation"', 'kind = "x"', r"\[source\]: kind = 'x': choose one of simulation"),
        ('"planar nomad"', '["x"]', r"model = \['x'\]: choose one of .*unicycle"),
        ("budget = 20", f"budget = {'9' * 400}", r"an integer of that size: give a finite number"),
        ("seed = 0", "seed = -1", r"seed = -1 is outside \[0, 2"),
        ("seed = 0", "seed = 0\nframes = 0", r"frames = 0 is outside \[1, inf\]"),
        ('up = "y"', 'up = "x"', r"\[estimator\]: up = 'x': choose one of y, z"),
        ('kind = "simulation"', "", r"\[source\]: kind = None: choose one of"),
        ("budget = 20", "budget = 2.5", r"budget = 2.5: give a whole number"),
        ('score = "trace"', 'score = "best"', r"score = 'best': choose one of trace, determinant"),
        ('robot = "nomad"', "robot = 3", r"\[estimator.mounts.scanner\]: robot: give a text"),
        ('robot = "nomad"\n', "", r"\[estimator.mounts.scanner\]: 'robot' is missing"),
        ("pose = [0.0, 0.0, 0.0]", "pose = 0", r"pose = 0: give a list"),
        ("pose = [0.0, 0.0, 0.0]", "pose = ['a']", r"pose = 'a': give a number"),
        ("z_m = 3.2", "q_m = 3.2", r"\[estimator.robots.nomad.start\]: no key 'q_m'.*z_m, x_m"),
        ("seed = 0", "seed = 0\nspeed = 3", r"no key 'speed' here: it may have name, about"),
        ("seed = 0", "seed = ", r"is not valid TOML"),
        (
            "seed = 0",
            f"seed = {'[' * 5000}{']' * 5000}",
            r"is not valid TOML: its lists are nested",
        ),
        ("seed = 0", f"seed = 1{'0' * 5000}", r"is not valid TOML: it has a number of thousands"),
        ('align = "none"', 'align = "se4"', r"align = 'se4': choose one of none, se2"),
    ],
)
def test_what_does_not_fit_is_one_sentence(old: str, new: str, complaint: str) -> None:
    with pytest.raises(ParamError, match=rf"^my\.toml.*{complaint}") as caught:
        toml_io.loads(broken(old, new), "my.toml")
    assert "\n" not in str(caught.value)


def test_a_missing_file_is_named(tmp_path) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(ParamError, match=r"nothing\.toml can not be opened"):
        toml_io.load(tmp_path / "nothing.toml")


def test_save_and_load(tmp_path) -> None:  # type: ignore[no-untyped-def]
    experiment: Experiment = build("line")
    toml_io.save(tmp_path / "line.toml", experiment)
    assert toml_io.load(tmp_path / "line.toml") == experiment
