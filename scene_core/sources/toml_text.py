"""TOML that a user wrote."""

from __future__ import annotations

import tomllib
from typing import Any


def parsed(text: str) -> dict[str, Any]:
    """What a TOML text says. Raises ValueError with why it can not be read, also where the parser
    itself gives up."""
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        raise
    except RecursionError:
        raise ValueError("its lists are nested too deeply") from None
    except ValueError:
        raise ValueError("it has a number of thousands of digits") from None
