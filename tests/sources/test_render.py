"""Rendered images agree with the camera model that the estimator uses."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest

from scene_core.filter.policies import Vision
from scene_core.filter.ports import Image, Occupied, Query, SourceError
from scene_core.geometry import quaternion
from scene_core.geometry.spaces import THREE_D
from scene_core.models.camera import Camera, CentralCamera
from scene_core.models.motion.impulse import Impulse
from scene_core.models.sensors.fisheye import Fisheye
from scene_core.models.sensors.omnidirectional import Omnidirectional
from scene_core.models.sensors.pinhole import Pinhole
from scene_core.models.sensors.wide_angle import WideAngle
from scene_core.sources import noise
from scene_core.sources.handheld import HandHeld
from scene_core.sources.pictures import projected
from scene_core.sources.pixel_rays import rays_of
from scene_core.sources.render import Rendering, look, render
from scene_core.sources.room import SIZE, Surface, TexturedRoom, poster_corners
from scene_core.sources.simulated import Simulation, TrueMount, TrueRobot
from scene_core.sources.textured_scene import Scene, hit, scene_of, visible
from scene_core.sources.worlds import SimulatedWorld

PINHOLE = Pinhole(u0=159.5, v0=119.5, f_u=210.0, f_v=210.0, distortion=(-0.12, 0.02))
WIDE = WideAngle()
FISHEYE = Fisheye(u0=160.0, v0=120.0, f_u=110.0, f_v=112.0, k1=-0.02, k2=0.003)
"""To 90 degrees on either side, and farther in the corners."""
OMNI = Omnidirectional(
    width=320, height=240, u0=160.0, v0=120.0, polynomial=(125.6637, -80.0), theta_min=-0.25
)
"""An equidistant lens whose circle, of 104 degrees, ends inside the image's corners."""
EYE = np.array([0.2, 0.5, 1.3])
STILL = Rendering(exposure=0.0, gain=1.0, flicker=0.0, noise=0.0, blur=0.6)


def looking_at(position: np.ndarray, target: np.ndarray, roll: float = 0.1) -> np.ndarray:
    """Pose (7,) of a camera with its head up, but for a small roll."""
    z = (target - position) / np.linalg.norm(target - position)
    x = np.cross(z, [0.0, 0.0, 1.0])
    x /= np.linalg.norm(x)
    R = np.column_stack([x, np.cross(z, x), z])
    turn = quaternion.from_rotation_vector(np.array([0.0, 0.0, roll]))[0]
    return np.concatenate([position, quaternion.product(quaternion.from_matrix(R), turn)])


@cache
def checkered() -> tuple[Scene, np.ndarray]:
    """A room whose wall y = 2.5 is a chessboard of 0.25 m, and the board's inner corners."""
    room = TexturedRoom()
    wall = next(s for s in room.surfaces() if s.name == "poster wall")
    rows, columns = wall.texture.shape[:2]
    i, j = np.mgrid[:rows, :columns] // 50
    board = np.where((i + j) % 2 == 0, 40, 210).astype(np.uint8)
    painted = replace(wall, texture=np.repeat(board[..., None], 3, axis=2))
    surfaces = [painted if s.name == "poster wall" else s for s in room.surfaces() if s.is_wall]
    x, z = np.meshgrid(-3.0 + 0.25 * np.arange(1, 24), SIZE[2] - 0.25 * np.arange(1, 10))
    corners = np.column_stack([x.ravel(), np.full(x.size, 2.5), z.ravel()])
    return scene_of(_Painted(tuple(surfaces))), corners  # type: ignore[arg-type]


class _Painted:
    """Something with surfaces."""

    def __init__(self, surfaces: tuple[Surface, ...]):
        self._surfaces = surfaces

    def surfaces(self) -> tuple[Surface, ...]:
        return self._surfaces


def photo(
    camera: CentralCamera, scene: Scene, now: np.ndarray, how: Rendering = STILL
) -> np.ndarray:
    rays = rays_of(camera, tuple(camera.calib0.tolist()))
    return render(scene, rays, now, now, 0.0, how, noise.rng(0, "photo"))


@pytest.mark.parametrize("camera", [PINHOLE, WIDE, FISHEYE], ids=lambda c: c.name)
@pytest.mark.parametrize("target", [(0.0, 2.5, 1.3), (1.0, 2.5, 1.0)])
def test_corners_appear_where_the_camera_model_projects_them(
    camera: Camera, target: tuple[float, float, float]
) -> None:
    scene, corners = checkered()
    pose = looking_at(EYE, np.array(target))
    image = photo(camera, scene, pose)
    # Where the squares are large enough for a corner finder, however wide the lens.
    corners = corners[np.abs(corners - target).max(axis=1) < 1.0]
    h = [projected(camera, camera.calib0, pose, c) for c in corners]
    inside = np.array([z for z in h if z is not None and (z > 20).all() and (z < (300, 220)).all()])
    assert len(inside) > 20
    start = inside.astype(np.float32).reshape(-1, 1, 2)
    until = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 60, 1e-3)
    seen = cv2.cornerSubPix(image, start.copy(), (4, 4), (-1, -1), until).reshape(-1, 2)
    off = np.linalg.norm(seen - inside, axis=1)
    assert np.sqrt((off**2).mean()) < 0.1
    assert off.max() < 0.3


