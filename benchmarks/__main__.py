"""All benchmarks: `python -m benchmarks [--soak MINUTES]`."""

from __future__ import annotations

import sys
from importlib.util import find_spec

from threadpoolctl import threadpool_limits

from benchmarks import frames, page
from benchmarks.figures import machine

threadpool_limits(1)
print(machine())
frames.main()
page.main(sys.argv[1:])
if find_spec("playwright"):
    from benchmarks import screen

    screen.main([])
else:
    print("\nscreen: not measured, playwright is not installed; `make test` installs it")
print(machine())
