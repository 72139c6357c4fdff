"""A line as its Plücker coordinates in the world."""

from __future__ import annotations

from dataclasses import dataclass

from scene_core.arrays import Vec
from scene_core.models import plucker
from scene_core.models.base import Initialised, Normalised, Primitive, Redefined
from scene_core.models.straight_line import StraightLine, cut, evenly


@dataclass(frozen=True)
class PluckerLine(StraightLine):
    """The normal of the plane through origin and line, and the line's direction: y = (n, v)

    y = (nx, ny, nz, vx, vy, vz) [1, 1/m], n = p x v for every point p of the line, n . v = 0, which
    is imposed again after every update. From a view r1, r2 of both ends in a sensor at (R, t)
    n = R (r1 x r2) + t x v, v = R (rho1 r2 - rho2 r1), both divided by |r1 x r2|: the scale is that
    of the first view, where |v| is the inverse distance. Linear in rho, which a first view leaves
    to the prior N(rho_mean, rho_sd^2); v = 0 is a line at infinity. t counts metres from the
    point nearest to the origin.

    Over-confident from a first view, as "homogeneous point" is and for the same reason: n is
    linearised at the prior's v, so it hardly depends on the error of t, and that stays forgotten
    when |v| grows to what it is: NEES 207 round the house (5 seeds, 400 frames) for 7.3 with an
    anchor, and 14 with updates that carry the axes along (`Update.invariant`).

    The toolbox has 51 with its choices; so chosen it was 41 here (4 seeds, from 23 to 57, in a
    house with other openings, in which this model had 233): segments that do not grow
    (`extend_lines` off: 85 by that alone), its prior of v, and no constraint. The longer a line is
    seen, the more that was forgotten counts as known. The constraint by itself is not to blame (as
    bad without it), nor the order of updates (90 iterated), nor the prior (269 for .2 +- .1 1/m).
    An anchor until |v| is known does help: "anchored Plücker line" that becomes this one at
    linearity .1 has 7.9, at .5 24.

    Source: Solà, Vidal-Calleja, Civera, Montiel, *Impact of landmark parametrization on monocular
    EKF-SLAM with points and lines*, IJCV 2012, "PL"; the toolbox's landmark "plkLin".
    """

    name = "Plücker line"
    state_labels = ("nx", "ny", "nz", "vx", "vy", "vz")
    state_units = ("", "", "", "1/m", "1/m", "1/m")
    shown = (-1.0, 1.0)

    def initialise(self, xws: Vec, X: Vec) -> Initialised:
        """The line seen by the sensor at xws, at a unit normal there, moved to the world."""
        in_sensor, by_X = plucker.join(X)
        scaled, by_L = plucker.unit_normal(in_sensor)
        seen = plucker.to_world(xws, scaled)
        return Initialised(seen.L, seen.by_xp, seen.by_L @ by_L @ by_X)

    def primitive(self, y: Vec) -> Primitive:
        L, by_y = plucker.orthogonal(y)
        X, by_L = plucker.pair(L)
        return Primitive(X, by_L @ by_y)

    def redefine(self, y: Vec, xpdef: Vec) -> Redefined:
        seen = plucker.to_local(xpdef, y)
        return Redefined(seen.L, seen.by_L, seen.by_xp)

    def normalise(self, y: Vec) -> Normalised:
        return Normalised(*plucker.orthogonal(y))

    def ends(self, y: Vec, t: Vec) -> Vec:
        return evenly(plucker.metres(y), t)

    def along(self, y: Vec, origin: Vec, rays: Vec) -> Vec:
        return cut(plucker.metres(y), origin, rays)