@pytest.mark.parametrize("camera", [PINHOLE, FISHEYE, OMNI], ids=lambda c: c.name)
def test_what_a_pixel_sees_projects_back_onto_it(camera: CentralCamera) -> None:
    scene = scene_of(TexturedRoom())
    rng = np.random.default_rng(0)
    for target in ((0.0, 2.5, 1.0), (2.6, 0.0, 0.8), (-2.4, 1.9, 0.5)):
        pose = looking_at(EYE, np.array(target))
        for z in rng.uniform((5, 5), (315, 235), (20, 2)):
            ray = camera.backproject(z[None], np.zeros((1, 1)), camera.calib0).X[0, :3]
            place = hit(scene, pose, ray)
            assert place is not None
            at = projected(camera, camera.calib0, pose, place)
            if camera is OMNI and np.linalg.norm(z - (160, 120)) > 145:
                continue  # outside the circle
            assert at is not None
            np.testing.assert_allclose(at, z, atol=1e-6)
            assert (np.abs(place) <= np.array([3.0, 2.5, 2.6]) + 1e-9).all()
            assert visible(scene, EYE, place)


def test_furniture_hides_the_wall_behind_it() -> None:
    scene = scene_of(TexturedRoom())
    behind = np.array([3.0, 0.0, 1.0])
    assert not visible(scene, EYE, behind)
    first = hit(scene, looking_at(EYE, behind, 0.0), np.array([0.0, 0.0, 1.0]))
    assert first is not None and first[0] == pytest.approx(2.64)
    for corner in poster_corners():
        assert visible(scene, EYE, corner)


@pytest.mark.parametrize("camera", [PINHOLE, FISHEYE], ids=lambda c: c.name)
def test_coarse_culling_loses_no_surface(camera: Camera) -> None:
    scene = scene_of(TexturedRoom())
    rays = rays_of(camera, tuple(camera.calib0.tolist()))
    grey = [cv2.cvtColor(s.texture, cv2.COLOR_RGB2GRAY) for s in scene.surfaces]
    for target in ((2.6, 0.0, 0.8), (-2.4, 1.9, 0.5), (0.2, -2.2, 0.4)):
        pose = looking_at(EYE, np.array(target))
        image = look(scene, rays, pose)
        wrong = 0
        for v, u in np.random.default_rng(1).integers((2, 2), (238, 318), (150, 2)):
            place = hit(scene, pose, rays.d[:, v, u].astype(float))
            assert place is not None
            gap = [abs((place - s.corner) @ s.normal) for s in scene.surfaces]
            near = [i for i in np.argsort(gap)[:2] if gap[i] < 1e-6]
            patches = []
            for i in near:
                x, y = np.array([scene.right[i], scene.down[i]]) @ (place - scene.corner[i])
                a, b = max(round(y) - 12, 0), max(round(x) - 12, 0)
                patches.append(grey[i][a : a + 25, b : b + 25])
            low = min((int(p.min()) for p in patches if p.size), default=0)
            high = max((int(p.max()) for p in patches if p.size), default=255)
            wrong += not low - 3 <= image[v, u] <= high + 3
        assert wrong <= 1


def test_a_wide_lens_shows_what_is_behind_it_and_nothing_outside_its_circle() -> None:
    scene = scene_of(TexturedRoom())
    rays = rays_of(OMNI, tuple(OMNI.calib0.tolist()))
    image = photo(OMNI, scene, looking_at(EYE, np.array([0.0, 2.5, 1.3]), 0.0))
    behind = (rays.d[2] < -0.05) & (rays.shade > 0.0)
    outside = np.hypot(*(np.mgrid[:240, :320] - np.array([120, 160])[:, None, None])) > 155
    assert behind.sum() > 500 and outside.any()
    assert image[behind].mean() > 10.0
    assert (rays.shade[outside] == 0.0).all() and (image[outside] == 0).all()


def test_image_noise_and_gain_are_as_asked() -> None:
    scene = scene_of(TexturedRoom())
    pose = looking_at(EYE, np.array([0.0, 2.5, 1.3]))
    clean = photo(PINHOLE, scene, pose).astype(float)
    noisy = photo(PINHOLE, scene, pose, replace(STILL, noise=5.0)).astype(float)
    middle = (clean > 30) & (clean < 200)
    assert (noisy - clean)[middle].std() == pytest.approx(5.0, rel=0.03)
    dark = photo(PINHOLE, scene, pose, replace(STILL, gain=0.5)).astype(float)
    np.testing.assert_allclose(dark[middle], 0.5 * clean[middle], atol=1.5)


