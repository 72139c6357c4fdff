"""The command `scene`: `serve` starts the page, everything else is the library's command line."""

from __future__ import annotations


def main() -> None:
    """Run the command line."""
    raise SystemExit("scene: nothing to run yet")
