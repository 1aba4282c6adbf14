"""Imports of the process that the explorer's processes are forked from; for it alone to import.

It ends with the screen, in whatever way that ends, and with it all that it forked.
"""

import os

import hdassist.explorer.compute  # noqa: F401 (so that forked processes have it)
from hdassist.run.run import begin_worker

begin_worker(os.getppid())
