"""The map: ellipsoids are covariances, instances keep their features, flags are their robots'."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator

import numpy as np
import pytest
import viser

from scene_core.filter.world import World
from scene_core.geometry import quaternion
from scene_core.geometry.correlation import largest_canonical_correlations
from scene_core.geometry.ellipses import sigma
from scene_core.geometry.embedding import embed_covariances as embed_P
from scene_core.geometry.embedding import embed_points
from scene_core.models.sensors.fisheye import Fisheye
from scene_core.session.commands import SwapModel
from scene_core.session.presets import build
from scene_core.session.published import Published
from scene_core.session.runner import Runner
from scene_core.session.session import Session
from scene_core.session.start import initial_world
from scene_core.sources.simulated import Simulation
from scene_core.sources.worlds import in_axes
from tests.web.fakes import published
from tests.web.test_gate import free_port
from web_panels import gate, map_geometry, verdicts
from web_panels.clouds import Cloud, Clouds, within_ray
from web_panels.frame_card import pose_card
from web_panels.instances import Instances
from web_panels.map_layers import Sightings
from web_panels.map_legend import legend_html, legend_of
from web_panels.map_panel import MapPanel, followed
from web_panels.map_robots import Paths, Robots
from web_panels.map_waypoints import Flags, flag_height
from web_panels.panel import Look, Page
from web_panels.style import HEX, C, linear, robot_colour

RNG = np.random.default_rng(1)


@pytest.fixture(scope="module", params=["line", "nomad", "cloister"])
def world(request: pytest.FixtureRequest) -> World:
    session = Session(build(request.param))
    for _ in range(15):
        session.advance()
    return session.world


@pytest.fixture(scope="module")
def cloister() -> Published:
    return published("cloister", 25)


@pytest.fixture(scope="module")
def server() -> Iterator[viser.ViserServer]:
    server = gate.guarded_server("127.0.0.1", free_port(), None)
    yield server
    server.stop()


def test_every_feature_is_drawn_once_and_where_it_is(world: World) -> None:
    cloud = Clouds().of(world, 0.95, 0.0)
    assert sorted(cloud.labels) == sorted(world.features)
    for label, at in zip(cloud.labels, cloud.positions, strict=True):
        f = world.features[label]
        glyph = f.model.graphics(world.gauss.mean(f.block)[None], world.gauss.cov(f.block)[None])
        if glyph.ends is None:
            mean = embed_points(glyph.mean, f.model.space, world.up)
            assert np.allclose(at, mean[0])


def test_ellipsoids_have_the_stated_content(world: World) -> None:
    """scale / sigma(d, confidence) and wxyz are the eigen-decomposition of the covariance."""
    clouds = Clouds()
    cloud = clouds.of(world, 0.95, 0.0)
    wider = clouds.of(world, 0.99, 0.0)
    for i, label in enumerate(cloud.labels):
        f = world.features[label]
        if f.model.successor() is not None:
            continue
        d = f.model.space.d
        R = quaternion.matrix(cloud.wxyz[i])
        P = R @ np.diag((cloud.scales[i] / sigma(d, 0.95)) ** 2) @ R.T
        glyph = f.model.graphics(world.gauss.mean(f.block)[None], world.gauss.cov(f.block)[None])
        expected = embed_P(glyph.cov, f.model.space, world.up)[0]
        assert np.allclose(P, expected, atol=1e-12)
        ratio = sigma(d, 0.99) / sigma(d, 0.95)
        assert np.allclose(wider.scales[i], ratio * cloud.scales[i])


def test_remembered_rows_follow_the_layout(cloister: Published) -> None:
    """One `Clouds` through a whole run gives what a fresh one gives."""
    session, clouds = Session(build("cloister")), Clouds()
    for _ in range(12):
        session.advance()
        ours, fresh = (c.of(session.world, 0.95, 0.01) for c in (clouds, Clouds()))
        assert ours.labels == fresh.labels
        assert np.array_equal(ours.positions, fresh.positions)


def test_open_depths_stay_on_their_rays() -> None:
    ends = RNG.normal(size=(50, 2, 3))
    mean, scales = RNG.normal(size=(50, 3)) * 100, np.abs(RNG.normal(size=(50, 3))) * 100
    held, capped = within_ray(mean, scales, ends)
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    assert (np.linalg.norm(held - ends[:, 0], axis=1) <= length + 1e-9).all()
    assert (capped <= np.maximum(0.5 * length, 1e-3)[:, None] + 1e-12).all()
    from_start = np.linalg.norm(held - ends[:, 0], axis=1)
    reach = capped.max(axis=1)
    assert (reach <= np.maximum(from_start, 1e-3) + 1e-9).all(), "none reaches behind its camera"
    small = 1e-3 * scales
    near = ends[:, 0] + 0.5 * (ends[:, 1] - ends[:, 0])
    same, whole = within_ray(near, small * (small < 0.1), ends)
    assert np.allclose(same, near) and np.allclose(whole, small * (small < 0.1))


def test_rings_lie_on_the_larger_ellipsoid() -> None:
    scales, wxyz = np.array([0.1, 0.2, 0.4]), np.array([0.5, 0.5, -0.5, 0.5])
    at = np.array([1.0, 2.0, 3.0])
    points = map_geometry.rings(at, scales, wxyz, larger=1.25).reshape(-1, 3)
    local = (points - at) @ quaternion.matrix(wxyz)
    assert np.allclose(((local / scales) ** 2).sum(axis=1), 1.25**2)


def test_colours_are_the_verdicts(cloister: Published) -> None:
    trace = cloister.trace
    assert trace is not None
    labels = tuple(trace.world.features)
    states = map_geometry.states(trace, trace.world, labels)
    accepted = {a.label for a in trace.associations() if a.verdict == "accepted"}
    assert accepted
    assert {x for x, s in zip(labels, states, strict=True) if s == "accepted"} == accepted
    rgb = map_geometry.colours(states)
    assert (rgb[states.index("accepted")] == C["accepted"]).all()


def test_a_half_done_frame_shows_the_gates_verdicts(cloister: Published) -> None:
    trace = cloister.trace
    assert trace is not None
    until = next(i for i, r in enumerate(trace.records) if r.phase == "associate")
    half = dataclasses.replace(trace, records=trace.records[: until + 1], complete=False)
    assert half.associations() == ()
    judged = {a.label for a in trace.records[until].associations}
    assert judged and set(verdicts.states(half)) == judged


def test_correlation_colours_are_canonical_correlations(cloister: Published) -> None:
    assert cloister.trace is not None
    world = cloister.trace.world
    labels = tuple(world.features)
    rgb = map_geometry.correlation_colours(world, labels[0], labels)
    assert np.allclose(rgb[0], map_geometry.STRONG), "wholly correlated with itself"
    blocks = [world.gauss.layout[world.features[x].block].slice for x in labels]
    rho = largest_canonical_correlations(world.gauss.P, blocks[0], blocks)
    along = (rgb - map_geometry.WEAK) @ (map_geometry.STRONG - map_geometry.WEAK)
    assert (np.argsort(along, kind="stable") == np.argsort(rho, kind="stable")).all()


def cloud_of(labels: list[int]) -> Cloud:
    n = len(labels)
    at = np.array(labels, dtype=float)[:, None] * np.ones(3)
    wxyz = np.tile([1.0, 0.0, 0.0, 0.0], (n, 1))
    return Cloud(tuple(labels), at, np.ones((n, 3)), wxyz, np.full((n, 2, 3), np.nan))


def ignore(_: int) -> None: ...


def test_a_feature_keeps_its_instance_while_others_come_and_go(server: viser.ViserServer) -> None:
    layer = Instances(server, ignore)
    alive, before = list(range(1, 200)), {}
    for step in range(30):
        layer.render(cloud_of(alive), np.zeros((len(alive), 3)))
        assert {layer.label_at[s]: s for s in layer.label_at} == layer.slots
        assert set(layer.slots) == set(alive)
        for label, slot in layer.slots.items():
            assert before.get(label, slot) == slot
            assert np.asarray(layer.node.batched_positions)[slot, 0] == label
        used = np.zeros(layer.capacity, dtype=bool)
        used[list(layer.slots.values())] = True
        assert (np.asarray(layer.node.batched_scales)[~used] == 0).all()
        before = dict(layer.slots)
        alive = [x for x in alive if x % 7 != step % 7] + [1000 * (step + 1) + k for k in range(9)]


def test_the_node_grows_and_stays_clickable(server: viser.ViserServer) -> None:
    layer = Instances(server, ignore)
    layer.render(cloud_of(list(range(1, 11))), np.zeros((10, 3)))
    slots = dict(layer.slots)
    layer.render(cloud_of(list(range(1, 1001))), np.zeros((1000, 3)))
    assert layer.capacity >= 1000
    assert {k: layer.slots[k] for k in slots} == slots
    assert len(set(layer.slots.values())) == 1000
    assert len(layer.node._impl.click_cb or ()) == 1


def test_thinned_paths_keep_their_ends() -> None:
    path = np.cumsum(RNG.normal(size=(1234, 3)), axis=0)
    segments = map_geometry.thinned(path, 100)
    assert len(segments) <= 101
    assert (segments[0, 0] == path[0]).all() and (segments[-1, 1] == path[-1]).all()
    assert (segments[1:, 0] == segments[:-1, 1]).all()
    path[np.arange(len(path)) % 4 != 0] = np.nan
    sparse = map_geometry.thinned(path, 100)
    assert np.isfinite(sparse).all() and (sparse[0, 0] == path[0]).all()
    assert map_geometry.thinned(path[:1]).shape == (0, 2, 3)


def test_a_sparse_reference_is_shown_until_it_is_old() -> None:
    rows = np.full((40, 3), np.nan)
    assert map_geometry.last_known(rows) is None and map_geometry.last_known(None) is None
    rows[35] = 1.0
    known = map_geometry.last_known(rows)
    assert known is not None and (known == 1.0).all()
    assert map_geometry.last_known(np.concatenate([rows, np.full((20, 3), np.nan)])) is None


def test_the_view_angle_of_a_pinhole() -> None:
    sensor = build("cloister").estimator.mounts["camera"].sensor
    undistorted = np.array([*sensor.calib0[:4], 0.0, 0.0])
    fov, aspect = map_geometry.view_angle(sensor, undistorted)
    assert fov == pytest.approx(2 * math.atan(240 / 320))
    assert aspect == pytest.approx(640 / 480)


@pytest.mark.parametrize(("focal", "degrees"), [(200.0, 137.5), (120.0, 150.0), (80.0, 150.0)])
def test_the_frustum_of_a_fisheye_stays_open_to_the_front(focal: float, degrees: float) -> None:
    """480 rows at 120 px per radian are 229 degrees: no pyramid shows them."""
    sensor = Fisheye(width=640, height=480, u0=320.0, v0=240.0, f_u=focal, f_v=focal)
    fov, _ = map_geometry.view_angle(sensor, sensor.calib0)
    assert math.degrees(fov) == pytest.approx(degrees, abs=0.1)


def test_flags_are_smaller_than_the_way_between_them() -> None:
    line = np.array([[0.0, 0, 0], [0.4, 0, 0], [0.4, 0, 0], [np.nan] * 3, [4.0, 0, 0]])
    assert flag_height(line, 0.3) == pytest.approx(0.1)
    assert flag_height(10 * line, 0.3) == 0.3
    assert flag_height(line[:1], 0.3) == flag_height(line[:0], 0.3) == 0.3


@pytest.mark.parametrize("preset", ["nomad", "cooperation"])
def test_flags_of_several_robots_have_the_colours_of_their_robots(
    server: viser.ViserServer, preset: str
) -> None:
    session = Session(build(preset))
    session.advance()
    flags = Flags(server.scene, session.world, 10.0)
    flags.render(Runner(session).latest, session.world)
    assert flags.flags.points.shape == flags.flags.colors.shape
    assert flags.goals.points.shape == flags.goals.colors.shape
    seen = {tuple(rgb) for rgb in flags.flags.colors.reshape(-1, 3).tolist()}
    goals = {tuple(rgb) for rgb in flags.goals.colors.reshape(-1, 3).tolist()}
    if preset == "nomad":
        assert seen == {tuple(linear(C["ink"]))} and goals == {tuple(linear(C["truth"]))}
    else:
        assert seen == goals == {tuple(linear(robot_colour(i))) for i in (0, 1)}


def test_the_legend_states_confidence_and_dimension() -> None:
    assert "95 % in 3-D = 2.80 sigma" in legend_html(Look(), 3)
    assert "95 % in 2-D = 2.45 sigma" in legend_html(Look(), 2)
    assert "95 % in 1-D = 1.96 sigma" in legend_html(Look(), 1)


def test_no_sighting_ends_in_the_middle_of_an_open_ring(server: viser.ViserServer) -> None:
    """Every line ends at a measured feature that is known."""
    p = published("ranges", 12)
    assert p.trace is not None
    world = p.trace.world
    cloud = Clouds().of(world, 0.95, 0.0)
    is_open = np.isin(np.arange(len(cloud.labels)), cloud.swarm.rows)
    sightings = Sightings(server.scene)
    sightings.render(p.trace, world, cloud, visible=True)
    tips = np.asarray(sightings.node.points)[:, 1]
    used = [np.isclose(tips, at, atol=1e-4).all(axis=1).any() for at in cloud.positions]
    judged = [label for _, label in verdicts.outcomes(p.trace)]
    assert set(np.array(cloud.labels)[is_open]) & set(judged) and not np.any(
        np.array(used)[is_open]
    )


def test_the_legend_has_every_colour_of_the_robots_and_says_what_grains_are() -> None:
    one = legend_of(published("ranges", 1), Look())
    assert "bearing open" in one and "ray: depth" not in one and HEX["robot 2"] not in one
    rays = legend_html(Look(), 3, ("robot",), ("rho",))
    assert "grains: depth open" in rays and "ray: depth open" in rays
    for colour in ("verdict", "correlation"):
        two = legend_of(published("two_robots", 1), Look(colour=colour))
        for i in (0, 1):
            assert "#{:02x}{:02x}{:02x}".format(*robot_colour(i)) in two
    assert "grains" not in two


def test_linear_colours_keep_black_and_white() -> None:
    assert linear(np.array([[0, 0, 0], [255, 255, 255]])).tolist() == [[0] * 3, [255] * 3]


def test_every_robot_has_its_colour_its_name_and_can_be_followed() -> None:
    p = published("two_robots", 4)
    assert p.trace is not None
    world = p.trace.world
    first, second = world.robots
    server = gate.guarded_server("127.0.0.1", free_port(), None)
    robots = Robots(server.scene, world, 5.0)
    robots.render(p, world, truth=True)
    assert robots.bodies[first, "base"].color != robots.bodies[second, "base"].color
    assert [robots.names[name, "base"].text for name in (first, second)] == [first, second]
    for name in (first, second):
        at = map_geometry.robot_pose(world, name)[:3]
        np.testing.assert_allclose(robots.bodies[name, "base"].position, at)
        assert robots.true_bodies[name, "base"].visible
    server.stop()
    assert followed(world, Look()) == (first, "base") == followed(world, Look(follow="nobody"))
    assert followed(world, Look(follow=second)) == (second, "base")
    two = initial_world(build("pair"))
    assert followed(two, Look(follow="pair second")) == ("pair", "second")


def test_the_parts_of_an_arm_are_drawn_and_only_the_robot_named() -> None:
    p = published("arm", 3)
    assert p.trace is not None
    world = p.trace.world
    (name,) = world.robots
    server = gate.guarded_server("127.0.0.1", free_port(), None)
    robots = Robots(server.scene, world, 5.0)
    robots.render(p, world, truth=True)
    assert set(robots.names) == {(name, "base")} and len(robots.parts) > 3
    for part in robots.parts:
        body = robots.bodies[part]
        np.testing.assert_allclose(body.position, map_geometry.robot_pose(world, *part)[:3])
        true = map_geometry.true_position(p, *part, up=world.up)
        assert true is not None and np.linalg.norm(true - body.position) < 0.5
    server.stop()


def test_two_robots_of_one_model_are_drawn_and_told_as_two() -> None:
    p = published("pair", 20)
    assert p.trace is not None
    world, truth = p.trace.world, p.trace.frame.truth
    server = gate.guarded_server("127.0.0.1", free_port(), None)
    robots, paths = Robots(server.scene, world, 5.0), Paths(server.scene, world)
    robots.render(p, world, truth=True)
    paths.render(p, trajectories=True, truth=True)
    assert robots.parts == [("pair", "base"), ("pair", "second")] and truth is not None
    assert [n.text for n in robots.names.values()] == ["pair", "pair second"]
    assert len({body.color for body in robots.bodies.values()}) == 2
    assert len({body.radius for body in robots.bodies.values()}) == 1
    for i, (part, body) in enumerate(robots.bodies.items()):
        at, true = map_geometry.robot_pose(world, *part)[:3], truth.at(*part)
        assert true is not None
        np.testing.assert_allclose(body.position, at)
        np.testing.assert_allclose(robots.true_bodies[part].position, [true[1], 0.0, true[0]])
        name = ("pair", "pair second")[i]
        for kind in ("estimate", "truth"):
            assert paths.nodes[name, kind].visible
        np.testing.assert_allclose(paths.nodes[name, "estimate"].points[-1, 1], at, atol=1e-6)
        colour = "#{:02x}{:02x}{:02x}".format(*robot_colour(i))
        assert f"estimate of {name}" in legend_of(p, Look()) and colour in legend_of(p, Look())
        assert f"Pose of {name}<" in pose_card(p)
    server.stop()


def test_a_model_that_is_swapped_brings_its_bodies_to_the_map(server: viser.ViserServer) -> None:
    session = Session(build("nomad"))
    session.advance()
    panel = MapPanel(Page())
    panel.build(server, lambda command: None)
    panel.render(Runner(session).latest)
    assert panel.robots.parts == [("nomad", "base")]
    session.apply(SwapModel("estimator.robots.nomad.motion", "double"))
    session.advance()
    panel.render(Runner(session).latest)
    assert panel.robots.parts == [("nomad", "base"), ("nomad", "second")]
    assert not panel.robots.true_bodies["nomad", "second"].visible, "there is none"


def test_a_recording_of_something_small_is_seen_from_near(
    cloister: Published, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert cloister.trace is not None
    world = cloister.trace.world
    at = map_geometry.robot_pose(world, "robot")[:3]
    box = at + 0.2 * RNG.standard_normal((40, 3)).clip(-1.0, 1.0)
    monkeypatch.setattr(map_geometry, "outline_of", lambda *_: np.zeros((0, 2, 3)))
    monkeypatch.setattr(map_geometry, "true_points", lambda *_: box)
    bounds = map_geometry.start_bounds(cloister, world)
    assert bounds.radius < 0.5 * math.sqrt(3.0)
    assert (bounds.lo <= box).all() and (box <= bounds.hi).all()


def test_undulating_ground_is_drawn_where_it_is() -> None:
    source = build("terrain").source
    assert isinstance(source, Simulation)
    mesh = map_geometry.ground_mesh(source)
    assert mesh is not None
    vertices, faces = mesh
    assert faces.max() == len(vertices) - 1
    back = in_axes(source.world, np.arange(3.0), source.up).astype(int)
    flat = np.empty_like(vertices)
    flat[:, back] = vertices
    ground = source.world.ground(flat[:, :2])
    assert ground is not None
    np.testing.assert_allclose(flat[:, 2], ground.height, atol=1e-9)
    assert np.ptp(flat[:, 2]) > 0.05
