"""A simulated experiment: true robots, sensors and landmarks that the estimator never sees.

Nothing here is shared with the estimator's settings: a model can be made wrong on purpose. The
rule of a frame: first the true robots move over dt, then the sensors measure where they are now.
Frame 0 is measured at the start, with dt = 0 and no controls.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from scene_core.arrays import Vec, frozen
from scene_core.filter.policies import Vision
from scene_core.filter.ports import (
    Control,
    Detection,
    Frame,
    Image,
    Match,
    Occupied,
    Points,
    Query,
    Raw,
    SourceError,
)
from scene_core.geometry.embedding import embed
from scene_core.models.base import MotionModel, Sensor
from scene_core.params import param
from scene_core.sources import markers, noise, pictures, points, segments
from scene_core.sources.identified import Outlook
from scene_core.sources.moving import moved
from scene_core.sources.render import Rendering
from scene_core.sources.segments import LineOutlook, measures_lines
from scene_core.sources.surface import Surface
from scene_core.sources.terrain import on_ground
from scene_core.sources.truth import (
    Disturbances,
    SimulationState,
    TrueInstrument,
    TrueMarker,
    TrueMount,
    TrueRobot,
    check_mounts,
    check_robots,
    retold,
    told,
)
from scene_core.sources.wheel import check_drivers
from scene_core.sources.worlds import SimulatedWorld, in_axes, landmarks, lines


@dataclass(frozen=True)
class Simulation:
    """A world that is computed; implements the port `Source`."""

    world: SimulatedWorld
    robots: Mapping[str, TrueRobot]
    mounts: Mapping[str, TrueMount]
    instruments: Mapping[str, TrueInstrument] = field(default_factory=dict)
    markers: Mapping[str, TrueMarker] = field(default_factory=dict)
    disturbances: Disturbances = field(default_factory=Disturbances)
    """For points and segments with identities."""
    rendering: Rendering | None = None
    """Cameras deliver images of the world, which must be a room; None: points with identities."""
    dt: float = param(0.1, unit="s", lo=1e-4, hi=100.0, effect="on reset", label="Frame time")
    """Seconds between frames."""
    up: str = param("z", choices=("z", "y"), effect="on reset")
    """Which world axis points up."""
    seed: int = 0
    """Every random number is keyed by this, its purpose and the frame."""

    @property
    def frame_count(self) -> int | None:
        return None

    @property
    def frame_rate(self) -> float:
        return 1.0 / self.dt

    def start(self) -> SimulationState:
        self._check()
        xv = {
            i: frozen(self._settled(robot, robot.drawn(i, self.dt, self.seed)))
            for i, robot in self.robots.items()
        }
        memory = {i: robot.driver.memory0() for i, robot in self.robots.items()}
        return SimulationState(xv, memory, xv, self._motions())

    def advance(self, state: SimulationState, index: int) -> tuple[Frame, SimulationState]:
        controls: dict[str, tuple[Control, ...]] = {}
        state = retold(state, self._motions())
        if index > 0:
            state, controls = self._moved(state, index)
        raw: dict[str, Raw] = {
            i: self._measured(i, state, index)
            for i, mount in self.mounts.items()
            if mount.fires(index)
        }
        frame = Frame(
            index=index,
            time=index * self.dt,
            dt=self.dt if index > 0 else 0.0,
            controls=controls,
            raw=raw,
            internal={i: self._felt(i, state, index) for i in self.instruments},
            truth=told(self.world, self.up, self.robots, self.mounts, state, self.seed),
        )
        return frame, state

    def search(self, frame: Frame, query: Query, vision: Vision) -> Sequence[Match]:
        raw = frame.raw[query.mount]
        if isinstance(raw, Image):
            sensor, calib, pose = self._camera(query.mount, self.true_states(frame))
            return pictures.searched(raw, query, vision, sensor, calib, pose)
        xv, sensor = self.true_states(frame), self.mounts[query.mount].sensor
        if query.shape == "segment":
            outlook = self.line_outlook(query.mount, xv)
            ids, h = outlook.ids[outlook.parts.rows], outlook.parts.h
            found = segments.match_lines(raw, query)
        else:
            outlook = self.outlook(query.mount, xv)
            ids, h = outlook.ids, outlook.h
            found = points.match_points(raw, query, lambda h, z: sensor.nu(h, z).nu)
        row = {int(identity): k for k, identity in enumerate(ids)}
        return [
            match if match.z is None else replace(match, true_z=h[row[int(identity)]])
            for match, identity in zip(found, query.appearance, strict=True)
        ]

    def detect(
        self, frame: Frame, mount: str, occupied: Occupied, count: int, vision: Vision
    ) -> Sequence[Detection]:
        raw, m = frame.raw[mount], self.mounts[mount]
        if isinstance(raw, Image):
            key, where = (self.seed, frame.index), self._view(mount, self.true_states(frame))
            return pictures.detected(raw, occupied.h, count, vision, key, where)
        if occupied.shape == "segment":
            return segments.detect_lines(raw, occupied, count, m.shortest)
        return points.detect_identities(raw, occupied, count, m.margin, m.sensor.limits)

    def appearance_at(self, frame: Frame, mount: str, z: Vec, vision: Vision) -> Detection | None:
        """The patch at z, or the measured point nearest to z within a twentieth of the range."""
        raw, sensor = frame.raw[mount], self.mounts[mount].sensor
        if isinstance(raw, Image):
            where = self._view(mount, self.true_states(frame))
            return pictures.pointed_at(raw, z, vision, where)
        found = points.nearest_identity(raw, z)
        span = np.array([high - low for low, high in sensor.limits])
        if found is None:
            return None
        there = np.concatenate([z, found.z[len(z) :]])
        if np.linalg.norm(sensor.nu(there, found.z).nu / span) > 0.05:
            return None
        return found

    def appearance_of(self, known: Any) -> Any:
        """What recognises a landmark given at the start: an identity as it is; a place of the room
        by name ("poster:0" to "poster:3") by its patch in the first image."""
        if self.rendering is None or not isinstance(known, str):
            return known
        place = pictures.known_places(pictures.photographable(self.world), [known])[known]
        state = self.start()
        frame, _ = self.advance(state, 0)
        for mount, raw in frame.raw.items():
            if isinstance(raw, Image):
                camera = self._camera(mount, state.xv)
                return pictures.patch_of(raw, place, known, *camera, Vision())
        raise SourceError(f"no camera takes a first image of the known landmark '{known}'")

    def surfaces(self) -> tuple[Surface, ...]:
        """Textured rectangles for the map; none in a world of points."""
        return self.world.surfaces()

    def outline(self) -> Vec:
        """Segments (M, 2, 3) in world axes that show the place on the map."""
        return in_axes(self.world, self.world.outline(), self.up)

    def true_pose(self, mount: str, xv: Mapping[str, Vec]) -> Vec:
        """Pose x_WS of a sensor when the robots are truly at xv, in the sensor's space."""
        m = self.mounts[mount]
        motion, space = self.robots[m.robot].motion, m.sensor.space
        xp = motion.xp(xv[m.robot], m.hook).xp
        if motion.space is not space:
            xp = embed(xp, motion.space, self.up, space)[0]
        return space.compose(xp, np.array(m.pose, dtype=float)).x

    def outlook(self, mount: str, xv: Mapping[str, Vec]) -> Outlook:
        """The landmarks, and the markers on other hooks, as a sensor truly sees them when the
        robots are at xv."""
        sensor, calib, pose = self._camera(mount, xv)
        seen_from = (self.mounts[mount].robot, self.mounts[mount].hook)
        at = markers.places(self.markers, self.robots, xv, seen_from, sensor.space, self.up)
        return Outlook(self.world, self.up, sensor, calib, pose, at)

    def line_outlook(self, mount: str, xv: Mapping[str, Vec]) -> LineOutlook:
        """The line landmarks as a camera truly sees them when the robots are at xv."""
        shortest = self.mounts[mount].shortest
        return LineOutlook(self.world, self.up, *self._camera(mount, xv), shortest)

    def true_states(self, frame: Frame) -> Mapping[str, Vec]:
        """States xv of the true robots in a frame, from its truth."""
        labels = frame.truth.labels if frame.truth else {}
        return {
            i: np.array([labels[f"robot:{i}"][s] for s in robot.motion.state_labels])
            for i, robot in self.robots.items()
        }

    def _motions(self) -> Mapping[str, MotionModel]:
        return {i: robot.motion for i, robot in self.robots.items()}

    def _settled(self, robot: TrueRobot, xv: Vec) -> Vec:
        """A true state on its constraint, and on the ground where the robot is kept there."""
        xv = robot.motion.normalise(xv).value
        return on_ground(self.world, self.up, robot.motion, xv) if robot.on_ground else xv

    def _moved(
        self, state: SimulationState, index: int
    ) -> tuple[SimulationState, dict[str, tuple[Control, ...]]]:
        """The state after the interval before frame `index`, and the controls as reported."""
        xv, memory, controls = {}, {}, {}
        for i, robot in self.robots.items():
            after = moved(robot, i, state.xv[i], state.memory[i], index, self.dt, self.seed)
            xv[i] = frozen(self._settled(robot, after.xv))
            memory[i] = after.memory
            if labels := robot.motion.control_labels:
                controls[i] = (Control(self.dt, labels, frozen(after.u)),)
        return replace(state, xv=xv, memory=memory, before=state.xv), controls

    def _check(self) -> None:
        """Refuses what can not be simulated together, and a world that can not be read."""
        landmarks(self.world)
        check_robots(self.robots)
        check_drivers(self.robots)
        known = (*landmarks(self.world)[0], *lines(self.world).ids)
        markers.check(self.markers, self.robots, known)
        check_mounts(self.mounts, self.robots)
        for i, part in (*self.robots.items(), *self.mounts.items()):
            part.true_calib(i, self.seed)
        if self.rendering is not None:
            pictures.photographable(self.world)
        if self.rendering is not None and self.markers:
            raise SourceError(
                "source.markers: rendered pictures show no markers; leave out either of them"
            )

    def _camera(self, mount: str, xv: Mapping[str, Vec]) -> tuple[Sensor, Vec, Vec]:
        """A sensor, its true calibration and its true pose."""
        m = self.mounts[mount]
        return m.sensor, m.true_calib(mount, self.seed), self.true_pose(mount, xv)

    def _view(self, mount: str, xv: Mapping[str, Vec]) -> tuple[SimulatedWorld, Sensor, Vec, Vec]:
        """What is photographed, and by which camera from where."""
        return pictures.photographable(self.world), *self._camera(mount, xv)

    def _measured(self, mount: str, state: SimulationState, index: int) -> Raw:
        sensor, calib, now = self._camera(mount, state.xv)
        # A picture tells nothing but pixels.
        if self.rendering is None or sensor.labels != ("u", "v"):
            return self._listed(mount, state, index)
        return pictures.photographed(
            pictures.photographable(self.world),
            sensor,
            calib,
            (self.true_pose(mount, state.before), now),
            self.dt,
            self.rendering,
            (self.seed, f"image:{mount}", index),
        )

    def _listed(self, mount: str, state: SimulationState, index: int) -> Points:
        """Measurements with identities, of segments too where a camera has some to look at."""
        key = (self.seed, mount, index)
        found = self.outlook(mount, state.xv).measured(self.disturbances, key)
        if len(lines(self.world).ids) == 0 or not measures_lines(self.mounts[mount].sensor):
            return found
        seen = self.line_outlook(mount, state.xv).measured(self.disturbances, key)
        return replace(found, lines=seen)

    def _felt(self, name: str, state: SimulationState, index: int) -> Vec:
        """An internal measurement of the true state."""
        instrument = self.instruments[name]
        labels = self.robots[instrument.robot].motion.state_labels
        missing = [s for s in instrument.model.needs if s not in labels]
        if missing:
            raise SourceError(
                f"instrument '{name}' needs the state component '{missing[0]}', which the true "
                f"robot '{instrument.robot}' does not have: its state is {', '.join(labels)}"
            )
        needed = state.xv[instrument.robot][[labels.index(s) for s in instrument.model.needs]]
        return frozen(instrument.model.h_noisy(needed, noise.rng(self.seed, f"felt:{name}", index)))
