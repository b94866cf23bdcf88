"""Other processors, emulated on this one: BLAS, NumPy, the C library and llvmpipe."""

import os
import subprocess
import sys

import numpy as np


def _numpy_features():
    """Features that this processor has beyond NumPy's baseline: those that can be disabled."""
    from numpy._core._multiarray_umath import __cpu_dispatch__, __cpu_features__

    return " ".join(name for name in __cpu_dispatch__ if __cpu_features__.get(name))


def emulated_environment(driver=True):
    """Environment of a process on an older x86-64 processor; elsewhere what of it applies.

    Args:
        driver: llvmpipe is on it, too.
    """
    environment = {
        **os.environ,
        "OPENBLAS_CORETYPE": "Prescott",
        "NPY_DISABLE_CPU_FEATURES": _numpy_features(),
        "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-AVX512F",
    }
    if driver:
        # instructions and vectors of 128 bits; LP_NATIVE_VECTOR_WIDTH=128 alone needs a cache of
        # shaders of its own: Mesa's does not tell code of one width from that of another
        environment["GALLIUM_OVERRIDE_CPU_CAPS"] = "sse4.1"
    return environment


def run_emulated(code, *arguments, driver=True):
    """Output of Python code in a process on the emulated processor."""
    done = subprocess.run(
        [sys.executable, "-c", code, *map(str, arguments)],
        env=emulated_environment(driver), capture_output=True, text=True, timeout=600,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


def omnisim_emulated(*arguments):
    """Output of a command on the emulated processor."""
    code = "import sys; from omnisim.apps.cli.app import main; main()"
    return run_emulated(code, *arguments)


def rounds_otherwise():
    """True where the emulated processor really computes other bits."""
    code = "import sys, numpy as np; sys.stdout.write(str(float(np.sin(np.arange(1e4)).sum())))"
    matrix = (
        "import numpy as np; r = np.random.default_rng(0); "
        "print((r.normal(size=(64, 4, 4)) @ r.normal(size=(4, 4))).tobytes().hex())"
    )
    generator = np.random.default_rng(0)
    here = (generator.normal(size=(64, 4, 4)) @ generator.normal(size=(4, 4))).tobytes().hex()
    same_sines = run_emulated(code) == str(float(np.sin(np.arange(1e4)).sum()))
    return not (same_sines and run_emulated(matrix).strip() == here)
