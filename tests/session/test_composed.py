"""A model made of models is written, read, edited and started like any other."""

from __future__ import annotations

import tomllib

import numpy as np
import pytest

from scene_core import params
from scene_core.geometry import quaternion
from scene_core.geometry.spaces import THREE_D
from scene_core.models.motion.arm import Arm
from scene_core.models.motion.double import Double
from scene_core.models.motion.impulse import Impulse
from scene_core.models.motion.inertial import Inertial
from scene_core.models.motion.nomad import PlanarNomad
from scene_core.models.motion.unicycle import PlanarUnicycle
from scene_core.params import ParamError
from scene_core.session import presets, toml_io
from scene_core.session.config import Experiment, RobotSettings
from scene_core.session.edits import set_param
from scene_core.session.roles import swapped
from scene_core.session.start import initial_world, sd_labels, sds_of, start_state
from scene_core.session.swap import reconfigure

MOTION = "estimator.robots.nomad.motion"
PAIR = Double(PlanarNomad(sd_v=0.2), PlanarUnicycle(sd_w=0.03), rest_sd_apart=4.0)


def with_pair() -> Experiment:
    base = presets.build("nomad")
    robot = RobotSettings(
        PAIR,
        start={"z": 1.0, "2:z": -1.0, "2:phi": 0.5},
        start_sd={"2:x": 0.3, "2:phi": 0.1},
        calib_sd={"speed scale": 0.2},
    )
    return params.put(base, "estimator.robots.nomad", robot)


def test_a_pair_survives_a_settings_file() -> None:
    experiment = with_pair()
    text = toml_io.dumps(experiment, presets.build("nomad"))
    assert toml_io.loads(text) == experiment
    robot = tomllib.loads(text)["estimator"]["robots"]["nomad"]
    assert robot["motion"]["model"] == "double"
    assert robot["motion"]["second"]["model"] == "planar unicycle"
    assert robot["start"]["2:phi_rad"] == 0.5


@pytest.mark.parametrize("motion", [Arm(axes=("x",), lengths=(1.0,), gears=(1.0,),
                                        rest_angles=(0.1,)),
                                    Inertial(gravity=(0.0, -9.81, 0.0)),
                                    Double(Impulse(), Double(Arm(), Inertial()))],
                         ids=lambda m: m.name)  # fmt: skip
def test_models_in_space_survive_a_settings_file(motion) -> None:  # type: ignore[no-untyped-def]
    base = presets.build("cloister")
    name = next(iter(base.estimator.robots))
    experiment = params.put(base, f"estimator.robots.{name}", RobotSettings(motion, start={}))
    assert toml_io.loads(toml_io.dumps(experiment, base)) == experiment


def test_a_file_with_robots_that_do_not_fit_together_says_where() -> None:
    text = toml_io.dumps(with_pair())
    wrong = text.replace('model = "planar unicycle"', 'model = "warp drive"', 1)
    with pytest.raises(ParamError, match=r"motion\.second\]: model = 'warp drive': choose one of"):
        toml_io.loads(wrong, "my.toml")
    short = toml_io.dumps(
        params.put(presets.build("cloister"), "estimator.robots.robot", RobotSettings(Arm(), {}))
    ).replace("gears = [1.0, 1.0, 1.0]", "gears = [1.0]")
    with pytest.raises(ParamError, match=r"robots\.robot\.motion\]: 'arm' has 3 joints"):
        toml_io.loads(short, "my.toml")


def test_the_parameters_of_both_robots_can_be_edited() -> None:
    edited = set_param(with_pair(), f"{MOTION}.second.sd_w", 0.5)
    assert params.get(edited, f"{MOTION}.second") == PlanarUnicycle(sd_w=0.5)
    assert params.get(edited, f"{MOTION}.first") == PAIR.first
    paths = {s.path for s in params.schema(edited)}
    assert {f"{MOTION}.first.sd_v", f"{MOTION}.second.sd_w", f"{MOTION}.rest_sd_apart"} <= paths
    with pytest.raises(ParamError, match="outside"):
        set_param(edited, f"{MOTION}.first.sd_v", -1.0)