@pytest.mark.parametrize(("axis", "blurred"), [(1, 1), (0, 0)])
def test_motion_blurs_along_the_motion(axis: int, blurred: int) -> None:
    """A turn about the camera's y axis (down) smears along u, about its x axis along v."""
    scene, _ = checkered()
    now = looking_at(EYE, np.array([0.0, 2.5, 1.3]), 0.0)
    w = np.zeros(3)
    w[axis] = -1.0
    back = quaternion.from_rotation_vector(w / 30)[0]
    before = np.concatenate([now[:3], quaternion.product(now[3:], back)])
    rays = rays_of(PINHOLE, tuple(PINHOLE.calib0.tolist()))
    how = replace(STILL, exposure=0.02)
    sharp = photo(PINHOLE, scene, now).astype(float)
    smeared = render(scene, rays, now, before, 1 / 30, how, noise.rng(0, "photo")).astype(float)
    lost = [
        1.0 - np.square(np.diff(smeared, axis=a)).sum() / np.square(np.diff(sharp, axis=a)).sum()
        for a in (0, 1)
    ]
    assert lost[blurred] > 0.4
    assert abs(lost[1 - blurred]) < 0.2
    assert abs(smeared.mean() - sharp.mean()) < 1.0


def room(seed: int = 0) -> Simulation:
    robots = {"cam": TrueRobot(Impulse(), HandHeld())}
    mounts = {"camera": TrueMount(PINHOLE, "cam", (0, 0, 0, 1, 0, 0, 0))}
    return Simulation(TexturedRoom(), robots, mounts, dt=1 / 30, rendering=Rendering(), seed=seed)


def pixels(simulation: Simulation, frames: int) -> list[np.ndarray]:
    state, out = simulation.start(), []
    for k in range(frames):
        frame, state = simulation.advance(state, k)
        raw = frame.raw["camera"]
        assert isinstance(raw, Image)
        out.append(raw.pixels)
    return out


class Hall(SimulatedWorld):
    """A world of another class that has something to see."""

    name, space = "hall", THREE_D

    def points(self) -> tuple[np.ndarray, np.ndarray]:
        return TexturedRoom().points()

    def surfaces(self) -> tuple[Surface, ...]:
        return TexturedRoom().surfaces()


def test_any_world_with_surfaces_is_photographed() -> None:
    hall = replace(room(3), world=Hall())
    np.testing.assert_array_equal(pixels(hall, 2)[1], pixels(room(3), 2)[1])
    assert len(hall.surfaces()) == len(room().surfaces()) > 6
    with pytest.raises(SourceError, match="the hall has no place 'poster:0': it has none"):
        hall.appearance_of("poster:0")


def test_images_are_bit_identical_for_a_seed() -> None:
    a, b, c = pixels(room(3), 4), pixels(room(3), 4), pixels(room(4), 4)
    for x, y in zip(a, b, strict=True):
        np.testing.assert_array_equal(x, y)
    assert a[0].dtype == np.uint8 and a[0].shape == (240, 320) and not a[0].flags.writeable
    assert not np.array_equal(a[3], c[3])


def test_the_poster_is_found_by_its_known_corners() -> None:
    simulation = room()
    patches = tuple(simulation.appearance_of(f"poster:{i}") for i in range(4))
    state = simulation.start()
    for k in range(5):
        frame, state = simulation.advance(state, k)
    pose = simulation.true_pose("camera", state.xv)
    h = np.array([projected(PINHOLE, PINHOLE.calib0, pose, c) for c in poster_corners()])
    eye = np.tile(np.eye(2), (4, 1, 1))
    query = Query("camera", (1, 2, 3, 4), h + 1.0, 4.0 * eye, 9.0, patches, eye)
    for match, z in zip(simulation.search(frame, query, Vision()), h, strict=True):
        assert match.z is not None and match.true_z is not None
        np.testing.assert_allclose(match.true_z, z, atol=1e-9)
        assert np.linalg.norm(match.z - z) < 0.35


def test_detections_remember_where_they_really_are() -> None:
    simulation = room()
    frame, state = simulation.advance(simulation.start(), 0)
    pose = simulation.true_pose("camera", state.xv)
    found = simulation.detect(frame, "camera", Occupied(np.zeros((0, 2)), ()), 8, Vision())
    assert len(found) == 8
    for d in found:
        z = projected(PINHOLE, PINHOLE.calib0, pose, d.appearance.place)
        np.testing.assert_allclose(z, d.z, atol=1e-6)
    clicked = simulation.appearance_at(frame, "camera", found[0].z, Vision())
    assert clicked is not None
    np.testing.assert_allclose(clicked.appearance.place, found[0].appearance.place)
