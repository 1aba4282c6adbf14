"""Standard output is for answers."""

import subprocess
import sys

CODE = """
import os, sys
from hdassist.drive.solve.loadcase import muted_output
print("before", flush=True)
with muted_output():
    os.write(1, b"banner")
print("after")
"""


def test_library_output_is_not_part_of_the_result():
    done = subprocess.run([sys.executable, "-c", CODE], capture_output=True, text=True, check=True)
    assert done.stdout == "before\nafter\n"


def test_a_closed_output_is_no_fault():
    closed = CODE.replace('print("before", flush=True)', "os.close(1)").replace('print("after")', "sys.stdout = None")
    code = closed.replace('os.write(1, b"banner")', 'print("went on", file=sys.stderr)')
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr == "went on\n"
