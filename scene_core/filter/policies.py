"""Everything the estimator chooses, as parameters: selection, gate, update, map management."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from scene_core.models.base import FeatureModel
from scene_core.params import param


@dataclass(frozen=True)
class Selection:
    """Which features are worth measuring."""

    budget: int = param(10, lo=0, hi=1000, soft=(1, 40), label="Select, max")
    """At most this many features are measured by a sensor in a frame, largest score first."""
    score: Literal["trace", "determinant", "volume", "information"] = param(
        "trace", choices=("trace", "determinant", "volume", "information"), label="Score"
    )
    """What ranks them: the trace (SceneLib) or the determinant (the toolbox) of E = H P H', the
    volume 4/3 pi sqrt(det S) of the search region (Scene), or the information a measurement
    brings, 1/2 log2 det(S R^-1) bit: the only one that compares points with lines."""


@dataclass(frozen=True)
class Gate:
    """When a match may enter the update."""

    confidence: float = param(0.99, lo=0.5, hi=0.999999, soft=(0.9, 0.999), label="Confidence")
    """A match is accepted when d2 = nu' S^-1 nu lies below the chi-square quantile of this
    probability, with as many degrees of freedom as the measurement has numbers."""
    joint: bool = param(False, label="Joint")
    """Judge every match once more by all the others of its frame (stacked and iterated updates):
    one that slid along an edge may lie near its prediction and still disagree with the rest."""


@dataclass(frozen=True)
class Association:
    """How a feature finds its measurement."""

    kind: Literal["identity", "search"] = param(
        "identity", choices=("identity", "search"), label="Association"
    )
    """identity: measurements say whose they are. search: look inside the predicted ellipse."""
    search_sigma: float = param(3.0, lo=0.5, hi=10.0, soft=(1.0, 5.0), label="Search, sigma")
    """Half-width of the search ellipse, in standard deviations of S."""


@dataclass(frozen=True)
class Update:
    """How the accepted matches change the state."""

    kind: Literal["stacked", "sequential", "iterated"] = param(
        "stacked", choices=("stacked", "sequential", "iterated"), label="Update"
    )
    """stacked: one update with all matches. sequential: one after the other, h, H and S computed
    anew after each (the search is done once). iterated: stacked, linearised again where the first
    pass puts the sensor, the features staying as predicted."""
    iterations: int = param(2, lo=1, hi=20, soft=(1, 5), label="Linearisations")
    """How often the iterated update is linearised."""
    invariant: bool = param(False, label="Carry the axes")
    """An update that moves the map takes along how unsure the axes are that it is told in.
    Otherwise the filter believes to learn where they are, the more the less sure the robot was of
    its orientation and the better the sensor is. One more pass over the covariance per update;
    sequential: per match."""


@dataclass(frozen=True)
class Management:
    """When features are born, changed and forgotten.

    Forgetting as SceneLib does: 10 attempts, match ratio 0.5, accept ratio 0, known ones too; as
    the toolbox does: 10, 0.1, 0.5.
    """

    keep_visible: int = param(12, lo=0, hi=500, soft=(0, 60), label="In view, min")
    """New features are looked for when fewer than this many are measurable (0: never)."""
    max_new: int = param(1, lo=0, hi=100, soft=(0, 20), label="New per frame")
    """At most this many new features per sensor and frame."""
    max_new_first: int = param(1, lo=0, hi=200, soft=(0, 40), label="New in frame 0")
    """The same for the very first frame."""
    max_features: int = param(120, lo=1, hi=2000, soft=(10, 400), label="Map size, max")
    """No feature is added beyond this number."""
    min_attempts: int = param(10, lo=1, hi=1000, soft=(2, 40), label="Attempts, min")
    """A feature is judged only after this many searches."""
    min_match_ratio: float = param(0.5, lo=0.0, hi=1.0, label="Match ratio, min")
    """It is deleted when fewer of its searches found something."""
    min_accept_ratio: float = param(0.5, lo=0.0, hi=1.0, label="Accept ratio, min")
    """It is deleted when fewer of its matches passed the gate."""
    delete_known: bool = param(False, label="Delete known")
    """Whether features given at the start may be deleted too (SceneLib does)."""
    min_speed: float = param(0.0, unit="m/s", lo=0.0, hi=10.0, soft=(0.0, 1.0), label="Speed, min")
    """No automatic initialisation below this speed of the robot (SceneLib: 0.2)."""
    max_open: int = param(8, lo=1, hi=200, soft=(1, 30), label="Open, max")
    """At most this many features may be carried by particles at a time (SceneLib: 1)."""
    open_attempts: int = param(40, lo=1, hi=1000, soft=(5, 100), label="Open, attempts")
    """A feature whose particles have not collapsed after this many searches is given up."""
    extend_lines: bool = param(True, label="Extend lines")
    """A measured end that lies beyond a segment makes it longer; its line stays as it is."""


@dataclass(frozen=True)
class Vision:
    """How image patches are detected and matched; only used where the input is images."""

    patch_px: int = param(
        13, unit="px", lo=5, hi=41, soft=(7, 25), effect="next feature", label="Patch size"
    )
    """Side of the square template, odd."""
    ncc_min: float = param(0.8, lo=0.0, hi=1.0, soft=(0.5, 0.98), label="NCC, min")
    """A peak of the normalised cross-correlation below this is no match."""
    corner_min: float = param(8.0, lo=0.0, hi=1000.0, soft=(0.0, 40.0), label="Corner, min")
    """Smallest Shi-Tomasi score of a new feature: square root of the smaller eigenvalue of the
    mean gradient matrix over the patch, grey levels per pixel."""
    separation_px: int = param(14, unit="px", lo=1, hi=200, soft=(4, 60), label="Separation")
    """A new feature keeps this distance from all predicted ones."""
    border_px: int = param(16, unit="px", lo=1, hi=200, soft=(8, 60), label="Border")
    """No new feature nearer than this to the border of the image."""
    max_radius_px: int = param(60, unit="px", lo=4, hi=400, soft=(10, 120), label="Search, max")
    """An ellipse is not searched farther than this from its centre."""
    warp: bool = param(True, label="Warp patches")
    """Predict the patch's appearance from the change of view before searching."""
    subpixel: bool = param(True, label="Sub-pixel")
    """Interpolate the correlation peak."""


@dataclass(frozen=True)
class Policies:
    """All choices of the estimator, and the parametrisation of new features."""

    landmark: FeatureModel
    """How new points are kept."""
    selection: Selection = field(default_factory=Selection)
    association: Association = field(default_factory=Association)
    gate: Gate = field(default_factory=Gate)
    update: Update = field(default_factory=Update)
    management: Management = field(default_factory=Management)
    vision: Vision = field(default_factory=Vision)
    line: FeatureModel | None = None
    """How new lines are kept; none: lines are not mapped."""
