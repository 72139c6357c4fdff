"""Pairs of parameters that only make sense in one order."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from scene_core.params import ParamError


def demand_order(model: Any, lower: str, upper: str, apart: bool = False) -> None:
    """Raise ParamError where the parameter `lower` of a model is above its `upper`; where they are
    equal too, if they have to be `apart`."""
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