def test_a_pair_starts_where_the_settings_say() -> None:
    world = initial_world(with_pair())
    np.testing.assert_allclose(world.gauss.mean("robot:nomad"), [1, 0, 0, 0, -1, 0, 0.5])
    sd = np.sqrt(np.diag(world.gauss.cov("robot:nomad")))
    np.testing.assert_allclose(sd, [0, 0, 0, 0, 0, 0.3, 0.1], atol=1e-12)


def test_the_second_orientation_in_space_has_its_own_turn() -> None:
    motion = Double(Impulse(), Arm())
    q = quaternion.from_rotation_vector(np.array([0.3, 1.0, -0.2]))[0]
    start = {f"2:foot:q{part}": 2.0 * value for part, value in zip("wxyz", q, strict=True)}
    sd = {"rx": 0.1, "2:foot:rz": 0.2, "2:q1": 0.3}
    xv, P = start_state("start", RobotSettings(motion, start, sd))
    rows = slice(13 + 3, 13 + 7)
    np.testing.assert_allclose(xv[rows], q)
    np.testing.assert_allclose(xv[3:7], [1, 0, 0, 0])
    J = THREE_D.tangent_map(np.r_[0, 0, 0, q])[3:, 3:]
    np.testing.assert_allclose(J @ P[rows, rows] @ J.T, np.diag([0, 0, 0.04]), atol=1e-12)
    assert "2:foot:rx" in sd_labels(motion.state_labels)
    said = {label: v for label, v in sds_of(motion.state_labels, xv, P).items() if v > 1e-9}
    assert said == pytest.approx(sd)
    with pytest.raises(ParamError, match="no component '2:foot:qw'"):
        start_state("start", RobotSettings(motion, {}, {"2:foot:qw": 0.1}))
    zero = dict.fromkeys(start, 0.0)
    with pytest.raises(ParamError, match=r"2:foot:qw, .* may not be zero"):
        start_state("start", RobotSettings(motion, zero))


@pytest.mark.parametrize("name", ["arm", "inertial"])
def test_a_robot_in_space_is_swapped_while_it_runs(name: str) -> None:
    base = presets.build("cloister")
    edited, _ = swapped(base, base, "estimator.robots.robot.motion", name)
    before = initial_world(base)
    after = reconfigure(before, base.estimator, edited.estimator).world
    motion = after.robots["robot"].motion
    assert motion.name == name
    np.testing.assert_allclose(
        motion.xp(after.gauss.mean("robot:robot")).xp, before.gauss.mean("robot:robot"), atol=1e-9
    )
    started = initial_world(edited)
    np.testing.assert_allclose(
        motion.xp(started.gauss.mean("robot:robot")).xp, before.gauss.mean("robot:robot"), atol=1e-9
    )


def test_one_robot_becomes_two_and_the_first_keeps_what_it_knew() -> None:
    base = presets.build("nomad")
    edited, _ = swapped(base, base, MOTION, "double")
    before = initial_world(base)
    gauss = reconfigure(before, base.estimator, edited.estimator).world.gauss
    np.testing.assert_allclose(gauss.mean("robot:nomad")[:4], before.gauss.mean("robot:nomad"))
    np.testing.assert_allclose(gauss.cov("robot:nomad")[:4, :4], before.gauss.cov("robot:nomad"))
    assert gauss.cov("robot:nomad")[4, 4] == pytest.approx(Double().rest_sd_apart ** 2)
    np.testing.assert_allclose(
        gauss.cov("robot:nomad:calib")[0, 0], before.gauss.cov("robot:nomad:calib")[0, 0]
    )
    again, _ = swapped(edited, base, MOTION, "planar nomad")
    assert again == base
