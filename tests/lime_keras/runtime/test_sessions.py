"""Sessions in forked children, and on the processors that the process may use."""

import os
import subprocess
import sys

import numpy as np
import pytest

from lime_keras import Estimator, console

_SECONDS = 60  # time after which a child counts as hanging; it takes less than one second

FORKS = """
import os, sys
import numpy as np
from lime_keras import Estimator

photo = np.random.default_rng(0).integers(0, 256, (32, 32, 3), np.uint8)
estimator = Estimator(sys.argv[1])
expected = estimator.estimate(photo).exponent

def ends():
    pass

def estimates():
    assert estimator.estimate(photo).exponent == expected

def replaces():
    global estimator
    estimator = Estimator(sys.argv[1], only=["exponent"])
    assert estimator.estimate(photo).exponent == expected

def forks():
    estimates()
    end(estimates)

def end(work):
    child = os.fork()
    if not child:
        work()
        sys.exit(7)
    print(work.__name__, os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)

for work in (ends, estimates, replaces, forks):
    end(work)
estimates()
print("parent")
"""

THREADS = """
import os, sys
import numpy as np
from lime_keras import Estimator

Estimator(sys.argv[1]).estimate(np.full((32, 32, 3), 99, np.uint8))
for thread in os.listdir("/proc/self/task"):
    print(*os.sched_getaffinity(int(thread)))
"""


def run(code, *arguments):
    done = subprocess.run(
        [sys.executable, "-c", code, *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=_SECONDS,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


def test_a_forked_child_estimates_and_ends(tiny_model):
    """Each child ends by itself with its own status; before, it waited for its parent's threads."""
    assert run(FORKS, tiny_model) == [
        *("ends 7", "estimates 7", "replaces 7"),
        *("estimates 7", "forks 7"),
        "parent",
    ]


@pytest.mark.skipif(len(os.sched_getaffinity(0)) < 2, reason="there is one processor alone")
def test_threads_stay_on_the_processors_of_the_process(tiny_model):
    first = min(os.sched_getaffinity(0))
    code = f"import os\nos.sched_setaffinity(0, {{{first}}})\n{THREADS}"
    assert set(run(code, tiny_model)) == {str(first)}


def test_a_fork_of_tensorflow_is_refused(tiny_model, monkeypatch):
    estimator = Estimator(tiny_model, engine="keras")
    monkeypatch.setattr(console, "_RAN_TENSORFLOW", {os.getpid() + 1})  # of the parent
    with pytest.raises(RuntimeError, match="spawn"):
        estimator.estimate(np.full((32, 32, 3), 99, np.uint8))
    with pytest.raises(RuntimeError, match="spawn"):
        Estimator(tiny_model, engine="keras")
