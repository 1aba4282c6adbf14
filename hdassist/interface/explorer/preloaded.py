"""Imports for the server process from which the explorer's processes are forked; only this process imports the module.

The server process ends together with the explorer, however the explorer ends, and its forked processes end with it.
"""

import os

import hdassist.interface.explorer.compute  # noqa: F401 (forked processes inherit the module)
from hdassist.run.run import begin_worker

begin_worker(os.getppid())
