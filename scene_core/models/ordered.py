"""Pairs of parameters that only make sense in one order."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from scene_core.params import ParamError


def demand_order(model: Any) -> None:
    """Raise ParamError where a parameter of a model that was declared to be `below` another one is
    above it. Lengths have to be apart, numbers of things may be equal."""
    for f in fields(model):
        upper = f.metadata.get("param", {}).get("below")
        if upper:
            _demand(model, f.name, upper, apart=isinstance(f.default, float))


def _demand(model: Any, lower: str, upper: str, apart: bool) -> None:
    low, high = getattr(model, lower), getattr(model, upper)
    if low < high or (low == high and not apart):
        return
    meta = {f.name: f.metadata["param"] for f in fields(model) if f.name in (lower, upper)}
    least, most = meta[lower]["lo"], meta[upper]["hi"]
    unit = f" {meta[lower]['unit']}" if meta[lower]["unit"] else ""
    is_off, edge = ("is not below", "to below") if apart else ("is above", "to")
    raise ParamError(
        f"'{model.name}': {lower} = {low:g}{unit} {is_off} {upper} = {high:g}{unit}: give {lower} "
        f"from {least:g} {edge} {high:g}{unit}, or first raise {upper} (to at most {most:g}{unit})"
    )
