"""The user's models of this process: what is loaded, what is offered, what was saved since.

The thread that watches the folder owns the library; everybody else looks at the registry, and at
what the library says, which are values that are replaced as a whole.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import MISSING, fields, replace
from pathlib import Path
from threading import Event, Thread
from typing import Any

from scene_core import params
from scene_core.models import registry
from scene_core.models.declared import declares_models, without_base
from scene_core.models.missing import broken_import
from scene_core.models.plugins import (
    UserFile,
    UserModel,
    in_time,
    installed,
    load_file,
    without_model,
)
from scene_core.models.registry import KINDS

POLL_S = 0.25
_BASES = frozenset(base.__name__ for base in KINDS.values())


class Library:
    """The user's models: a folder, and what is installed. One thread at a time."""

    def __init__(self, folder: str | Path | None) -> None:
        """Load everything. Raises ParamError when there is no such folder."""
        # Absolute: a file that is run may go to another folder.
        self.folder = None if folder is None else Path(folder).absolute()
        if self.folder is not None and not self.folder.is_dir():
            is_file = self.folder.is_file()
            what = "that is a file, not a folder" if is_file else "there is no such folder"
            raise params.ParamError(
                f"--models {folder}: {what}; give one with .py files of your own"
            )
        self._installed = installed()
        self._files: dict[Path, UserFile] = {}
        self._loaded: dict[Path, tuple[int, int]] = {}
        self._seen: dict[Path, tuple[int, int]] = {}
        self._good: dict[tuple[str, str, str], UserModel] = {}
        """The last conforming version by file, kind and name."""
        self.files: tuple[UserFile, ...] = ()
        """All files with models as they were last saved, with clashes named."""
        self.others: tuple[str, ...] = ()
        """Names of the files that declare no model: they are not executed."""
        self._seen = self._stamps()
        self._load(self._seen)

    def refresh(self) -> tuple[str, ...]:
        """Load what was saved since the last call; a sentence for each file that changed.

        A file is loaded when it looks the same twice: an editor may be in the middle of writing.
        """
        now = self._stamps()
        settled = {p: s for p, s in now.items() if self._seen.get(p) == s}
        self._seen = now
        changed = {p: s for p, s in settled.items() if self._loaded.get(p) != s}
        gone = [p for p in self._loaded if p not in now]
        if not changed and not gone:
            return ()
        for path in gone:
            del self._loaded[path]
            self._good = {k: m for k, m in self._good.items() if k[0] != path.name}
        lost = [path for path in gone if self._files.pop(path, None) is not None]
        self._load(changed)
        names = {path.name for path in changed}
        said = [_saved(f, self._offered_of(f.name)) for f in self.files if f.name in names]
        said += [f"{p.name} is gone: its models are not offered any more" for p in lost]
        said += [
            f"{name} declares no model: it was not run" for name in self.others if name in names
        ]
        return tuple(said)

    def _stamps(self) -> dict[Path, tuple[int, int]]:
        if self.folder is None:
            return {}
        stamps = {}
        try:
            paths = sorted(self.folder.glob("*.py"))
        except OSError:
            return {}
        for path in paths:
            try:
                status = path.stat()
            except OSError:
                continue  # deleted since it was listed
            if not path.name.startswith("_"):
                stamps[path] = (status.st_mtime_ns, status.st_size)
        return stamps

    def _load(self, stamps: Mapping[Path, tuple[int, int]]) -> None:
        for path, stamp in stamps.items():
            self._loaded[path] = stamp
            if declares_models(path):
                self._files[path] = in_time(path.name, lambda p=path: load_file(p))
            elif wrong := broken_import(path) or without_base(path, _BASES):
                self._files[path] = UserFile(path.name, problem=wrong)
            elif any(file == path.name for file, _, _ in self._good):
                self._files[path] = without_model(path.name)
            else:
                self._files.pop(path, None)
        self.others = tuple(p.name for p in sorted(self._loaded) if p not in self._files)
        self._offer()

    def _offer(self) -> None:
        """Put into the registry what conforms, and why the rest does not."""
        offered: dict[str, dict[str, type[Any]]] = {kind: {} for kind in KINDS}
        refused: dict[str, dict[str, str]] = {kind: {} for kind in KINDS}
        owner: dict[tuple[str, str], str] = {}
        shown = []
        for file in (*self._installed, *(self._files[p] for p in sorted(self._files))):
            models = tuple(self._placed(m, owner) for m in file.models)
            shown.append(replace(file, models=models))
            still = [m for m in models if m.conforms] + self._earlier(file, models)
            for model in still:
                if model.cls is not None:
                    offered[model.kind][model.name] = model.cls
            for model in models:
                if model.problem and model.kind and model.name not in offered[model.kind]:
                    refused[model.kind][model.name] = model.problem
        self.files = tuple(shown)
        registry.add(registry.Added(offered, refused))

    def _placed(self, model: UserModel, owner: dict[tuple[str, str], str]) -> UserModel:
        """The model, or the same with the reason why its name is taken."""
        if not model.conforms:
            return model
        key = (model.kind, model.name)
        where = f"{model.file}, line {model.line}" if model.line else model.file
        if key in owner:
            problem = (
                f"{where}: '{model.name}' is the name of a model of {owner[key]}: give it another"
            )
            return replace(model, problem=problem)
        owner[key] = model.file
        self._good[(model.file, *key)] = model
        return model

    def _earlier(self, file: UserFile, models: tuple[UserModel, ...]) -> list[UserModel]:
        """Earlier versions that stay because the file as saved has no conforming one: it can not
        be read, or the model fails."""
        failing = {(m.kind, m.name) for m in models if not m.conforms}
        return [
            good
            for (name, *key), good in self._good.items()
            if name == file.name and (file.problem or tuple(key) in failing)
        ]

    def _offered_of(self, file: str) -> frozenset[str]:
        return frozenset(
            model.name
            for (name, kind, _), model in self._good.items()
            if name == file and registry.models(kind).get(model.name) is model.cls
        )


