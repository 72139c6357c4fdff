"""Reference values of the ancestors' functions."""

import json

import numpy as np
import pytest


@pytest.fixture(scope="module")
def slamtb(golden):
    """`slamtb("toFrame")`: inputs and outputs of a function of the toolbox, as recorded."""
    records = json.loads(golden("slamtb_functions.json").read_text())["records"]

    def named(name):
        chosen = [r for r in records if r["name"] == name]
        assert chosen, name
        return [
            ({k: np.array(v) for k, v in r["inputs"].items()},
             {k: np.array(v) for k, v in r["outputs"].items()})
            for r in chosen
        ]  # fmt: skip

    return named
