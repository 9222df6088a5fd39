"""MuJoCo's own tests of its renderer, with our class in the place of its own."""

import subprocess
import sys

import pytest
from conftest import version

RUN = """
import sys
import mujoco
import kinetoscope_render as kr
mujoco.Renderer = kr.Renderer
if sys.argv[1:] == ["broken"]:
    kr.Renderer.render = lambda self, out=None: None
import absl.testing.absltest as absltest
import mujoco.renderer_test as tests
sys.argv = sys.argv[:1]
absltest.main(module=tests)
"""
# Tests that fail: images larger than `offwidth` are rendered.
EXPECTED = {"test_renderer_del_safe_when_init_fails_early"} if version() >= (4, 0) else set()


@pytest.mark.parametrize("mode", ["ours", "broken"])
def test_renderer_test(mode):
    run = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", RUN, mode], capture_output=True, text=True, check=False, timeout=300
    )
    words = [line.split() for line in run.stderr.splitlines()]
    failed = {line[1] for line in words if line[:1] in (["FAIL:"], ["ERROR:"])}
    assert any(line[:1] == ["Ran"] and int(line[1]) >= 3 for line in words), run.stderr
    if mode == "ours":
        assert failed == EXPECTED, run.stderr
    else:  # the control
        assert len(failed - EXPECTED) >= 2, failed