def _saved(file: UserFile, offered: frozenset[str]) -> str:
    """What became of a saved file."""
    if file.problem:
        stays = f"; {_listed(offered)} as before" if offered else ""
        return f"{file.problem}{stays}"
    said = [
        f"'{m.name}' conforms" if m.conforms else m.problem + _stays(m, offered)
        for m in file.models
    ]
    return f"{file.name} was saved: {'; '.join(said)}"


def _stays(model: UserModel, offered: frozenset[str]) -> str:
    return "; its earlier version stays" if model.name in offered else ""


def _listed(names: frozenset[str]) -> str:
    return " and ".join(f"'{n}' stays" for n in sorted(names))


def carried(old: Any, cls: type[Any]) -> Any:
    """A new version of a model with the parameters that were edited on the old one; those left at
    their defaults take the defaults of the new one.

    Raises ParamError with the values that the new one refuses, whatever its own check of them
    raises: each may be in its range and all of them not fit together.
    """
    kept: dict[str, Any] = {}
    there = {f.name: f for f in fields(old) if f.init}
    for f in fields(cls):
        before = there.get(f.name)
        meta = f.metadata.get("param")
        if before is None or meta is None or f.default is MISSING:
            continue
        if getattr(old, f.name) == before.default:
            continue
        try:
            kept[f.name] = params.check_value(f.name, getattr(old, f.name), f.default, meta)
        except params.ParamError:
            continue  # outside its new range: the new default holds
    if not kept:
        return cls()
    try:
        return cls(**kept)
    except Exception as why:  # a user's model may raise anything
        values = ", ".join(f"{name} = {value}" for name, value in kept.items())
        raise params.ParamError(
            f"'{cls.name}' can not take over {values} from the '{old.name}' that is there, which "
            f"stays: {why}"
        ) from why


class Watcher:
    """A thread that looks whether files were saved, and says what became of them."""

    def __init__(self, library: Library, tell: Callable[[tuple[str, ...]], None]) -> None:
        self._library, self._tell = library, tell
        self._stop = Event()
        self._thread = Thread(target=self._run, name="models", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        self._stop.set()
        self._thread.join(timeout=2.0)

    def _run(self) -> None:
        while not self._stop.wait(POLL_S):
            said = self._library.refresh()
            if said:
                self._tell(said)
