"""What stands around a user's model: it names a wrong result before numpy trips over it, feeds
rows one by one to a function that is not batched, and tells other threads what is being computed.

The built-in models run without it. A guarded class is the user's class with its contract methods
wrapped, so parameters, help texts and identity stay what they were.
"""

from __future__ import annotations

import copy
import inspect
from abc import ABCMeta
from collections.abc import Callable, Mapping
from dataclasses import FrozenInstanceError
from functools import wraps
from pathlib import Path
from threading import current_thread, get_ident, main_thread
from time import monotonic
from typing import Any, cast

import numpy as np

from scene_core.geometry.numdiff import central_differences
from scene_core.models.base import Lifted, Normalised, Redefined, completed
from scene_core.models.contracts import Contract, contracts_of, dimensions
from scene_core.models.rows import looped, rows_of

MISSING = "_left_to_numbers"
"""Attribute of a watched instance: the Jacobians its functions left out."""

UNBATCHED = "_fed_row_by_row"
"""Attribute of a guarded class: which of its methods are not batched."""


class ModelError(RuntimeError):
    """A user's model returned what can not be a result; the message names the part."""


class Abandoned(BaseException):
    """Ends a thread whose call somebody has given up waiting for."""


class Call:
    """A method of a user's model that has not returned yet."""

    def __init__(self, model: Any, method: str) -> None:
        self.cls: type[Any] = type(model)
        self.model, self.method, self.since = str(model.name), method, monotonic()
        self._claim = [self]

    @property
    def seconds(self) -> float:
        return monotonic() - self.since

    def claim(self) -> bool:
        """True for the first who asks: the call itself when it returns, or who gives it up."""
        try:
            self._claim.pop()  # atomic
        except IndexError:
            return False
        return True


_calls: dict[int, Call] = {}


def under_way(thread: int | None) -> Call | None:
    """What a thread is computing in a user's model, if it is."""
    return _calls.get(thread or 0)


def guarded(cls: type[Any], unbatched: frozenset[str] = frozenset()) -> type[Any]:
    """The class with every contract method checked; those in `unbatched` are fed row by row."""

    def wrap(name: str, contract: Contract, method: Callable[..., Any]) -> Callable[..., Any]:
        where = f"{_place(method)}'{cls.name}'.{name}"

        def one(self: Any, *args: Any) -> Any:
            given = tuple(_read_only(a) for a in args)
            return _result(self, where, name, contract, given, lambda *a: method(self, *a))

        run = looped(one, contract) if name in unbatched else one

        @wraps(method)
        def call(self: Any, *args: Any, **named: Any) -> Any:
            if named:
                bound = inspect.signature(method).bind(self, *args, **named)
                args = bound.args[1:]
            return _watched(self, name, lambda: run(self, *args))

        return call

    return _wrapped(cls, wrap, {UNBATCHED: unbatched})


