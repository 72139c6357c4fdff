"""Settings as they are edited: undo and redo, and what a command makes of an experiment."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any

from scene_core import params
from scene_core.params import ParamError
from scene_core.session.commands import Redo, ResetParams, SetParam, SetParams, SwapModel, Undo
from scene_core.session.config import Experiment
from scene_core.session.frame_end import Deed
from scene_core.session.roles import swapped
from scene_core.session.simulated_roles import check_truth

Edit = SetParam | SetParams | SwapModel | Undo | Redo | ResetParams
Steps = tuple[Experiment | Deed, ...]
UNDO_STEPS = 100


@dataclass(frozen=True)
class Settings:
    """An experiment with the edits that led to it: a value, so that stepping back restores it."""

    experiment: Experiment
    past: Steps = ()
    """What undo goes back to, or takes back, oldest first."""
    future: Steps = ()
    """What redo goes forward to, or does again, next one last."""
    path: str = ""
    """The parameter the last edit was about: more edits of it in one gesture are one step."""
    gestures: tuple[tuple[str, Experiment], ...] = ()
    """Gestures with a name, and the step of `past` that takes all of each back: a key may be held
    while a slider is moved."""

    def edited(self, experiment: Experiment, path: str = "", same_step: bool = False) -> Settings:
        """After one more edit; `same_step` merges it with the last one for undo."""
        past = self.past if same_step else _latest((*self.past, self.experiment))
        return replace(self, experiment=experiment, past=past, future=(), path=path)

    def moved(self, experiment: Experiment, values: Mapping[str, Any], gesture: str) -> Settings:
        """After one more edit of a gesture with a name. What was done since it began keeps its
        steps, but none of them goes back to what the gesture has left behind."""
        began = dict(self.gestures).get(gesture)
        at = [i for i, step in enumerate(self.past) if step is began]
        if began is None or not at:
            if not params.changed(experiment, self.experiment):
                return replace(self, future=_with(self.future, values))
            after = self.edited(experiment)
            open_ones = [(name, e) for name, e in self.gestures if any(e is s for s in after.past)]
            return replace(after, gestures=(*open_ones, (gesture, self.experiment)))
        before, meanwhile = self.past[: at[0]], self.past[at[0] + 1 :]
        later = _with(meanwhile, values)
        pairs = zip(meanwhile, later, strict=True)
        now = {id(old): new for old, new in pairs if not isinstance(new, Deed)}
        others = tuple((name, now.get(id(e), e)) for name, e in self.gestures if name != gesture)
        first = next(s for s in (*later, experiment) if not isinstance(s, Deed))
        if params.changed(first, began):
            kept, gestures = (*before, began, *later), (*others, (gesture, began))
        else:
            # Whoever lets go of all keys is where they began: of that nothing is left to undo.
            kept, gestures = (*before, *later), others
            experiment = began if first is experiment else experiment
        return Settings(experiment, kept, gestures=gestures)

    def after(self, deed: Deed) -> Settings:
        """After something that changes no setting, but can be undone."""
        return replace(self, past=(*self.past, deed), future=(), path="")

    @property
    def undoes(self) -> Experiment | Deed | None:
        """What undo goes back to, or takes back."""
        return self.past[-1] if self.past else None

    @property
    def redoes(self) -> Experiment | Deed | None:
        """What redo goes forward to, or does again."""
        return self.future[-1] if self.future else None

    def undone(self) -> Settings:
        if not self.past:
            raise ParamError("nothing to undo: nothing was changed")
        *past, last = self.past
        if isinstance(last, Deed):
            return self._standing(self.experiment, past, (*self.future, last))
        return self._standing(last, past, (*self.future, self.experiment))

    def redone(self) -> Settings:
        if not self.future:
            raise ParamError("nothing to redo: nothing was undone")
        *future, last = self.future
        if isinstance(last, Deed):
            return self._standing(self.experiment, (*self.past, last), future)
        return self._standing(last, (*self.past, self.experiment), future)

    def _standing(
        self,
        now: Experiment,
        past: Iterable[Experiment | Deed],
        future: Iterable[Experiment | Deed],
    ) -> Settings:
        return replace(self, experiment=now, past=tuple(past), future=tuple(future), path="")

    def without_deeds(
        self, gone: Callable[[Deed], bool], not_again: Callable[[Deed], bool]
    ) -> Settings:
        """Without deeds there is nothing of to undo, nor those that can not be done again; the
        same object when there are none."""
        past = tuple(s for s in self.past if not (isinstance(s, Deed) and gone(s)))
        future = tuple(s for s in self.future if not (isinstance(s, Deed) and not_again(s)))
        if len(past) == len(self.past) and len(future) == len(self.future):
            return self
        return replace(self, past=past, future=future)

    def with_deeds(self, deeds: Sequence[Deed]) -> Settings:
        """With all of these in what there is to undo, each before those that came later; the same
        object when they are there."""
        missing = [deed for deed in deeds if deed not in self.past]
        if not missing:
            return self
        past = list(self.past)
        for deed in reversed(missing):
            later = [past.index(d) for d in deeds[deeds.index(deed) + 1 :] if d in past]
            past.insert(min(later, default=len(past)), deed)
        return replace(self, past=tuple(past))

    def edits_only(self) -> Settings:
        """For another run, in which nothing was done yet."""
        return self.without_deeds(lambda _: True, lambda _: True)


def _latest(past: Steps) -> Steps:
    """Without the oldest edits, when there are too many. What was done at the end of a frame stays:
    it is in the log as long as the frame is."""
    edits = [i for i, step in enumerate(past) if not isinstance(step, Deed)]
    forgotten = edits[: max(0, len(edits) - UNDO_STEPS)]
    return tuple(step for i, step in enumerate(past) if i not in forgotten)


def _with(steps: Steps, values: Mapping[str, Any]) -> Steps:
    """Steps of undo, with these parameters as they are now where there are any."""
    return tuple(
        step
        if isinstance(step, Deed)
        else params.replace_all(step, {p: v for p, v in values.items() if _has(step, p)})
        for step in steps
    )


def _has(experiment: Experiment, path: str) -> bool:
    """Whether there is such a parameter; with another model there may be none."""
    try:
        params.get(experiment, path)
    except ParamError:
        return False
    return True


def set_param(experiment: Experiment, path: str, value: object) -> Experiment:
    """The experiment with one validated parameter changed; the path starts with estimator or
    source."""
    return set_params(experiment, {path: value})


def set_params(experiment: Experiment, values: Mapping[str, object]) -> Experiment:
    """The same with several parameters, which take effect together."""
    for path in values:
        if path.partition(".")[0] not in ("estimator", "source"):
            raise ParamError(
                f"'{path}' is no parameter of the estimator or of the source: it starts with "
                "estimator. or source."
            )
    after = params.replace_all(experiment, values)
    if any(path.startswith(("source.robots.", "source.mounts.")) for path in values):
        check_truth(after)
    return after


def values_of(command: Edit) -> Mapping[str, Any]:
    """The parameters an edit sets, by path; none for an edit of another kind."""
    match command:
        case SetParam(path, value):
            return {path: value}
        case SetParams(values):
            return dict(values)
        case _:
            return {}


def gesture_of(command: Edit) -> str:
    """The name of the gesture an edit is a part of; empty where it has none."""
    return command.gesture if isinstance(command, SetParam) else ""


def edited(
    before: Settings, base: Experiment, command: Edit, same_gesture: bool
) -> tuple[Settings, str]:
    """The settings a command leads to, and a sentence about it; `base` is the scenario's own
    experiment. Edits of the same parameters in one gesture, and those of one gesture with a name,
    are one step for undo."""
    match command:
        case SetParam() | SetParams():
            values = values_of(command)
            after, paths = set_params(before.experiment, values), " ".join(sorted(values))
            if gesture := gesture_of(command):
                return before.moved(after, values, gesture), ""
            return before.edited(after, paths, same_gesture and before.path == paths), ""
        case SwapModel(role, name):
            after, note = swapped(before.experiment, base, role, name)
            return before.edited(after), note
        case Undo():
            return before.undone(), "last edit undone"
        case Redo():
            return before.redone(), "edit done again"
        case ResetParams():
            now = before.experiment
            after = replace(base, seed=now.seed, frames=now.frames)
            return before.edited(after), "all parameters as the scenario has them"


def until_reset(edited: Experiment, started: Experiment) -> Experiment:
    """The edited experiment with those parameters that act on reset as they were at the start, and
    the world of a simulation, which stays the one the run began in.

    A model that was not there at the start has its own values. The same object when nothing has
    to be held back.
    """
    world, was = (getattr(e.source, "world", None) for e in (edited, started))
    if type(world) is not type(was):
        edited = params.put(edited, "source.world", was)
    for spec, before in params.changed(edited, started):
        if spec.effect == "on reset" and before is not None:
            owner = spec.path.rpartition(".")[0]
            if type(params.get(edited, owner)) is type(params.get(started, owner)):
                edited = params.put(edited, spec.path, before.value)
    return edited


def waits(running: Experiment, edited: Experiment, path: str) -> bool:
    """Whether a parameter has not its edited value yet; that of a world the run did not begin in is
    not even there."""
    return not _has(running, path) or params.get(running, path) != params.get(edited, path)


def uses(settings: Any, model: type[Any]) -> bool:
    """Whether a model of this very class is somewhere in the settings."""
    if type(settings) is model:
        return True
    if isinstance(settings, Mapping):
        return any(uses(value, model) for value in settings.values())
    if is_dataclass(settings):
        return any(uses(getattr(settings, f.name), model) for f in fields(settings) if f.init)
    return False


def same_values(experiment: Experiment, values: Mapping[str, Any]) -> bool:
    """Whether all parameters have these values; a path that does not exist is refused here."""
    return all([_same_value(params.get(experiment, path), new) for path, new in values.items()])


def _same_value(old: Any, new: Any) -> bool:
    new = tuple(new) if isinstance(new, list) else new
    return type(old) in (bool, int, float, str, tuple) and bool(old == new)


def with_seed(experiment: Experiment, seed: int) -> Experiment:
    """The experiment with its one seed, which a simulation keeps its own copy of."""
    source = experiment.source
    if hasattr(source, "seed"):
        source = replace(source, seed=seed)  # type: ignore[type-var]
    return replace(experiment, seed=seed, source=source)
