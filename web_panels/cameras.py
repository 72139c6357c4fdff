"""The 3-D camera of every browser: its own, kept over a reload, moved by the view buttons."""

from __future__ import annotations

import asyncio
import json
import logging
import math
import time
from collections import defaultdict, deque
from collections.abc import Iterable
from functools import partial

import numpy as np
import viser

from scene_core.arrays import Vec
from scene_core.geometry import quaternion
from web_panels.map_geometry import Bounds
from web_panels.panel import View
from web_panels.viewpoints import FOV, all_in_sight, directions

log = logging.getLogger(__name__)

SAVE_AFTER_S = 0.5
NARROWEST = 0.4
"""No view backs away farther than for a canvas of this aspect."""
ORBIT_RATE = math.radians(12.0)
CLOSE, FAR = 1.06, 1.25
"""Of how far away all of the map is just in sight. One stands close to a simulated place, whose
walls say where one is, and farther from a cloud of points."""
UNTOLD = np.array([3.0, 3.0, 3.0])
"""Where viser puts a browser that was not told where to begin."""
_last_places = partial(deque[Vec], maxlen=6)


class Cameras:
    """Moves browsers' cameras; the view thread calls `place` and `move`, buttons call `ask`."""

    def __init__(self, server: viser.ViserServer) -> None:
        self.server = server
        self.run_name = ""
        self.bounds: Bounds | None = None
        self.up = "z"
        self.margin = CLOSE
        self.modes: dict[int, View] = {}
        self.in_the_way: tuple[str, ...] = ()
        """Nodes hidden from who looks through the sensor's eye: the frusta with their images."""
        self.eye_fov = FOV
        """Vertical field of view of the sensor, rad."""
        self._hidden: dict[int, list[viser.FrameHandle]] = {}
        self._asked: dict[int, View] = {}
        self._aspects: dict[int, float] = {}
        """Width over height of the canvas each browser's view was last fitted to."""
        self._starts = _last_places()
        self._fits: dict[int, deque[Vec]] = defaultdict(_last_places)
        """Where browsers were put to see all of the map, at first and by their numbers; a late
        report may tell of any of them."""
        self._own: dict[int, tuple[Vec, Vec]] = {}
        """What browsers had kept and were given back: position and target. The start may reach one
        of them later, and the report that it stands there."""
        self._resized: set[int] = set()
        self._last: Vec | None = None
        self._when = time.monotonic()
        self._saving: dict[int, asyncio.TimerHandle] = {}
        server.on_client_connect(self._connected)
        server.on_client_disconnect(self._gone)

    def ask(self, client: viser.ClientHandle, view: View) -> None:
        """A browser wants another view; done by the view thread. Asking for what moves already
        stops it."""
        if self.modes.pop(client.client_id, None) != view:
            self._asked[client.client_id] = view
        elif view == "eye":
            self._asked[client.client_id] = "perspective"

    def place(self, name: str, bounds: Bounds, up: str) -> None:
        """Another run: new browsers start with its perspective, present ones too when the scenario
        is another."""
        changed = (name, up) != (self.run_name, self.up)
        self.run_name, self.bounds, self.up, self._last = name, bounds, up, None
        if changed:
            self._starts.clear()
            self._fits.clear()
        self._start_at(bounds)
        if changed:
            self.modes.clear()
            self._own.clear()
            for client in self.server.get_clients().values():
                self._hide(client, False)
                self._fit(client, bounds)

    def _start_at(self, bounds: Bounds) -> None:
        """Say all of it each time, the position first: a browser goes by what it has heard when the
        first word of it comes, and the rest may come much later."""
        position, target = self._standing("perspective", bounds)
        start = self.server.initial_camera
        start.position, start.look_at = position, target
        start.up, start.fov = self._up(), FOV
        self._starts.append(position)

    def refit(self, bounds: Bounds) -> None:
        """The map has outgrown its bounds: new browsers see all of it, and those that never moved
        their camera."""
        self.bounds = bounds
        self._start_at(bounds)
        for client in self.server.get_clients().values():
            self._refit(client, bounds)

    def _refit(self, client: viser.ClientHandle, bounds: Bounds) -> None:
        """Fit a view that was never moved to other bounds or to a canvas of another shape."""
        if not self._is_fitted(client, bounds):
            return
        own = self._own.get(client.client_id)
        if own is None:
            self._fit(client, bounds)
        else:
            self._set(client, *own)

    def _is_fitted(self, client: viser.ClientHandle, bounds: Bounds) -> bool:
        """Whether a browser's camera is where it was put to see all of the map."""
        known = (UNTOLD, *self._starts, *self._fits[client.client_id])
        return is_at(client.camera, known, bounds)

    def _is_new(self, client: viser.ClientHandle, bounds: Bounds) -> bool:
        """Whether a browser's camera is where new ones begin, and not where it was put: it may
        hear of the one after the other, whatever was said first."""
        fits = tuple(self._fits[client.client_id])[-1:]
        starts = (UNTOLD, *self._starts)
        return is_at(client.camera, starts, bounds) and not is_at(client.camera, fits, bounds)

    def _fit(self, client: viser.ClientHandle, bounds: Bounds) -> None:
        """Show a browser all of the map, in a canvas of the shape that it told last."""
        aspect = self._aspects[client.client_id] = aspect_of(client.camera)
        position, target = self._standing("perspective", bounds, aspect)
        self._fits[client.client_id].append(position)
        self._set(client, position, target)

    def _up(self) -> Vec:
        return np.array([0.0, 1.0, 0.0] if self.up == "y" else [0.0, 0.0, 1.0])

    def _standing(self, view: str, bounds: Bounds, aspect: float = 1.0) -> tuple[Vec, Vec]:
        """Where to stand and look at, to see all of the map in a canvas of this aspect."""
        d = directions(self.up)[view]
        d = d / np.linalg.norm(d)
        away = max(self.margin * all_in_sight(bounds, d, self._up(), aspect), bounds.radius)
        return bounds.centre + away * d, bounds.centre

    def _set(self, client: viser.ClientHandle, position: Vec, target: Vec) -> None:
        with client.atomic():
            client.camera.up_direction = self._up()
            client.camera.position = position
            client.camera.look_at = target

    def _hide(self, client: viser.ClientHandle, hide: bool) -> None:
        """Lay empty nodes of this browser alone over what is in the way, or take them away."""
        for handle in self._hidden.pop(client.client_id, []):
            handle.remove()
        if hide:
            self._hidden[client.client_id] = [
                client.scene.add_frame(name, show_axes=False) for name in self.in_the_way
            ]

    def move(self, robot: Vec, eye: Vec | None, bounds: Bounds) -> None:
        """Serve what was asked for, then carry the cameras that move along."""
        now = time.monotonic()
        dt, self._when = min(now - self._when, 0.2), now
        clients = self.server.get_clients()
        for client_id in list(self._asked):
            view = self._asked.pop(client_id)
            self.modes.pop(client_id, None)
            if client_id in clients:
                self._begin(clients[client_id], view, robot, bounds)
        while self._resized:
            client = clients.get(self._resized.pop())
            if client is not None and self.bounds is not None:
                self._refit(client, self.bounds)
        step = np.zeros(3) if self._last is None else robot - self._last
        self._last = robot.copy()
        for client_id, view in list(self.modes.items()):
            client = clients.get(client_id)
            if client is not None:
                self._carry(client, view, step, eye, dt)

    def _begin(self, client: viser.ClientHandle, view: View, robot: Vec, bounds: Bounds) -> None:
        self._own.pop(client.client_id, None)
        self._hide(client, view == "eye")
        client.camera.fov = self.eye_fov if view == "eye" else FOV
        if view in ("perspective", "top", "side"):
            self._set(client, *self._standing(view, bounds, aspect_of(client.camera)))
            return
        self.modes[client.client_id] = view
        if view == "follow":
            offset = client.camera.position - client.camera.look_at
            self._set(client, robot + offset, robot)

    def _carry(
        self, client: viser.ClientHandle, view: View, step: Vec, eye: Vec | None, dt: float
    ) -> None:
        camera = client.camera
        if view == "follow" and np.any(step):
            self._set(client, camera.position + step, camera.look_at + step)
        elif view == "eye" and eye is not None:
            R = quaternion.matrix(eye[3:])
            with client.atomic():
                camera.up_direction = -R[:, 1]
                camera.position = eye[:3]
                camera.look_at = eye[:3] + R[:, 2]
        elif view == "orbit":
            turn = quaternion.from_rotation_vector(ORBIT_RATE * dt * self._up())[0]
            arm = quaternion.matrix(turn) @ (camera.position - camera.look_at)
            self._set(client, camera.look_at + arm, camera.look_at)

    @property
    def moving(self) -> bool:
        """Whether some camera moves by itself or waits to be moved."""
        return bool(self._asked or self._resized) or "orbit" in self.modes.values()

    def _connected(self, client: viser.ClientHandle) -> None:
        """Give a browser that was here before its camera back (on a thread of viser's pool)."""
        try:
            text = client.local_storage.get_item("scene-camera", timeout=5.0)
        except (RuntimeError, TimeoutError) as why:
            log.info("camera of a browser not restored: %s", why)
            text = None
        kept = read_camera(text, self.run_name)
        if kept is not None:
            self._own[client.client_id] = kept
            self._set(client, *kept)
        self._resized.add(client.client_id)
        client.camera.on_update(self._remember)

    async def _remember(self, camera: viser.CameraHandle) -> None:
        """Keep the camera once it has come to rest, or now and then while it moves."""
        client = camera.client
        resized = abs(aspect_of(camera) / self._aspects.get(client.client_id, 1.0) - 1.0) > 0.01
        if resized or (self.bounds is not None and self._is_new(client, self.bounds)):
            self._resized.add(client.client_id)
        if client.client_id not in self._saving:
            loop = asyncio.get_running_loop()
            self._saving[client.client_id] = loop.call_later(SAVE_AFTER_S, self._save, client)

    def _save(self, client: viser.ClientHandle) -> None:
        del self._saving[client.client_id]
        if self.bounds is not None and self._is_fitted(client, self.bounds):
            if client.client_id not in self._own:
                client.local_storage.set_item("scene-camera", "null")
            return
        kept = {
            "run": self.run_name,
            "position": [round(float(v), 4) for v in client.camera.position],
            "look_at": [round(float(v), 4) for v in client.camera.look_at],
        }
        client.local_storage.set_item("scene-camera", json.dumps(kept))

    async def _gone(self, client: viser.ClientHandle) -> None:
        books = (self.modes, self._asked, self._hidden, self._aspects, self._fits, self._own)
        for book in books:
            book.pop(client.client_id, None)
        timer = self._saving.pop(client.client_id, None)
        if timer is not None:
            timer.cancel()


def is_at(camera: viser.CameraHandle, places: Iterable[Vec], bounds: Bounds) -> bool:
    """Whether a camera is at one of the places (3,), as exactly as browsers tell."""
    near = 1e-3 * bounds.radius
    return any(float(np.linalg.norm(camera.position - place)) < near for place in places)


def aspect_of(camera: viser.CameraHandle) -> float:
    """Width over height of the canvas, held at `NARROWEST` while next to nothing of it shows."""
    return max(camera.image_width / max(camera.image_height, 1), NARROWEST)


def read_camera(text: str | None, run_name: str) -> tuple[Vec, Vec] | None:
    """Position and target kept by a browser for this scenario; None when there are none."""
    if text is None:
        return None
    try:
        kept = json.loads(text)
        if kept["run"] != run_name:
            return None
        position = np.array(kept["position"], dtype=np.float64)
        target = np.array(kept["look_at"], dtype=np.float64)
    except (ValueError, TypeError, KeyError):
        return None
    sound = position.shape == target.shape == (3,) and np.isfinite([position, target]).all()
    return (position, target) if sound and np.linalg.norm(position - target) > 1e-6 else None