def watched(model: Any) -> tuple[Any, set[str]]:
    """A copy of a model, and the set in which the Jacobians it leaves to numbers are collected
    while its functions are used."""
    missing: set[str] = set()

    def wrap(name: str, contract: Contract, method: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(method)
        def call(self: Any, *args: Any, **named: Any) -> Any:
            result = method(self, *args, **named)
            _note_missing(self, name, contract, result)
            return result

        return call

    twin = copy.copy(model)
    object.__setattr__(twin, MISSING, missing)
    if not is_guarded(type(model)):
        object.__setattr__(twin, "__class__", _wrapped(type(model), wrap, {}))
    return twin, missing


def is_guarded(cls: type[Any]) -> bool:
    """Whether a class is a user's."""
    return UNBATCHED in vars(cls)


def unbatched(cls: type[Any]) -> frozenset[str]:
    """Methods of a guarded class that are fed row by row."""
    return vars(cls).get(UNBATCHED, frozenset())


def _wrapped(
    cls: type[Any],
    wrap: Callable[[str, Contract, Callable[..., Any]], Callable[..., Any]],
    extra: Mapping[str, Any],
) -> type[Any]:
    methods = {name: wrap(name, c, getattr(cls, name)) for name, c in contracts_of(cls).items()}
    # The same module and name: the help texts of the parameters are found in the user's file.
    place = {"__module__": cls.__module__, "__qualname__": cls.__qualname__, "__doc__": cls.__doc__}
    kept = {"__setattr__": _unchangeable, **extra, **methods}
    return ABCMeta(cls.__name__, (cls,), {**place, **kept})


def _unchangeable(model: Any, name: str, value: Any) -> None:
    """A frozen dataclass guards but its own fields in a class derived from it."""
    raise FrozenInstanceError(
        f"cannot set self.{name}: a model is a value that remembers nothing, a frame may be done "
        "again; what changes belongs into the state"
    )


def _watched(model: Any, method: str, work: Callable[[], Any]) -> Any:
    thread = get_ident()
    if thread in _calls:
        return work()
    call = _calls[thread] = Call(model, method)
    try:
        return work()
    except SystemExit as e:
        raise ModelError(f"'{model.name}'.{method} called sys.exit({e.code})") from e
    except KeyboardInterrupt as e:
        if current_thread() is main_thread():
            raise  # somebody pressed Ctrl+C
        raise ModelError(f"'{model.name}'.{method} raised KeyboardInterrupt") from e
    finally:
        del _calls[thread]
        if not call.claim():
            raise Abandoned


def _place(method: Any) -> str:
    """File and line of a function, for a message."""
    code = getattr(method, "__code__", None)
    return f"{Path(code.co_filename).name}, line {code.co_firstlineno}: " if code else ""


def _result(
    model: Any,
    where: str,
    name: str,
    contract: Contract,
    args: tuple[Any, ...],
    method: Callable[..., Any],
) -> Any:
    """The result as the contract has it; raises ModelError where it can not be."""
    result: Any = method(*args)
    if result is None and contract.may_be_none:
        return None
    dims, lead = dimensions(model, name, args), rows_of(contract, args)
    if contract.result is None:
        array = _array(where, name, result, lead, contract.parts[0], dims, contract.dtype)
        return _finite(where, name, array) if contract.is_finite else array
    if isinstance(result, np.ndarray):
        result = contract.result(result)
    if not isinstance(result, contract.result):
        wanted = contract.result.__name__
        raise ModelError(f"{where} returned {type(result).__name__}, not {wanted} or an array")
    _note_missing(model, name, contract, result)
    parts: list[Any] = []
    for i, (part, value) in enumerate(zip(contract.result._fields, cast(Any, result), strict=True)):
        shape = contract.parts[i] if i < len(contract.parts) else None
        if value is None and i == 0:
            raise ModelError(f"{where}: {part} is None")
        parts.append(
            None
            if value is None
            else _finite(
                where, part, _array(where, part, value, lead, shape, dims, may_broadcast=i > 0)
            )
        )
    return _filled(contract.result(*parts), args, method)


def _array(
    where: str,
    part: str,
    value: Any,
    lead: tuple[int, ...],
    shape: str | None,
    dims: Mapping[str, int],
    dtype: type = float,
    may_broadcast: bool = False,
) -> np.ndarray:
    try:
        array = np.asarray(value)
        if np.iscomplexobj(array):
            raise ModelError(f"{where}: {part} holds complex numbers")
        array = array.astype(np.float64) if dtype is float else array
    except (TypeError, ValueError) as e:
        raise ModelError(f"{where}: {part} is no array of numbers ({e})") from None
    if dtype is not float and array.dtype.kind not in ("b" if dtype is bool else "iu"):
        kind = "true or false" if dtype is bool else "whole numbers (Fault)"
        raise ModelError(f"{where}: {part} holds {array.dtype}, not {kind}")
    if shape is not None and all(d in dims for d in shape.split()):
        core = tuple(dims[d] for d in shape.split())
        fits = array.shape == lead + core
        if may_broadcast and not fits:
            ahead = array.shape[: array.ndim - len(core)]
            ends = array.shape[array.ndim - len(core) :] == core and array.ndim >= len(core)
            fits = ends and _broadcasts(ahead, lead)
        if not fits:
            raise ModelError(f"{where}: {part} has shape {array.shape}, not {lead + core}")
    return array


def _finite(where: str, part: str, array: np.ndarray) -> np.ndarray:
    if not np.isfinite(array).all():
        raise ModelError(f"{where}: {part} is not finite")
    return array


def _read_only(a: Any) -> Any:
    """An argument that a function can not change by oversight, like `xv[2] += w`."""
    if not isinstance(a, np.ndarray):
        return a
    a = a.view()
    a.flags.writeable = False
    return a


def _broadcasts(shape: tuple[int, ...], to: tuple[int, ...]) -> bool:
    try:
        return np.broadcast_shapes(shape, to) == to
    except ValueError:
        return False


def _filled(result: Any, args: tuple[Any, ...], method: Callable[..., Any]) -> Any:
    """Jacobians that callers take for granted, by central differences where they were left out."""

    def value(*a: Any) -> tuple[Any]:
        again = method(*a)
        return (again if isinstance(again, np.ndarray) else again[0],)

    if isinstance(result, (Normalised, Redefined)):
        return completed(result, value, *args)
    if isinstance(result, Lifted) and result.dxv_by_dxp is None:
        J = central_differences(lambda xp: value(xp)[0], args, 0)
        return result._replace(dxv_by_dxp=J)
    return result


def _note_missing(model: Any, name: str, contract: Contract, result: Any) -> None:
    missing = getattr(model, MISSING, None)
    if missing is None or contract.result is None or not isinstance(result, contract.result):
        return
    count = len(contract.parts)
    for part, value in zip(contract.result._fields[:count], cast(Any, result)[:count], strict=True):
        if value is None:
            missing.add(part if part.startswith("d") else f"{name}.{part}")
