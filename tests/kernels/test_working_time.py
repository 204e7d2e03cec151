"""Processor time without that of loading kernels."""

import time

import pytest

from relnav_sim.kernels import compiling


def busy(seconds):
    end = time.process_time() + seconds
    while time.process_time() < end:
        pass


def test_loading_a_kernel_is_no_work_of_who_calls_it_first(monkeypatch):
    def compiled(self):
        busy(0.06)
        return lambda: busy(0.02)

    monkeypatch.setattr(compiling.Uncompiled, "compiled", compiled)
    kernel = compiling.Uncompiled(busy, (), wide=False)
    before, working = time.process_time(), compiling.working_cpu_s()
    kernel()
    took, worked = time.process_time() - before, compiling.working_cpu_s() - working
    assert took - worked >= 0.06
    assert 0.02 <= worked == pytest.approx(took - 0.06, abs=0.02)
