"""Medians with their spread, and what machine they were measured on."""

from __future__ import annotations

import os
import platform
from collections.abc import Sequence

import numpy as np


def machine() -> str:
    """Processor count, load and BLAS kernel: quote them with every figure."""
    load = ", ".join(f"{x:.1f}" for x in os.getloadavg())
    kernel = os.environ.get("OPENBLAS_CORETYPE", "automatic")
    return (
        f"Python {platform.python_version()}, numpy {np.__version__}, {os.cpu_count()} processors, "
        f"load {load}, BLAS kernel {kernel}"
    )


def spread(values: Sequence[float] | np.ndarray, unit: str = "ms") -> str:
    """Median [10 %, 90 %]."""
    low, mid, high = np.percentile(np.asarray(values, dtype=float), [10, 50, 90])
    return f"{mid:.3g} {unit} [{low:.3g}, {high:.3g}]"


def table(title: str, rows: Sequence[tuple[str, str]]) -> None:
    """Print rows of name and figure under a title."""
    print(f"\n{title}")
    width = max(len(name) for name, _ in rows)
    for name, figure in rows:
        print(f"  {name:<{width}}  {figure}")
